"""Keys of entities: strings of 1 to 255 bytes in UTF-8, or integers from 0 to 2**64 - 1, checked with the row named."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from .arrays import refuse_masked

if TYPE_CHECKING:
    import numpy.typing as npt

__all__ = ["KeyType", "Keys", "PackedKeys", "as_key", "as_keys", "key_list", "take_keys"]

KeyType = Literal["str", "int"]
"""The kind of a hull's keys."""

MOST_KEY_BYTES = 255
LARGEST_KEY = 2**64 - 1
MOST_SHOWN = 60  # characters of a value in a message
FEW = 256  # lengths that are added faster without numpy
FEW_ROWS = 8  # keys that are taken faster without numpy
CONTINUATION_MASK, CONTINUATION = 0xC0, 0x80  # the two highest bits of a UTF-8 byte that starts no character


class PackedKeys(Sequence[str]):
    """A sequence of strings as one block of UTF-8, which needs no Python object for each.

    Args:
        lengths: the length of each string in bytes, 1 to 255: bytes, or a uint8 array of shape (n,).
        data: the UTF-8 of all strings, one after the other: bytes, or a uint8 array.
        name: what error messages call the keys.

    Both are kept as `bytes`, so that no other code can change them; `bytes` arguments are not copied. Two sequences
    are equal if they hold the same strings in the same order. O(size of the data).

    Raises:
        ValueError: the lengths do not add up to the data, or a string is empty or not UTF-8. The message names its row.
        TypeError: an argument is neither bytes nor an array of uint8.

    >>> from dynhull.keys import PackedKeys
    >>> keys = PackedKeys.pack(["LH400", "UA17"])
    >>> list(keys.lengths), keys.data
    ([5, 4], b'LH400UA17')
    >>> keys[1], len(keys), list(keys)
    ('UA17', 2, ['LH400', 'UA17'])
    """

    __slots__ = ("_data", "_lengths", "_starts")
    __hash__ = None  # type: ignore[assignment]  # a batch of keys is data, not a name

    def __init__(
        self, lengths: bytes | npt.NDArray[np.uint8], data: bytes | npt.NDArray[np.uint8], name: str = "keys"
    ) -> None:
        self._lengths = _as_bytes(lengths, f"{name}.lengths")
        self._data = _as_bytes(data, f"{name}.data")
        self._starts: npt.NDArray[np.int64] | None = None
        total = total_length(self._lengths)
        if total != len(self._data):
            raise ValueError(f"{name}.lengths add up to {total} bytes, but {name}.data has {len(self._data)}")
        self._check(name)

    @classmethod
    def pack(cls, strings: Iterable[str]) -> PackedKeys:
        """The strings as packed keys. O(size of the strings).

        Raises:
            ValueError: a string is empty, longer than 255 bytes, or not valid Unicode. The message names its row.
            TypeError: a value is not a string.
        """
        return _packed(_listed(strings, "keys"), "keys")

    @property
    def lengths(self) -> bytes:
        """The length of each string in bytes, as one byte each."""
        return self._lengths

    @property
    def data(self) -> bytes:
        """The UTF-8 of all strings, one after the other."""
        return self._data

    def __len__(self) -> int:
        """The number of strings. O(1)."""
        return len(self._lengths)

    @overload
    def __getitem__(self, row: int) -> str: ...
    @overload
    def __getitem__(self, row: slice) -> PackedKeys: ...
    def __getitem__(self, row: int | slice) -> str | PackedKeys:
        """The string of a row, or the packed keys of a slice. O(n) the first time, then O(size of the result)."""
        if isinstance(row, slice):
            start, stop, step = row.indices(len(self))
            if step != 1:
                return PackedKeys.pack([self[i] for i in range(start, stop, step)])
            starts, stop = self._offsets(), max(start, stop)
            return PackedKeys(self._lengths[start:stop], self._data[starts[start] : starts[stop]])
        number = range(len(self))[operator.index(row)]
        return self._bytes_of(number).decode()

    def __iter__(self) -> Iterator[str]:
        """The strings in order."""
        start = 0
        for length in self._lengths:
            yield self._data[start : start + length].decode()
            start += length

    def __eq__(self, other: object) -> bool:
        """Whether the other sequence holds the same strings in the same order."""
        if not isinstance(other, PackedKeys):
            return NotImplemented
        return self._lengths == other._lengths and self._data == other._data

    def __repr__(self) -> str:
        return f"<PackedKeys of {len(self)} strings, {len(self._data)} bytes>"

    def __reduce__(self) -> tuple[type[PackedKeys], tuple[bytes, bytes]]:
        return PackedKeys, (self._lengths, self._data)

    def _offsets(self) -> npt.NDArray[np.int64]:
        if self._starts is None:
            ends = np.cumsum(np.frombuffer(self._lengths, np.uint8), dtype=np.int64)
            self._starts = np.concatenate([[0], ends])
        return self._starts

    def _bytes_of(self, row: int) -> bytes:
        starts = self._offsets()
        return self._data[starts[row] : starts[row + 1]]

    def _taken(self, rows: npt.NDArray[np.intp]) -> PackedKeys:
        lengths = np.frombuffer(self._lengths, np.uint8)[rows]
        ends = np.cumsum(lengths, dtype=np.int64)
        places = np.arange(ends[-1]) + np.repeat(self._offsets()[:-1][rows] - ends + lengths, lengths)
        return PackedKeys(lengths, np.frombuffer(self._data, np.uint8)[places])

    def _check(self, name: str) -> None:
        empty = self._lengths.find(0)
        if empty >= 0:
            raise ValueError(f"{name} row {empty} is '': {_a_key('str')}")
        if not self._data.isascii() and not self._whole_characters():
            for row in range(len(self)):
                try:
                    self._bytes_of(row).decode()
                except UnicodeDecodeError:
                    raise ValueError(f"{name} row {row} is {_shown(self._bytes_of(row))}: not UTF-8") from None

    def _whole_characters(self) -> bool:
        """Whether the data are UTF-8 and no string starts inside a character."""
        try:
            self._data.decode()
        except UnicodeDecodeError:
            return False
        starts = np.cumsum(np.frombuffer(self._lengths, np.uint8), dtype=np.int64)[:-1]
        firsts = np.frombuffer(self._data, np.uint8)[starts]
        return not ((firsts & CONTINUATION_MASK) == CONTINUATION).any()


