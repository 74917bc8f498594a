"""Columns of points, times and keys as bytes, little-endian and without a Python object per row."""

import numpy as np

from dynhull.arrays import Points
from dynhull.keys import PackedKeys, total_length

from ...state.records import Accuracies, Keys, Times

DOUBLE, SIGNED, UNSIGNED = np.dtype("<f8"), np.dtype("<i8"), np.dtype("<u8")
NO_STRINGS = PackedKeys(b"", b"")
POINT_BYTES, TIME_BYTES, INTEGER_BYTES, ACCURACY_BYTES = 16, 8, 8, 8


def point_bytes(points: Points) -> bytes:
    """(n, 2) points as 16 n bytes."""
    return np.ascontiguousarray(points, DOUBLE).tobytes()


def time_bytes(times: Times) -> bytes:
    """(n,) times as 8 n bytes."""
    return np.ascontiguousarray(times, SIGNED).tobytes()


def accuracy_bytes(accuracies: Accuracies) -> bytes:
    """(n,) accuracies as 8 n bytes."""
    return np.ascontiguousarray(accuracies, DOUBLE).tobytes()


def key_bytes(keys: Keys) -> bytes:
    """Integers as 8 n bytes; strings as n bytes with their lengths, then their UTF-8."""
    if isinstance(keys, np.ndarray):
        return np.ascontiguousarray(keys, UNSIGNED).tobytes()
    return keys.lengths + keys.data


class Cursor:
    """Reads columns from bytes, one after the other.

    Each method raises ValueError if the bytes end too early.

    Args:
        data: the bytes; the columns of a memoryview are views of it, and not copied.

    Attributes:
        position: the number of bytes read.
    """

    __slots__ = ("_data", "position")

    def __init__(self, data: bytes | memoryview) -> None:
        self._data = data
        self.position = 0

    @property
    def at_end(self) -> bool:
        """Whether all bytes have been read."""
        return self.position == len(self._data)

    def take(self, size: int) -> bytes | memoryview:
        """The next bytes."""
        start = self.position
        end = start + size
        if end > len(self._data):
            raise ValueError(f"a column of {size} bytes at byte {start} is cut short at byte {len(self._data)}")
        self.position = end
        return self._data[start:end]

    def points(self, rows: int) -> Points:
        """(rows, 2) points."""
        found = np.frombuffer(self.take(rows * POINT_BYTES), DOUBLE)
        return found.reshape(-1, 2).astype(np.float64, copy=False)

    def times(self, rows: int) -> Times:
        """(rows,) times."""
        return np.frombuffer(self.take(rows * TIME_BYTES), SIGNED).astype(np.int64, copy=False)

    def accuracies(self, rows: int) -> Accuracies:
        """(rows,) accuracies."""
        return np.frombuffer(self.take(rows * ACCURACY_BYTES), DOUBLE).astype(np.float64, copy=False)

    def strings(self, rows: int) -> PackedKeys:
        """String keys; ValueError also if they are not UTF-8."""
        if not rows:
            return NO_STRINGS
        lengths = bytes(self.take(rows))
        return PackedKeys(lengths, bytes(self.take(total_length(lengths))))

    def integers(self, rows: int) -> Keys:
        """(rows,) integer keys."""
        return np.frombuffer(self.take(rows * INTEGER_BYTES), UNSIGNED).astype(np.uint64, copy=False)
