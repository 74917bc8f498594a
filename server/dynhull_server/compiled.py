"""What the server does for each event of a fence, batch of the past and short message, in C++ if that is built.

What calls it does the same without.

The environment variable DYNHULL_KERNEL decides for the library and for this.
"""

from typing import TYPE_CHECKING, Protocol

from dynhull import KERNEL

if TYPE_CHECKING:
    from typing import Any

    import numpy.typing as npt


class Numbers(Protocol):
    """A dictionary of integers, those of fences: a real one, or the class of that name in C++."""

    def __len__(self) -> int: ...

    def __contains__(self, key: int, /) -> bool: ...

    def __getitem__(self, key: int, /) -> int: ...

    def __setitem__(self, key: int, value: int, /) -> None: ...

    def pop(self, key: int, /) -> int:
        """Remove an integer, and return its value; KeyError if it is not there."""


class LastPlaces(Protocol):
    """Of each key the last place that batches of the journal give it."""

    def add(self, payloads: list[bytes], batches: list[int]) -> int:
        """Add payloads with so many batches each, up to the first that cannot be; the number of those that are."""

    def taken(self) -> tuple[int, int, bytes, bytes, bytes, bytes, bytes, bytes, bytes]:
        """The clock and the cause of the last batch, keys that are put, and keys that are removed.

        Keys are their lengths and their text. After them are the points, times and deadlines of those that are put.
        """


class Native(Protocol):
    """The module `dynhull_server._native`. mypy compares it with the module's stub."""

    Numbers: "type[Any]"
    LastPlaces: "type[Any]"

    def numbered(
        self,
        waiting: "list[Any]",
        names: "tuple[str, ...]",
        types: bytes,
        places: "Any",
        table: "npt.NDArray[Any]",
        last: int,
        time: int,
    ) -> "tuple[bytes, bytes, bytes, bytes]":
        """The bytes of runs, rows, keys and what is said of the fences: `numbered_natively` in state/fences."""

    def encoded(
        self,
        runs: "npt.NDArray[Any]",
        rows: "npt.NDArray[Any]",
        keys: bytes,
        own: "npt.NDArray[Any]",
        names: "tuple[str, ...]",
        more: int,
    ) -> bytes:
        """What `encode_block` in storage/rows puts before members and origins."""

    def followed(
        self,
        runs: "npt.NDArray[Any]",
        places: "Any",
        table: "npt.NDArray[Any]",
        last: int,
        news: "Any",
    ) -> bool:
        """Whether runs follow the last events of their fences: `FenceRuns.follow` in storage/rows."""

    def own(
        self,
        runs: "npt.NDArray[Any]",
        places: "Any",
        table: "npt.NDArray[Any]",
        subjects: int,
        names: "tuple[int, ...]",
    ) -> bytes | None:
        """`FenceRuns.own` in storage/rows; None if a fence does not exist."""

    def added(
        self,
        runs: "npt.NDArray[Any]",
        places: "Any",
        table: "npt.NDArray[Any]",
        last: int,
        news: "npt.NDArray[Any]",
        end: int,
        row: int,
    ) -> None:
        """`FenceRuns.add` in storage/rows, where there is room."""

    def counted(
        self,
        places: "npt.NDArray[Any]",
        news: "tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]",
        table: "npt.NDArray[Any]",
        columns: "tuple[int, int, int, int, int]",
    ) -> None:
        """`Tallies.take` in state/fences."""

    def points_message(self, data: bytes) -> "tuple[bytes, bool, int] | None":
        """What `rpc/short_batches.py` makes of a message; None for one that goes the whole way."""

    def puts_message(
        self, data: bytes
    ) -> "tuple[bytes, bool, list[tuple[int, bytes | None, bytes, bytes, bytes]]] | None":
        """The same of a message with batches that put keys."""

    def acknowledged(self, sequence: int, fields: "tuple[Any, ...]") -> bytes | None:
        """A StreamResponse with a result: `acknowledgement` in rpc/short_batches.py."""

    def results(self, outcomes: "list[tuple[int, tuple[Any, ...]]]") -> bytes | None:
        """A StreamResponse with several results: `acknowledgements` in rpc/short_batches.py."""

    def footer_groups(
        self, footer: bytes, column: int
    ) -> "tuple[int, int, list[tuple[int, bytes | None, bytes | None, int]]] | None":
        """Where the groups of rows of a file lie in its footer: `_chosen` in storage/segments/parquet.py."""

    def keys_at(self, ends: "npt.NDArray[Any]", text: bytes, codes: "npt.NDArray[Any]") -> "tuple[bytes, bytes]":
        """The lengths and the text of keys: `_Words.keys` in storage/segments/parquet.py."""

    def key_codes(self, lengths: bytes, data: bytes) -> bytes:
        """`_codes` in storage/segments/gathered.py."""

    def plain_batches(
        self, payloads: "list[bytes]", first: int, kind: int, wanted: "list[bytes] | None"
    ) -> "tuple[bytes, ...]":
        """The columns of `_plain` in storage/rows/batch_columns.py, of keys those that are wanted."""


def _load() -> Native | None:
    if KERNEL == "python":
        return None
    try:
        from . import _native
    except ModuleNotFoundError:
        return None
    return _native


native = _load()


def numbers() -> Numbers:
    """No integers."""
    return {} if native is None else native.Numbers()
