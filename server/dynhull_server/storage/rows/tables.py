"""The tables, and how a database reads and changes their rows."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from ..port import StorageError

if TYPE_CHECKING:
    from array import array

# The present format of rows, which has consumers of feeds; and the first ones with fences, delayed events, events
# of many fences in a row, the commits of batches, and segments of the past.
FORMAT = 14
FENCES_SINCE, DELAYS_SINCE, STARTS_SINCE, COMMITS_SINCE, SEGMENTS_SINCE = 4, 6, 7, 11, 12

# The columns of each table in the present format; the first is the number of the row.
COLUMNS = {
    "hulls": ("id", "name", "uid", "created", "settings", "checksum"),
    "batches": ("rowid", "hull", "first", "last", "checksum", "payload", "commit_number", "committed"),
    "snapshots": ("id", "hull", "revision", "chunks", "state", "checksum"),
    "chunks": ("rowid", "snapshot", "number", "checksum", "points"),
    "segments": ("id", "hull", "first", "last", "file", "facts", "checksum"),
    "fences": ("id", "name", "uid", "created", "config", "checksum"),
    "events": ("rowid", "fence", "first", "last", "checksum", "payload"),
    "insides": ("rowid", "fence", "sequence", "part", "parts", "checksum", "payload"),
    "consumers": ("rowid", "fence", "name", "acknowledged", "lost", "checksum"),
    "delays": ("rowid", "fence", "checksum", "payload"),
    "starts": ("rowid", "fence", "first", "checksum"),
}
# Those that may be NULL: rows of earlier formats do not have them.
OPTIONAL = frozenset({"commit_number", "committed"})
TOTALS_COLUMNS = ("commits", "hulls", "batches", "sum", "next_number", "mode", "fence_rows", "committed", "checksum")

# The fence, and the first and last sequence, of a row with the events of many fences. A row that a format up to 6 has
# written has events of one fence, and another encoding.
MANY = (0, 0, 0)


class UnreadableError(StorageError):
    """The database itself is damaged: it cannot read a row."""


class Insert(NamedTuple):
    """A new row of a table; its values are in the order of COLUMNS."""

    table: str
    values: tuple[Any, ...]


class Remove(NamedTuple):
    """Deletes rows of a table; those that do not exist are ignored."""

    table: str
    places: Sequence[int]


class Replace(NamedTuple):
    """Replaces the payload of a row of events."""

    place: int
    checksum: int
    payload: bytes


Statement = Insert | Remove | Replace


class Reader(Protocol):
    """Reads rows, as of one moment.

    The columns that a method is given are SQL expressions which every database understands.

    Attributes:
        version: the format of the rows.

    Raises:
        UnreadableError: the database is damaged.
        StorageError: it cannot be read at present.
    """

    version: int

    def count(self, table: str) -> int:
        """The number of rows of a table, or somewhat more: what the progress goes up to."""

    def every(self, table: str, columns: str) -> Iterator[tuple[Any, ...]]:
        """Some columns of all rows of a table, ordered by the number of the row."""

    def some(self, table: str, columns: str, places: "array[int]") -> Iterator[tuple[Any, ...]]:
        """Some columns of the rows with these numbers, in this order; rows that do not exist are left out.

        The column with the number of the row is given as `table.column`.
        """

    def totals(self) -> list[tuple[Any, ...]]:
        """The rows of the totals, without their numbers."""
