"""What a row stores of many events, as columns."""

import struct
from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ...state.fences.event_block import RUN, EventBlock
from ...state.fences.records import Position
from ...state.records import NO_TIME
from .columns import point_bytes
from .event_positions import WORD, as_decimal, decimals_of, put_decimals, put_previous
from .event_rows import HAS_DISTANCE, HAS_EVENT_TIME, HAS_POSITION, HAS_PREVIOUS
from .varints import put_signed

Column = npt.NDArray[np.integer[Any]] | Sequence[int]
Places = tuple[Position | None, Position | None]  # a position, and that before
ORIGIN = 0.0, 0.0
# So few events take less time one by one: numpy begins slowly.
FEW = 64


class Columns(NamedTuple):
    """What is stored of n events in m runs.

    Attributes:
        runs: the columns of the runs, in the order of RUN.
        marks: (n,) the type of each event, and what it has.
        causes, lengths: (n,) as in EVENT.
        event_times: those that there are.
        first_times: (n,) as in EVENT; None if there are none.
        positions: the bytes of the positions, and those before.
        decimal: whether these are multiples of 1e-7.
        distances: the bytes of the distances that are not 0.
    """

    runs: Sequence[Column]
    marks: Column
    causes: Column
    lengths: Column
    event_times: Column
    first_times: Column | None
    positions: bytes
    decimal: bool
    distances: bytes


def columns_of(block: EventBlock) -> Columns:
    """The columns of some events."""
    return _few(block) if len(block) <= FEW else _many(block)


def put_integers(out: bytearray, *columns: Column) -> None:
    """Append columns of integers: the least, the bytes of a difference to it, and these differences."""
    for column in columns:
        if isinstance(column, np.ndarray) and len(column) > FEW:
            _put_array(out, column)
            continue
        numbers: Sequence[int] = column.tolist() if isinstance(column, np.ndarray) else column
        least = min(numbers)
        size = ((max(numbers) - least).bit_length() + 7) // 8
        put_signed(out, least)
        out.append(size)
        if size:
            out += b"".join([(number - least).to_bytes(size, "little") for number in numbers])


def _put_array(out: bytearray, column: npt.NDArray[np.integer[Any]]) -> None:
    least = int(column.min())
    above = column.astype(np.int64).view(np.uint64) - np.int64(least).view(np.uint64)
    size = (int(above.max()).bit_length() + 7) // 8
    put_signed(out, least)
    out.append(size)
    if size:
        out += above.astype("<u8", copy=False).view(np.uint8).reshape(-1, WORD)[:, :size].tobytes()


def _many(block: EventBlock) -> Columns:
    rows = block.rows
    points, previous = (np.column_stack([rows[x], rows[y]]) for x, y in (("x", "y"), ("before_x", "before_y")))
    there, before = ~np.isnan(points[:, 0]), ~np.isnan(previous[:, 0])
    far = ~np.isnan(rows["distance"]) & (rows["distance"] != 0)
    timed = rows["event_time"] != NO_TIME
    has = HAS_POSITION * there + HAS_PREVIOUS * before + HAS_DISTANCE * far + HAS_EVENT_TIME * timed
    positions = bytearray()
    decimals = decimals_of(points[there], previous[before])
    if decimals is None:
        positions += point_bytes(points[there])
        put_previous(positions, points[before], previous[before])
    else:
        put_decimals(positions, put_integers, *decimals, there[before], before[there])
    return Columns(
        [block.runs[name] for name in RUN.names or ()],
        rows["type"] | has.astype(np.uint8),
        rows["causes"],
        rows["length"],
        rows["event_time"][timed],
        rows["first_time"] if (rows["first_time"] != NO_TIME).any() else None,
        bytes(positions),
        decimals is not None,
        rows["distance"][far].astype("<f8", copy=False).tobytes(),
    )


def _few(block: EventBlock) -> Columns:
    rows = block.rows.tolist()
    _, causes, lengths, *_, event_times, first_times = zip(*rows, strict=True)
    marks, places, distances = [], [], []
    for mark, _, _, x, y, before_x, before_y, distance, event_time, _ in rows:
        here = before = None
        if x == x:  # not NaN
            mark |= HAS_POSITION
            here = x, y
        if before_x == before_x:
            mark |= HAS_PREVIOUS
            before = before_x, before_y
        if distance == distance and distance != 0:
            mark |= HAS_DISTANCE
            distances.append(distance)
        if event_time != NO_TIME:
            mark |= HAS_EVENT_TIME
        marks.append(mark)
        places.append((here, before))
    decimals = _decimals(places)
    return Columns(
        list(zip(*block.runs.tolist(), strict=True)),
        marks,
        causes,
        lengths,
        [time for time in event_times if time != NO_TIME],
        first_times if any(time != NO_TIME for time in first_times) else None,
        _doubles(places) if decimals is None else decimals,
        decimals is not None,
        struct.pack(f"<{len(distances)}d", *distances),
    )


def _decimals(places: Sequence[Places]) -> bytes | None:
    """Positions, and those before, as multiples of 1e-7, as `put_decimals` does; None if one is no such number."""
    points, differences, alone = [], [], []
    for here, before in places:
        if here is not None:
            x, y = map(as_decimal, here)
            if x is None or y is None:
                return None
            points.append((x, y))
        if before is not None:
            before_x, before_y = map(as_decimal, before)
            if before_x is None or before_y is None:
                return None
            if here is None:
                alone.append((before_x, before_y))
            else:
                differences.append((before_x - points[-1][0], before_y - points[-1][1]))
    out = bytearray()
    for pairs in (points, differences, alone):
        if pairs:
            put_integers(out, *zip(*pairs, strict=True))
    return bytes(out)


def _doubles(places: Sequence[Places]) -> bytes:
    """Positions, and what differs in those before, as `put_previous` does."""
    points = [coordinate for here, _ in places if here is not None for coordinate in here]
    pairs = [(*before, *(here or ORIGIN)) for here, before in places if before is not None]
    words = iter(struct.unpack(f"<{4 * len(pairs)}Q", struct.pack(f"<{4 * len(pairs)}d", *chain(*pairs))))
    differing: list[int] = []
    for before_x, before_y, x, y in zip(words, words, words, words, strict=True):
        differing += before_x ^ x, before_y ^ y
    sizes = [(word.bit_length() + 7) // 8 for word in differing]
    of_pairs = bytes([x << 4 | y for x, y in zip(sizes[::2], sizes[1::2], strict=True)])
    bits = b"".join([word.to_bytes(size, "big") for word, size in zip(differing, sizes, strict=True)])
    return struct.pack(f"<{len(points)}d", *points) + of_pairs + bits
