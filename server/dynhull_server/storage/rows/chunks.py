"""Snapshots as bytes: their contents, in chunks that can be decoded one by one, and their state."""

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import asdict, astuple
from typing import Any, NamedTuple

import numpy as np

from dynhull.keys import PackedKeys

from ...state.records import CommitStamp, Contents, Division, Kept, Keys, QuarantineRules, Tally
from .columns import (
    ACCURACY_BYTES,
    INTEGER_BYTES,
    POINT_BYTES,
    TIME_BYTES,
    Cursor,
    accuracy_bytes,
    key_bytes,
    point_bytes,
    time_bytes,
)
from .held_rows import held_bytes, held_starts, inaccurate, take_held

CHUNK_BYTES = 2**19  # a commit that delays later ones only briefly; a chunk of strings can be one row longer

# The number of points, and flags for the columns after them. Of 8 bytes, so that the columns of numbers are aligned.
HEADER = struct.Struct("<II")
HAS_TIMES, HAS_DEADLINES, STRINGS, INTEGERS = 1, 2, 4, 8
HELD = 16  # the points of this chunk are in quarantine
HAS_ACCURACIES = 32  # since format 13


class ChunkRows(NamedTuple):
    """The rows of a chunk, and whether they are those of the points in quarantine."""

    rows: slice
    held: bool = False


def cuts(contents: Contents) -> list[ChunkRows]:
    """The chunks of some contents. O(n)."""
    cuts = [ChunkRows(rows) for rows in _slices(_starts(contents), len(contents))]
    if contents.held is not None:
        cuts += [ChunkRows(rows, True) for rows in _slices(held_starts(contents.held, CHUNK_BYTES), len(contents.held))]
    return cuts


def _slices(firsts: list[int], end: int) -> Iterator[slice]:
    return (slice(*ends) for ends in zip(firsts, [*firsts[1:], end], strict=True))


def _starts(contents: Contents) -> list[int]:
    """The first row of each chunk of points.

    Contents without points have one chunk, which says which columns they have.
    """
    row = POINT_BYTES + TIME_BYTES * sum(column is not None for column in (contents.times, contents.deadlines))
    row += 0 if contents.accuracies is None else ACCURACY_BYTES
    if isinstance(contents.keys, PackedKeys):
        lengths = np.frombuffer(contents.keys.lengths, np.uint8)
        ends = np.cumsum(lengths, dtype=np.int64) + np.arange(1, len(lengths) + 1) * (row + 1)
        size = int(ends[-1]) if len(ends) else 0
        return [0, *np.searchsorted(ends, np.arange(CHUNK_BYTES, size, CHUNK_BYTES), side="right").tolist()]
    row += 0 if contents.keys is None else INTEGER_BYTES
    return list(range(0, max(1, len(contents)), CHUNK_BYTES // row))


def chunk(contents: Contents, cut: ChunkRows) -> bytes:
    """Some rows of the contents."""
    rows, held = cut.rows, contents.held
    if cut.held:
        assert held is not None  # `cuts` has found some
        kind = STRINGS if isinstance(held.keys, PackedKeys) else INTEGERS
        kind |= HAS_ACCURACIES if inaccurate(held, rows) else 0
        return HEADER.pack(rows.stop - rows.start, kind | HELD) + held_bytes(held, rows)
    points, flags = contents.points[rows], 0
    columns = [point_bytes(points)]
    for flag, times in ((HAS_TIMES, contents.times), (HAS_DEADLINES, contents.deadlines)):
        if times is not None:
            flags |= flag
            columns.append(time_bytes(times[rows]))
    if contents.accuracies is not None:
        flags |= HAS_ACCURACIES
        columns.append(accuracy_bytes(contents.accuracies[rows]))
    if contents.keys is not None:
        flags |= STRINGS if isinstance(contents.keys, PackedKeys) else INTEGERS
        columns.append(key_bytes(contents.keys[rows]))
    return b"".join([HEADER.pack(len(points), flags), *columns])


def state(kept: Kept) -> bytes:
    """The state of a snapshot: everything but its contents."""
    found: dict[str, Any] = {
        "producers": kept.producers,
        "clock": kept.clock,
        "center": kept.center,
        "skipping": sorted(kept.skipping),
    }
    if kept.rules is not None:
        found["rules"] = asdict(kept.rules)
    if kept.tallies:
        found["tallies"] = {str(shard): astuple(tally) for shard, tally in kept.tallies.items()}
    if kept.division is not None:
        found["division"] = asdict(kept.division)
    if kept.committed is not None:
        found["committed"] = kept.committed
    return json.dumps(found).encode()


def state_from(data: bytes) -> tuple[Kept, Callable[[bytes], Contents]]:
    """A snapshot without its contents and revision, and the function that decodes its chunks."""
    found = json.loads(data or "{}")
    producers = found.get("producers")
    if not isinstance(producers, dict):
        return Kept(producers=found), _points_only  # of format 1 or 2: the last number of each producer
    center = found.get("center")
    kept = Kept(producers=producers, clock=found["clock"], center=None if center is None else tuple(center))
    kept.skipping = frozenset(found.get("skipping", ()))
    if "rules" in found:
        kept.rules = QuarantineRules(**found["rules"])
    kept.tallies = {int(shard): Tally(*numbers) for shard, numbers in found.get("tallies", {}).items()}
    if "division" in found:
        kept.division = Division(**found["division"])
    if "committed" in found:
        kept.committed = CommitStamp(*found["committed"])
    return kept, _decoded


def _decoded(data: bytes) -> Contents:
    cursor = Cursor(memoryview(data))
    count, flags = HEADER.unpack(cursor.take(HEADER.size))
    if flags & HELD:
        strings, accuracies = bool(flags & STRINGS), bool(flags & HAS_ACCURACIES)
        return Contents(held=take_held(cursor, count, strings=strings, accuracies=accuracies))
    points = cursor.points(count)
    times = cursor.times(count) if flags & HAS_TIMES else None
    deadlines = cursor.times(count) if flags & HAS_DEADLINES else None
    errors = cursor.accuracies(count) if flags & HAS_ACCURACIES else None
    keys: Keys | None = None
    if flags & (STRINGS | INTEGERS):
        keys = cursor.strings(count) if flags & STRINGS else cursor.integers(count)
    return Contents(points, keys, times, deadlines, accuracies=errors)


def _points_only(data: bytes) -> Contents:
    return Contents(Cursor(memoryview(data)).points(len(data) // POINT_BYTES))