if TYPE_CHECKING:
    Keys = PackedKeys | npt.NDArray[np.uint64]
else:
    Keys = PackedKeys | np.ndarray
"""The keys of a batch: `PackedKeys`, or an array of uint64."""


def as_keys(keys: Any, key_type: KeyType, name: str = "keys") -> Keys:
    """Return the keys of a batch as `PackedKeys` ("str") or as a C-contiguous uint64 array of shape (k,) ("int").

    Args:
        keys: for "str" `PackedKeys`, or strings in a list, another iterable, a numpy array of strings or objects, or a
            column of pandas, polars or pyarrow. For "int" integers in a list, another iterable, an array or a column.
        key_type: "str" or "int".
        name: what error messages call the keys.

    `PackedKeys` and contiguous, aligned uint64 arrays are returned as they are. Neither these, nor pyarrow's strings,
    nor arrays of integers need a Python object for each key. O(size of the keys).

    Raises:
        ValueError: a string is empty, longer than 255 bytes, or not UTF-8; an integer is negative or above 2**64 - 1;
            or the shape is not (k,). The message names the first bad row.
        TypeError: a value is missing or of another kind: a bool or a float is not an integer.

    >>> from dynhull.keys import as_keys
    >>> as_keys(["b", "a"], "str")
    <PackedKeys of 2 strings, 2 bytes>
    >>> as_keys([7, 2**64 - 1], "int")
    array([                   7, 18446744073709551615], dtype=uint64)
    """
    return _as_strings(keys, name) if _is_str(key_type) else _as_integers(keys, name)


def as_key(key: Any, key_type: KeyType, name: str = "key") -> str | int:
    """Return one key as a `str` ("str") or an `int` ("int"), checked like `as_keys`.

    Raises:
        ValueError: the key is empty, longer than 255 bytes, not UTF-8, negative, or above 2**64 - 1.
        TypeError: the key is of another kind.
    """
    return str(_as_bytes_of_key(key, name), "utf-8") if _is_str(key_type) else _as_integer(key, name)


def total_length(lengths: bytes) -> int:
    """The sum of lengths of one byte each."""
    return sum(lengths) if len(lengths) <= FEW else int(np.frombuffer(lengths, np.uint8).sum(dtype=np.int64))


def key_list(keys: Keys) -> list[Any]:
    """The keys as a list of `str` or of `int`. O(size of the keys)."""
    return list(keys) if isinstance(keys, PackedKeys) else keys.tolist()


def take_keys(keys: Keys, rows: npt.NDArray[np.intp]) -> Keys:
    """The keys of some rows, in the order of `rows`. O(size of the keys)."""
    if not isinstance(keys, PackedKeys):
        return keys[rows]
    if len(rows) <= FEW_ROWS:
        return PackedKeys.pack([keys[row] for row in rows.tolist()])
    return keys._taken(rows)


def _is_str(key_type: KeyType) -> bool:
    if key_type not in ("str", "int"):
        raise ValueError(f'key_type must be "str" or "int", got {key_type!r}')
    return key_type == "str"


def _a_key(key_type: KeyType) -> str:
    return f"a key has 1 to {MOST_KEY_BYTES} bytes" if key_type == "str" else "a key is from 0 to 2**64 - 1"


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."


