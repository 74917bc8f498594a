"""Positions of events as bytes.

Of a previous position only the bits that differ from the position are stored, without the zero bytes before them.
Positions that are decimals of at most seven places, as those of most receivers are, are integers instead.
"""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from ...state.fences.events.block import Bytes, Integers
from ...state.fences.events.format import GREATEST, PLACES
from .columns import Cursor

WORD = 8
# The numbers from which on an integer needs one byte more.
LIMITS = np.array([1 << 8 * size for size in range(WORD)], np.uint64)

Words = npt.NDArray[np.uint64]
Mask = npt.NDArray[np.bool_]


# Positions as multiples of 1e-7


def decimals_of(points: Points, previous: Points) -> tuple[Integers, Integers] | None:
    """Positions, and those before, as multiples of 1e-7; None if one of them is no such number, or too large."""
    if len(points) and as_decimal(float(points[0, 0])) is None:  # as a rule all are, or none
        return None
    values = np.concatenate([points, previous])
    with np.errstate(over="ignore"):
        multiples = np.rint(values * PLACES)
    if not (np.abs(multiples) <= GREATEST).all() or (multiples / PLACES != values).any():
        return None
    if (np.signbit(values) & (values == 0)).any():  # an integer has no negative zero
        return None
    found = multiples.astype(np.int64)
    return found[: len(points)], found[len(points) :]


def as_decimal(value: float) -> int | None:
    """A coordinate as a multiple of 1e-7; None if it is no such number, or too large."""
    multiple = value * PLACES
    if not abs(multiple) <= GREATEST:
        return None
    found = round(multiple)
    exact = found / PLACES == value and (found != 0 or math.copysign(1.0, value) > 0)
    return found if exact else None


def put_decimals(
    out: bytearray, put: Callable[..., None], points: Integers, previous: Integers, there: Mask, before: Mask
) -> None:
    """Append positions, and how those before differ.

    Args:
        out: receives the bytes.
        put: appends columns.
        points: the positions.
        previous: the positions before.
        there: of those before, which have a position after them.
        before: of the positions, which have one before them.
    """
    for columns in (points, previous[there] - points[before], previous[~there]):
        if len(columns):
            put(out, *columns.T)


def take_decimals(
    cursor: Cursor, take: Callable[[Cursor, int], Integers], there: Mask, before: Mask
) -> tuple[Points, Points]:
    """The inverse of `put_decimals`, given which events have positions, and positions before."""

    def pairs(count: int) -> Integers:
        columns = [take(cursor, count) for _ in range(2)] if count else [np.empty(0, np.int64)] * 2
        return np.stack(columns, axis=1)

    points = pairs(int(there.sum()))
    previous = np.empty((int(before.sum()), 2), np.int64)
    previous[there[before]] = pairs(int((there & before).sum())) + points[before[there]]
    previous[~there[before]] = pairs(int((before & ~there).sum()))
    return points / PLACES, previous / PLACES


# Positions before


def put_previous(out: bytearray, points: Points, previous: Points) -> None:
    """Append what differs in positions before from the positions after them; NaN where there is none."""
    differing = _words(previous) ^ _words(points)
    sizes = np.searchsorted(LIMITS, differing.ravel(), "right").astype(np.uint8)
    out += (sizes[::2] << 4 | sizes[1::2]).tobytes()
    out += differing.astype(">u8").view(np.uint8).reshape(-1, WORD)[_used(sizes)].tobytes()


def take_previous(cursor: Cursor, points: Points) -> Points:
    """The inverse of `put_previous`."""
    both = np.frombuffer(cursor.take(len(points)), np.uint8)
    sizes = np.column_stack([both >> 4, both & 15]).ravel()
    if sizes.max(initial=0) > WORD:
        raise ValueError("a coordinate of more than 8 bytes")
    used = _used(sizes)
    found = np.zeros((len(sizes), WORD), np.uint8)
    found[used] = np.frombuffer(cursor.take(int(sizes.sum(dtype=np.int64))), np.uint8)
    differing = found.view(">u8").reshape(-1, 2).astype(np.uint64)
    return (differing ^ _words(points)).view(np.float64)


def _words(points: Points) -> Words:
    """The bits of coordinates; 0 where there is no position."""
    return np.ascontiguousarray(np.where(np.isnan(points), 0.0, points)).view(np.uint64)


def _used(sizes: Bytes) -> npt.NDArray[np.bool_]:
    """Which bytes of big-endian words are not zero bytes at their beginning."""
    return np.arange(WORD) >= WORD - sizes[:, None].astype(np.int64)
