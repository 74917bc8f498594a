"""Messages between roots and shards as bytes.

A message is the version of this format and one value. A value is a tag of one byte and what belongs to it: numbers in
little-endian order, texts and arrays with their lengths, and of a message or a part of one the values of its fields in
order. Both ends belong to one server, so they have the same version but while a server is upgraded.
"""

import struct
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from dynhull.keys import PackedKeys
from dynhull.static.trace import Round
from dynhull_server.state import errors
from dynhull_server.state.batch import Applied, Batch
from dynhull_server.state.contents import gate, keyed, windowed
from dynhull_server.state.records import Contents, HullSettings, KeyRows, QuarantineRules, Window

from ..shards import messages
from . import letters

if TYPE_CHECKING:
    from collections.abc import Callable

VERSION = 2

NONE, FALSE, TRUE, INTEGER, FLOAT, TEXT, BYTES, TUPLE, ARRAY, OBJECT, ERROR = range(11)
LENGTH = struct.Struct("<I")
LONG = struct.Struct("<q")
UNSIGNED = 11  # an integer beyond those of LONG: a key, or the hash of one
ULONG = struct.Struct("<Q")
DOUBLE = struct.Struct("<d")

# Objects with their fields in order: the number of a class is its place, so new ones come last.
CLASSES: tuple[type, ...] = (
    messages.Open,
    messages.Step,
    messages.Apply,
    messages.Undo,
    messages.Ask,
    messages.SampleOf,
    messages.CountOf,
    messages.PositionsOf,
    messages.StaticHull,
    messages.FoundOf,
    messages.AllOf,
    messages.Recompute,
    messages.Recomputed,
    messages.Corners,
    messages.VertexChange,
    messages.ShardTotals,
    messages.Opened,
    messages.Effect,
    messages.Done,
    messages.Undone,
    messages.Answered,
    messages.Closed,
    Applied,
    Batch,
    windowed.AdmittedRows,
    gate.AdmittedPuts,
    keyed.Found,
    KeyRows,
    Contents,
    HullSettings,
    Window,
    QuarantineRules,
    PackedKeys,
    Round,
    letters.Greeting,
    letters.Greeted,
    letters.Letter,
    letters.Answer,
    letters.Wanted,
    letters.IsWanted,
    messages.SlotsOf,
)
NUMBER_OF = {kind: number for number, kind in enumerate(CLASSES)}
FIELDS = {kind: [each.name for each in fields(kind)] for kind in CLASSES if kind is not PackedKeys}
FIELDS[PackedKeys] = ["lengths", "data"]

# Refusals that a shard answers with, and the attributes that make them again.
ERRORS: tuple[tuple[type[errors.RefusedError], tuple[str, ...]], ...] = (
    (errors.PointMissingError, ("part", "row", "point")),
    (errors.KeyMissingError, ("row", "key")),
    (errors.LimitExceededError, ("limit", "maximum")),
)
DTYPES = ("<f8", "<i8", "<u8", "|b1", "<i4", "<u4", "|u1")


class WireError(ValueError):
    """Bytes that are no message of this version."""


def pack(value: Any) -> bytes:
    """A message as bytes. TypeError if it has a value of another kind."""
    parts: list[bytes] = [bytes([VERSION])]
    _pack(value, parts)
    return b"".join(parts)


def unpack(data: bytes) -> Any:
    """The inverse of `pack`. Raises WireError."""
    if not data or data[0] != VERSION:
        raise WireError(f"a message between shards has version {data[0] if data else None}, not {VERSION}")
    reader = _Reader(data)
    try:
        value = reader.value()
    except (struct.error, IndexError, ValueError, TypeError) as error:
        raise WireError(f"a message between shards is damaged: {error}") from error
    if not reader.at_end:
        raise WireError("a message between shards goes on after its end")
    return value


