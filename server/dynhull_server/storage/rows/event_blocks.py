"""Blocks of events as bytes: the payload of a row of events.

A payload has the number of events, that of runs, flags, and columns. A column of integers is their least one, the
number of bytes of a difference to it, and these differences: what all have in common takes almost nothing. An event
that is alone in its row has a shorter form: `lone_events.py`.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ...compiled import native
from ...state.fences.events.block import EVENT, RUN, EventBlock, Integers, block_of
from ...state.fences.events.format import BlockFlag, Mark
from ...state.fences.model.records import Origin
from ...state.records import NO_TIME
from .columns import Cursor
from .event_columns import columns_of, put_integers
from .event_positions import WORD, take_decimals, take_previous
from .event_rows import (
    OF_PAIRS,
    put_members,
    take_members,
)
from .lone_events import LONE, decode_lone, encode_lone, lone_run
from .varints import put_text, put_unsigned, take_signed, take_text, take_unsigned


class Runs(NamedTuple):
    """What a payload says of its runs first.

    Attributes:
        fences: (m,) the numbers of the fences.
        firsts: (m,) the sequence of the first event of each run.
        counts: (m,) the number of its events.
    """

    fences: Integers
    firsts: Integers
    counts: Integers


def encode_block(block: EventBlock, own: npt.NDArray[np.bool_]) -> bytes:
    """A block as bytes. `own` says of which runs the hull is the one whose keys the fence compares: it is left out."""
    more = BlockFlag.HAS_INSIDE * bool(block.inside) | BlockFlag.HAS_ORIGINS * bool(block.origins)
    if len(block) == 1 and (more or native is None):
        return encode_lone(int(block.fences[0]), block.events(0)[0], own=bool(own[0]))
    if native is None:
        out = _encoded(block, own, more)
    else:
        out = bytearray(native.encoded(block.runs, block.rows, block.keys, own, block.names, more))
    if block.inside:
        put_unsigned(out, len(block.inside))
        for row, members in block.inside.items():
            put_unsigned(out, row)
            put_members(out, members)
    if block.origins:
        put_unsigned(out, len(block.origins))
        for row, origin in block.origins.items():
            put_unsigned(out, row)
            put_text(out, origin.hull)
            put_unsigned(out, origin.revision)
    return bytes(out)


def _encoded(block: EventBlock, own: npt.NDArray[np.bool_], more: int) -> bytearray:
    """What comes before members and origins, whose flags are `more`."""
    out = bytearray()
    columns = columns_of(block)
    fences, firsts, counts, hulls, kinds, subject_revisions, area_revisions, times = columns.runs
    n, m, named, areas = len(block), len(block.runs), not own.all(), block.runs["area_revision"].any()
    flags = BlockFlag.HAS_HULLS * named | BlockFlag.HAS_EVENT_TIMES * (len(columns.event_times) > 0)
    flags |= BlockFlag.HAS_FIRST_TIMES * (columns.first_times is not None) | more
    flags |= BlockFlag.ONE_EACH * (n == m) | BlockFlag.NO_AREAS * (not areas) | BlockFlag.DECIMALS * columns.decimal
    put_unsigned(out, n)
    put_unsigned(out, m)
    out.append(flags)
    put_integers(out, fences, firsts)
    if not flags & BlockFlag.ONE_EACH:
        put_integers(out, counts)
    if named:
        used, places = np.unique(hulls[~own], return_inverse=True)
        put_unsigned(out, len(used))
        for place in used.tolist():
            put_text(out, block.names[place])
        of_runs = np.zeros(m, np.int64)
        of_runs[~own] = places + 1
        put_integers(out, of_runs)
    put_integers(out, kinds, subject_revisions)
    if areas:
        put_integers(out, area_revisions)
    put_integers(out, times, columns.marks, columns.causes, columns.lengths)
    out += block.keys
    out += columns.positions
    out += columns.distances
    if len(columns.event_times):
        put_integers(out, columns.event_times)
    if columns.first_times is not None:
        put_integers(out, columns.first_times)
    return out


def decode_block(payload: bytes, own: Callable[[int], str]) -> EventBlock:
    """The inverse of `encode_block`.

    Args:
        payload: the bytes.
        own: the name of the hull whose keys a fence compares, by its number.

    Raises:
        ValueError: the bytes are no events.
    """
    if payload[:1] == LONE:
        number, event = decode_lone(payload, own)
        return block_of({number: [event]})
    cursor = Cursor(payload)
    n, m, flags = _counts(cursor)
    take = _take_one if n == 1 else _take_integers
    runs, rows = np.empty(m, RUN), np.empty(n, EVENT)
    runs["fence"], runs["first"], runs["count"] = _take_runs(cursor, n, m, flags)
    names, of_runs = [], np.zeros(m, np.int64)
    if flags & BlockFlag.HAS_HULLS:
        names = [take_text(cursor) for _ in range(take_unsigned(cursor))]
        of_runs = take(cursor, m)
    if of_runs.min() < 0 or of_runs.max() > len(names):
        raise ValueError(f"a hull is number {of_runs.max()} of {len(names)}")
    runs["hull"], names = _with_own(of_runs, names, [own(number) for number in runs["fence"][of_runs == 0].tolist()])
    runs["kind"], runs["subject_revision"] = take(cursor, m), take(cursor, m)
    runs["area_revision"] = 0 if flags & BlockFlag.NO_AREAS else take(cursor, m)
    runs["time"] = take(cursor, m)
    marks, rows["causes"], rows["length"] = (take(cursor, n).astype(np.uint8) for _ in range(3))
    keys = bytes(cursor.take(int(rows["length"].sum(dtype=np.int64))))
    there, before = marks & Mark.HAS_POSITION != 0, marks & Mark.HAS_PREVIOUS != 0
    points, previous = np.full((n, 2), np.nan), np.full((n, 2), np.nan)
    if flags & BlockFlag.DECIMALS:
        points[there], previous[before] = take_decimals(cursor, take, there, before)
    else:
        points[there] = cursor.points(int(there.sum()))
        previous[before] = take_previous(cursor, points[before])
    rows["type"] = marks & np.uint8(Mark.TYPE)
    rows["x"], rows["y"] = points.T
    rows["before_x"], rows["before_y"] = previous.T
    rows["distance"] = np.where(there | np.isin(rows["type"], OF_PAIRS), 0.0, np.nan)
    far = marks & Mark.HAS_DISTANCE != 0
    rows["distance"][far] = np.frombuffer(cursor.take(WORD * int(far.sum())), "<f8")
    rows["event_time"] = rows["first_time"] = NO_TIME
    if flags & BlockFlag.HAS_EVENT_TIMES:
        timed = marks & Mark.HAS_EVENT_TIME != 0
        rows["event_time"][timed] = _take_integers(cursor, int(timed.sum()))
    if flags & BlockFlag.HAS_FIRST_TIMES:
        rows["first_time"] = _take_integers(cursor, n)
    inside = {}
    for _ in range(take_unsigned(cursor) if flags & BlockFlag.HAS_INSIDE else 0):
        row = take_unsigned(cursor)
        inside[row] = take_members(cursor)
    origins = {}
    for _ in range(take_unsigned(cursor) if flags & BlockFlag.HAS_ORIGINS else 0):
        row = take_unsigned(cursor)
        origins[row] = Origin(take_text(cursor), take_unsigned(cursor))
    if not cursor.at_end:
        raise ValueError("bytes follow the events")
    return EventBlock(runs, rows, keys, tuple(names), inside, origins)


def _with_own(of_runs: Integers, names: Sequence[str], own: Sequence[str]) -> tuple[Integers, list[str]]:
    """The place of the hull of each run among all names, given those of the runs that leave it out."""
    places = {name: place for place, name in enumerate(dict.fromkeys((*names, *own)))}
    known = np.array([places[name] for name in names], np.int64)
    hulls = np.empty(len(of_runs), np.int64)
    hulls[of_runs > 0] = known[of_runs[of_runs > 0] - 1]
    hulls[of_runs == 0] = [places[name] for name in own]
    return hulls, list(places)


def decode_runs(payload: bytes) -> Runs:
    """Which fences have which events in a payload. ValueError if the bytes are no events."""
    if payload[:1] == LONE:
        number, sequence = lone_run(payload)
        return Runs(*(np.array([each], np.int64) for each in (number, sequence, 1)))
    cursor = Cursor(payload)
    return _take_runs(cursor, *_counts(cursor))


def _counts(cursor: Cursor) -> tuple[int, int, int]:
    n, m = take_unsigned(cursor), take_unsigned(cursor)
    (flags,) = cursor.take(1)
    if not 0 < m <= n or (flags & BlockFlag.ONE_EACH and m < n):
        raise ValueError(f"a row has {n} events in {m} runs, and the flags {flags:#x}")
    return n, m, flags


def _take_runs(cursor: Cursor, n: int, m: int, flags: int) -> Runs:
    take = _take_one if n == 1 else _take_integers
    fences, firsts = take(cursor, m), take(cursor, m)
    return Runs(fences, firsts, np.ones(m, np.int64) if flags & BlockFlag.ONE_EACH else take(cursor, m))


# Columns of integers


def _take_one(cursor: Cursor, _: int) -> Integers:
    return np.array([take_signed(cursor)], np.int64)


def _take_integers(cursor: Cursor, count: int) -> Integers:
    least = take_signed(cursor)
    (size,) = cursor.take(1)
    if size > WORD:
        raise ValueError(f"an integer of {size} bytes")
    found = np.zeros((count, WORD), np.uint8)
    found[:, :size] = np.frombuffer(cursor.take(count * size), np.uint8).reshape(count, size)
    above = found.view("<u8").ravel().astype(np.uint64, copy=False)
    return (above + np.array(least, np.int64).view(np.uint64)).view(np.int64)
