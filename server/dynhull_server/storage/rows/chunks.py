"""Snapshots as bytes: their contents, in chunks that can be decoded one by one, and their state."""

import json
import struct
from collections.abc import Callable, Sequence

import numpy as np

from dynhull.keys import PackedKeys

from ...state.records import Contents, Kept, Keys, Times
from .columns import INTEGER_BYTES, POINT_BYTES, TIME_BYTES, Cursor, key_bytes, point_bytes, time_bytes

CHUNK_BYTES = 2**19  # a commit that delays later ones only briefly; a chunk of strings can be one row longer

# The number of points, and flags for the columns after them. Of 8 bytes, so that the columns of numbers are aligned.
HEADER = struct.Struct("<II")
HAS_TIMES, HAS_DEADLINES, STRINGS, INTEGERS = 1, 2, 4, 8


def starts(contents: Contents) -> list[int]:
    """The first row of each chunk. O(n).

    Contents without points have one chunk, which says which columns they have.
    """
    row = POINT_BYTES + TIME_BYTES * sum(column is not None for column in (contents.times, contents.deadlines))
    if isinstance(contents.keys, PackedKeys):
        lengths = np.frombuffer(contents.keys.lengths, np.uint8)
        ends = np.cumsum(lengths, dtype=np.int64) + np.arange(1, len(lengths) + 1) * (row + 1)
        size = int(ends[-1]) if len(ends) else 0
        return [0, *np.searchsorted(ends, np.arange(CHUNK_BYTES, size, CHUNK_BYTES), side="right").tolist()]
    row += 0 if contents.keys is None else INTEGER_BYTES
    return list(range(0, max(1, len(contents)), CHUNK_BYTES // row))


def chunk(contents: Contents, rows: slice) -> bytes:
    """Some rows of the contents."""
    points, flags = contents.points[rows], 0
    columns = [point_bytes(points)]
    for flag, times in ((HAS_TIMES, contents.times), (HAS_DEADLINES, contents.deadlines)):
        if times is not None:
            flags |= flag
            columns.append(time_bytes(times[rows]))
    if contents.keys is not None:
        flags |= STRINGS if isinstance(contents.keys, PackedKeys) else INTEGERS
        columns.append(key_bytes(contents.keys[rows]))
    return b"".join([HEADER.pack(len(points), flags), *columns])


def state(kept: Kept) -> bytes:
    """The state of a snapshot: everything but its contents."""
    found = {"producers": kept.producers, "clock": kept.clock, "center": kept.center, "skipping": sorted(kept.skipping)}
    return json.dumps(found).encode()


def state_from(data: bytes) -> tuple[Kept, Callable[[bytes], Contents]]:
    """The producers, the clock and the centre of a state, and the function that decodes its chunks."""
    found = json.loads(data or "{}")
    producers = found.get("producers")
    if not isinstance(producers, dict):
        return Kept(producers=found), _points_only  # of format 1 or 2: the last number of each producer
    center = found.get("center")
    kept = Kept(producers=producers, clock=found["clock"], center=None if center is None else tuple(center))
    kept.skipping = frozenset(found.get("skipping", ()))
    return kept, _decoded


def joined(parts: Sequence[Contents]) -> Contents:
    """The contents of a snapshot from those of its chunks."""
    if len(parts) == 1:
        return parts[0]
    points = np.concatenate([np.empty((0, 2)), *(part.points for part in parts)])
    times, deadlines = (_joined_times([getattr(part, name) for part in parts]) for name in ("times", "deadlines"))
    return Contents(points, _joined_keys([part.keys for part in parts]), times, deadlines)


def _decoded(data: bytes) -> Contents:
    cursor = Cursor(memoryview(data))
    count, flags = HEADER.unpack(cursor.take(HEADER.size))
    points = cursor.points(count)
    times = cursor.times(count) if flags & HAS_TIMES else None
    deadlines = cursor.times(count) if flags & HAS_DEADLINES else None
    keys: Keys | None = None
    if flags & (STRINGS | INTEGERS):
        keys = cursor.strings(count) if flags & STRINGS else cursor.integers(count)
    return Contents(points, keys, times, deadlines)


def _points_only(data: bytes) -> Contents:
    return Contents(Cursor(memoryview(data)).points(len(data) // POINT_BYTES))


def _joined_times(parts: Sequence[Times | None]) -> Times | None:
    found = [part for part in parts if part is not None]
    return np.concatenate(found) if found else None


def _joined_keys(parts: Sequence[Keys | None]) -> Keys | None:
    strings = [part for part in parts if isinstance(part, PackedKeys)]
    if strings:
        return PackedKeys(b"".join(part.lengths for part in strings), b"".join(part.data for part in strings))
    integers = [part for part in parts if isinstance(part, np.ndarray)]
    return np.concatenate(integers) if integers else None
