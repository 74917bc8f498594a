"""Quarantines of hulls as bytes, since format 8."""

import struct

import numpy as np

from dynhull.keys import PackedKeys

from ...state.records import HeldChange, HeldRows, QuarantineRules
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

# Of a change: the positions held, the keys dropped, and flags: whether rules follow, and accuracies, since format 13.
CHANGE = struct.Struct("<IIB")
HAS_RULES, HAS_ACCURACIES = 1, 2
RULES = struct.Struct("<ddI")  # the limits, NaN for none, and the confirmations
# The bytes of a held position beside its key: times, deadlines, speeds, growths, revisions, confirmations; accuracies.
HELD_BYTES = POINT_BYTES + 6 * TIME_BYTES + ACCURACY_BYTES


def held_bytes(held: HeldRows, rows: slice = slice(None)) -> bytes:
    """Some positions in quarantine; with accuracies where some position is inaccurate: see `inaccurate`."""
    measures = np.column_stack([held.speeds[rows], held.growths[rows]])
    integers = (held.times, held.deadlines, held.revisions, held.confirmed)
    columns = [key_bytes(held.keys[rows]), point_bytes(held.points[rows]), point_bytes(measures)]
    columns += [time_bytes(column[rows]) for column in integers]
    if inaccurate(held, rows):
        columns.append(accuracy_bytes(held.accuracies[rows]))
    return b"".join(columns)


def inaccurate(held: HeldRows, rows: slice = slice(None)) -> bool:
    """Whether some of the positions have an error."""
    return bool(held.accuracies[rows].any())


def take_held(cursor: Cursor, count: int, *, strings: bool, accuracies: bool) -> HeldRows:
    """The inverse of `held_bytes`."""
    keys = cursor.strings(count) if strings else cursor.integers(count)
    points, measures = cursor.points(count), cursor.points(count)
    times, deadlines, revisions, confirmed = (cursor.times(count) for _ in range(4))
    errors = cursor.accuracies(count) if accuracies else np.zeros(count)
    return HeldRows(keys, points, times, deadlines, measures[:, 0], measures[:, 1], revisions, confirmed, errors)


def change_bytes(change: HeldChange) -> bytes:
    """A change of a quarantine."""
    rules = change.rules
    flags = HAS_RULES * (rules is not None) | HAS_ACCURACIES * inaccurate(change.rows)
    parts = [CHANGE.pack(len(change.rows), len(change.dropped), flags)]
    if rules is not None:
        parts.append(RULES.pack(_number(rules.max_speed), _number(rules.max_growth), rules.confirmations))
    return b"".join([*parts, key_bytes(change.dropped), held_bytes(change.rows)])


def take_change(cursor: Cursor, *, strings: bool) -> HeldChange:
    """The inverse of `change_bytes`."""
    held, dropped, flags = CHANGE.unpack(cursor.take(CHANGE.size))
    rules = None
    if flags & HAS_RULES:
        speed, growth, confirmations = RULES.unpack(cursor.take(RULES.size))
        rules = QuarantineRules(_limit(speed), _limit(growth), confirmations)
    keys = cursor.strings(dropped) if strings else cursor.integers(dropped)
    accuracies = bool(flags & HAS_ACCURACIES)
    return HeldChange(take_held(cursor, held, strings=strings, accuracies=accuracies), keys, rules)


def held_starts(held: HeldRows, size: int) -> list[int]:
    """The first row of each part of about that many bytes; there are rows. O(n)."""
    counts = np.arange(1, len(held) + 1)
    if isinstance(held.keys, PackedKeys):
        lengths = np.frombuffer(held.keys.lengths, np.uint8)
        ends = counts * (HELD_BYTES + 1) + np.cumsum(lengths, dtype=np.int64)
    else:
        ends = counts * (HELD_BYTES + INTEGER_BYTES)
    return [0, *np.searchsorted(ends, np.arange(size, int(ends[-1]), size), side="right").tolist()]


def _number(limit: float | None) -> float:
    return np.nan if limit is None else limit


def _limit(number: float) -> float | None:
    return None if np.isnan(number) else number