def _pack(value: Any, parts: list[bytes]) -> None:
    kind = type(value)
    number = NUMBER_OF.get(kind)
    if number is not None:
        parts.append(bytes([OBJECT, number]))
        for name in FIELDS[kind]:
            _pack(getattr(value, name), parts)
    elif value is None:
        parts.append(bytes([NONE]))
    elif isinstance(value, bool | np.bool_):
        parts.append(bytes([TRUE if value else FALSE]))
    elif isinstance(value, int | np.integer):
        small = -(2**63) <= value < 2**63
        parts += (bytes([INTEGER]), LONG.pack(value)) if small else (bytes([UNSIGNED]), ULONG.pack(value))
    elif isinstance(value, float):
        parts += (bytes([FLOAT]), DOUBLE.pack(value))
    elif isinstance(value, str):
        _pack_bytes(TEXT, value.encode(), parts)
    elif isinstance(value, bytes | bytearray | memoryview):
        _pack_bytes(BYTES, bytes(value), parts)
    elif isinstance(value, tuple | list):
        parts += (bytes([TUPLE]), LENGTH.pack(len(value)))
        for each in value:
            _pack(each, parts)
    elif isinstance(value, np.ndarray):
        _pack_array(value, parts)
    else:
        _pack_error(value, parts)


def _pack_bytes(tag: int, data: bytes, parts: list[bytes]) -> None:
    parts += (bytes([tag]), LENGTH.pack(len(data)), data)


def _pack_array(array: np.ndarray[Any, Any], parts: list[bytes]) -> None:
    code = DTYPES.index(array.dtype.newbyteorder("<").str)
    shape = [LENGTH.pack(each) for each in array.shape]
    parts += (bytes([ARRAY, code, array.ndim]), *shape, np.ascontiguousarray(array).tobytes())


def _pack_error(value: Any, parts: list[bytes]) -> None:
    for number, (kind, names) in enumerate(ERRORS):
        if type(value) is kind:
            parts.append(bytes([ERROR, number]))
            for name in names:
                _pack(getattr(value, name), parts)
            return
    raise TypeError(f"no message between shards has a {type(value).__name__}")


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 1
        self._read: dict[int, Callable[[], Any]] = {
            NONE: lambda: None,
            FALSE: lambda: False,
            TRUE: lambda: True,
            INTEGER: lambda: self._number(LONG),
            UNSIGNED: lambda: self._number(ULONG),
            FLOAT: lambda: self._number(DOUBLE),
            TEXT: lambda: str(self._bytes(self._number(LENGTH)), "utf-8"),
            BYTES: lambda: self._bytes(self._number(LENGTH)),
            TUPLE: lambda: tuple(self.value() for _ in range(self._number(LENGTH))),
            ARRAY: self._array,
            OBJECT: self._object,
            ERROR: self._error,
        }

    @property
    def at_end(self) -> bool:
        return self._at == len(self._data)

    def value(self) -> Any:
        return self._read[self._byte()]()

    def _byte(self) -> int:
        self._at += 1
        return self._data[self._at - 1]

    def _number(self, of: struct.Struct) -> Any:
        (number,) = of.unpack_from(self._data, self._at)
        self._at += of.size
        return number

    def _bytes(self, count: int) -> bytes:
        begin, self._at = self._at, self._at + count
        if self._at > len(self._data):
            raise IndexError("it ends too early")
        return self._data[begin : self._at]

    def _array(self) -> np.ndarray[Any, Any]:
        dtype = np.dtype(DTYPES[self._byte()])
        shape = [self._number(LENGTH) for _ in range(self._byte())]
        size = int(np.prod(shape, dtype=np.int64))
        return np.frombuffer(self._bytes(size * dtype.itemsize), dtype).reshape(shape).copy()

    def _object(self) -> Any:
        kind = CLASSES[self._byte()]
        return kind(*(self.value() for _ in FIELDS[kind]))

    def _error(self) -> errors.RefusedError:
        kind, names = ERRORS[self._byte()]
        return kind(*(self.value() for _ in names))