def _as_bytes(value: Any, name: str) -> bytes:
    if type(value) is bytes:
        return value
    if isinstance(value, np.ndarray) and value.dtype == np.uint8 and value.ndim == 1:
        refuse_masked(value, name)
        return value.tobytes()
    if isinstance(value, bytes | bytearray | memoryview):
        return bytes(value)
    raise TypeError(f"{name} must be bytes or a uint8 array of shape (n,), got {type(value).__name__}")


def _listed(keys: Any, name: str) -> list[Any] | tuple[Any, ...]:
    """The keys as a list: from an array, a column of another library, or an iterable."""
    if isinstance(keys, list | tuple):
        return keys
    if isinstance(keys, str | bytes) or not isinstance(keys, Iterable):
        raise TypeError(f"{name} is {_shown(keys)}: must be a list or an array of keys")
    refuse_masked(keys, name)
    if isinstance(keys, np.ndarray):
        if keys.ndim != 1:
            raise ValueError(f"{name} must have shape (k,), got {keys.shape}")
        entries: list[Any] = keys.tolist()
        return entries
    for method in ("to_list", "to_pylist"):  # of pandas and polars, of pyarrow
        if hasattr(keys, method):
            column: list[Any] = getattr(keys, method)()
            return column
    return list(keys)


# Strings


def _as_strings(keys: Any, name: str) -> PackedKeys:
    if isinstance(keys, PackedKeys):
        return keys if type(keys) is PackedKeys else PackedKeys(keys.lengths, keys.data, name)
    if type(keys).__module__.split(".")[0] == "pyarrow":
        return _of_arrow(keys, name)
    return _packed(_listed(keys, name), name)


def _packed(strings: list[Any] | tuple[Any, ...], name: str) -> PackedKeys:
    try:
        text = "".join(strings)
        encoded: list[Any] | tuple[Any, ...] = strings if text.isascii() else list(map(str.encode, strings))
        return PackedKeys(bytes(map(len, encoded)), text.encode(), name)
    except (TypeError, ValueError):
        for row, value in enumerate(strings):
            _as_bytes_of_key(value, f"{name} row {row}")
        raise


def _as_bytes_of_key(key: Any, name: str) -> bytes:
    if not isinstance(key, str):
        raise TypeError(f"{name} is {_shown(key)}: must be a string, as the keys are strings")
    try:
        encoded = key.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{name} is {_shown(key)}: not valid Unicode") from None
    if not 0 < len(encoded) <= MOST_KEY_BYTES:
        raise ValueError(f"{name} is {_shown(key)}, {len(encoded)} bytes: {_a_key('str')}")
    return encoded


def _of_arrow(column: Any, name: str) -> PackedKeys:
    """The strings of a pyarrow array, from its offsets and bytes."""
    if column.null_count or str(column.type) not in ("string", "large_string"):
        return _packed(column.to_pylist(), name)
    lengths, data = [np.empty(0, np.int64)], [b""]
    for chunk in getattr(column, "chunks", [column]):
        if len(chunk):
            _, offsets, characters = chunk.buffers()
            width = np.int64 if str(chunk.type) == "large_string" else np.int32
            ends = np.frombuffer(offsets, width)[chunk.offset : chunk.offset + len(chunk) + 1]
            lengths.append(np.diff(ends).astype(np.int64))
            data.append(bytes(memoryview(characters)[ends[0] : ends[-1]]) if characters else b"")
    sizes = np.concatenate(lengths)
    long = np.flatnonzero(sizes > MOST_KEY_BYTES)
    if long.size:
        _as_bytes_of_key(column[int(long[0])].as_py(), f"{name} row {long[0]}")
    return PackedKeys(sizes.astype(np.uint8), b"".join(data), name)


# Integers


def _as_integers(keys: Any, name: str) -> npt.NDArray[np.uint64]:
    if not isinstance(keys, list | tuple | PackedKeys) and hasattr(keys, "__array__"):
        refuse_masked(keys, name)
        array = np.asarray(keys)
        if array.ndim != 1:
            raise ValueError(f"{name} must have shape (k,), got {array.shape}")
        if array.dtype.kind == "i":
            negative = np.flatnonzero(array < 0)
            if negative.size:
                raise ValueError(f"{name} row {negative[0]} is {array[negative[0]]}: {_a_key('int')}")
        if array.dtype.kind in "iu":
            return np.require(array, np.uint64, ("C", "A"))
    integers = _listed(keys, name)
    if set(map(type, integers)) <= {int} and (not integers or (min(integers) >= 0 and max(integers) <= LARGEST_KEY)):
        return np.array(integers, np.uint64)
    return np.array([_as_integer(key, f"{name} row {row}") for row, key in enumerate(integers)], np.uint64)


def _as_integer(key: Any, name: str) -> int:
    if isinstance(key, bool | np.bool_) or not isinstance(key, int | np.integer):
        raise TypeError(f"{name} is {_shown(key)}: must be an integer, as the keys are integers")
    if not 0 <= key <= LARGEST_KEY:
        raise ValueError(f"{name} is {_shown(int(key))}: {_a_key('int')}")
    return int(key)
