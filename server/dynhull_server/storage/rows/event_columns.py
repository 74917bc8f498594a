"""What a row stores of many events, as columns."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ...state.fences.events.block import RUN, EventBlock
from ...state.fences.events.format import Mark
from ...state.records import NO_TIME
from .columns import point_bytes
from .event_positions import WORD, decimals_of, put_decimals, put_previous
from .varints import put_signed

Column = npt.NDArray[np.integer[Any]]


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


def put_integers(out: bytearray, *columns: Column) -> None:
    """Append columns of integers: the least, the bytes of a difference to it, and these differences."""
    for column in columns:
        least = int(column.min())
        above = column.astype(np.int64).view(np.uint64) - np.int64(least).view(np.uint64)
        size = (int(above.max()).bit_length() + 7) // 8
        put_signed(out, least)
        out.append(size)
        if size:
            out += above.astype("<u8", copy=False).view(np.uint8).reshape(-1, WORD)[:, :size].tobytes()


def columns_of(block: EventBlock) -> Columns:
    """The columns of some events."""
    rows = block.rows
    points, previous = (np.column_stack([rows[x], rows[y]]) for x, y in (("x", "y"), ("before_x", "before_y")))
    there, before = ~np.isnan(points[:, 0]), ~np.isnan(previous[:, 0])
    far = ~np.isnan(rows["distance"]) & (rows["distance"] != 0)
    timed = rows["event_time"] != NO_TIME
    has = Mark.HAS_POSITION * there + Mark.HAS_PREVIOUS * before + Mark.HAS_DISTANCE * far + Mark.HAS_EVENT_TIME * timed
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
