"""Blocks of events as bytes: the payload of a row of events.

A payload has the number of events, that of runs, flags, and columns. A column of integers is their least one, the
number of bytes of a difference to it, and these differences: what all have in common takes almost nothing. An event
that is alone in its row has a shorter form: `lone_events.py`.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ...state.fences.event_block import Bytes, EventBlock, Integers, block_of
from ...state.fences.records import Origin
from ...state.records import NO_TIME
from .columns import Cursor, point_bytes
from .event_positions import WORD, decimals_of, put_decimals, put_previous, take_decimals, take_previous
from .event_rows import (
    HAS_DISTANCE,
    HAS_EVENT_TIME,
    HAS_POSITION,
    HAS_PREVIOUS,
    OF_PAIRS,
    TYPE_BITS,
    put_members,
    take_members,
)
from .lone_events import LONE, decode_lone, encode_lone, lone_run
from .varints import put_signed, put_text, put_unsigned, take_signed, take_text, take_unsigned

# What a block has.
HAS_HULLS, HAS_EVENT_TIMES, HAS_FIRST_TIMES, HAS_INSIDE, HAS_ORIGINS = 1, 2, 4, 8, 16
# How it is written, since format 8: without the counts of runs, as each is one event; without revisions of areas, as
# there are none; positions as multiples of 1e-7.
ONE_EACH, NO_AREAS, DECIMALS = 32, 64, 128
FEW = 64

Column = npt.NDArray[np.integer[Any]]


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
    if len(block) == 1:
        return encode_lone(int(block.fences[0]), block.events(0)[0], own=bool(own[0]))
    out = bytearray()
    marks, flags = _marks(block), 0
    timed = block.event_times != NO_TIME
    named = not own.all()
    if named:
        flags |= HAS_HULLS
    if timed.any():
        flags |= HAS_EVENT_TIMES
        marks |= np.where(timed, np.uint8(HAS_EVENT_TIME), np.uint8(0))
    if (block.first_times != NO_TIME).any():
        flags |= HAS_FIRST_TIMES
    if block.inside:
        flags |= HAS_INSIDE
    if block.origins:
        flags |= HAS_ORIGINS
    there, before = marks & HAS_POSITION != 0, marks & HAS_PREVIOUS != 0
    decimals = decimals_of(block.points[there], block.previous[before])
    flags |= ONE_EACH * (len(block) == len(block.fences)) + NO_AREAS * (not block.area_revisions.any())
    flags |= DECIMALS * (decimals is not None)
    put_unsigned(out, len(block))
    put_unsigned(out, len(block.fences))
    out.append(flags)
    _put_integers(out, block.fences, block.firsts)
    if not flags & ONE_EACH:
        _put_integers(out, block.counts)
    if named:
        used, places = np.unique(block.hulls[~own], return_inverse=True)
        put_unsigned(out, len(used))
        for place in used.tolist():
            put_text(out, block.names[place])
        of_runs = np.zeros(len(block.fences), np.int64)
        of_runs[~own] = places + 1
        _put_integers(out, of_runs)
    _put_integers(out, block.kinds, block.subject_revisions)
    if not flags & NO_AREAS:
        _put_integers(out, block.area_revisions)
    _put_integers(out, block.times, marks, block.causes, block.lengths)
    out += block.keys
    if decimals is None:
        out += point_bytes(block.points[there])
        put_previous(out, block.points[before], block.previous[before])
    else:
        put_decimals(out, _put_integers, *decimals, there[before], before[there])
    out += block.distances[marks & HAS_DISTANCE != 0].astype("<f8", copy=False).tobytes()
    if flags & HAS_EVENT_TIMES:
        _put_integers(out, block.event_times[timed])
    if flags & HAS_FIRST_TIMES:
        _put_integers(out, block.first_times)
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
    fences, firsts, counts = _take_runs(cursor, n, m, flags)
    names, of_runs = [], np.zeros(m, np.int64)
    if flags & HAS_HULLS:
        names = [take_text(cursor) for _ in range(take_unsigned(cursor))]
        of_runs = take(cursor, m)
    if of_runs.min() < 0 or of_runs.max() > len(names):
        raise ValueError(f"a hull is number {of_runs.max()} of {len(names)}")
    hulls, names = _with_own(of_runs, names, [own(number) for number in fences[of_runs == 0].tolist()])
    kinds, subject_revisions = take(cursor, m), take(cursor, m)
    area_revisions = np.zeros(m, np.int64) if flags & NO_AREAS else take(cursor, m)
    times = take(cursor, m)
    marks, causes, lengths = (take(cursor, n).astype(np.uint8) for _ in range(3))
    keys = bytes(cursor.take(int(lengths.sum(dtype=np.int64))))
    types, there = marks & np.uint8(TYPE_BITS), marks & HAS_POSITION != 0
    before = marks & HAS_PREVIOUS != 0
    points, previous = np.full((n, 2), np.nan), np.full((n, 2), np.nan)
    if flags & DECIMALS:
        points[there], previous[before] = take_decimals(cursor, take, there, before)
    else:
        points[there] = cursor.points(int(there.sum()))
        previous[before] = take_previous(cursor, points[before])
    distances = np.where(there | np.isin(types, OF_PAIRS), 0.0, np.nan)
    far = marks & HAS_DISTANCE != 0
    distances[far] = np.frombuffer(cursor.take(WORD * int(far.sum())), "<f8")
    event_times, first_times = np.full(n, NO_TIME), np.full(n, NO_TIME)
    if flags & HAS_EVENT_TIMES:
        timed = marks & HAS_EVENT_TIME != 0
        event_times[timed] = _take_integers(cursor, int(timed.sum()))
    if flags & HAS_FIRST_TIMES:
        first_times = _take_integers(cursor, n)
    inside = {}
    for _ in range(take_unsigned(cursor) if flags & HAS_INSIDE else 0):
        row = take_unsigned(cursor)
        inside[row] = take_members(cursor)
    origins = {}
    for _ in range(take_unsigned(cursor) if flags & HAS_ORIGINS else 0):
        row = take_unsigned(cursor)
        origins[row] = Origin(take_text(cursor), take_unsigned(cursor))
    if not cursor.at_end:
        raise ValueError("bytes follow the events")
    return EventBlock(
        fences,
        firsts,
        counts,
        hulls,
        kinds.astype(np.uint8),
        subject_revisions,
        area_revisions,
        times,
        types,
        causes,
        lengths,
        keys,
        points,
        previous,
        distances,
        event_times,
        first_times,
        tuple(names),
        inside,
        origins,
    )


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
    if not 0 < m <= n or (flags & ONE_EACH and m < n):
        raise ValueError(f"a row has {n} events in {m} runs, and the flags {flags:#x}")
    return n, m, flags


def _take_runs(cursor: Cursor, n: int, m: int, flags: int) -> Runs:
    take = _take_one if n == 1 else _take_integers
    fences, firsts = take(cursor, m), take(cursor, m)
    return Runs(fences, firsts, np.ones(m, np.int64) if flags & ONE_EACH else take(cursor, m))


def _marks(block: EventBlock) -> Bytes:
    there, before = (~np.isnan(points[:, 0]) for points in (block.points, block.previous))
    far = ~np.isnan(block.distances) & (block.distances != 0)
    marks: Bytes = block.types | (HAS_POSITION * there + HAS_PREVIOUS * before + HAS_DISTANCE * far).astype(np.uint8)
    return marks


# Columns of integers


def _take_one(cursor: Cursor, _: int) -> Integers:
    return np.array([take_signed(cursor)], np.int64)


def _put_integers(out: bytearray, *columns: Column) -> None:
    for column in columns:
        if len(column) <= FEW:  # numpy begins slowly
            numbers = column.tolist()
            least = min(numbers)
            size = ((max(numbers) - least).bit_length() + 7) // 8
            put_signed(out, least)
            out.append(size)
            if size:
                out += b"".join([(number - least).to_bytes(size, "little") for number in numbers])
            continue
        least = int(column.min())
        above = column.astype(np.int64).view(np.uint64) - np.int64(least).view(np.uint64)
        size = (int(above.max()).bit_length() + 7) // 8
        put_signed(out, least)
        out.append(size)
        if size:
            out += above.astype("<u8", copy=False).view(np.uint8).reshape(-1, WORD)[:, :size].tobytes()


def _take_integers(cursor: Cursor, count: int) -> Integers:
    least = take_signed(cursor)
    (size,) = cursor.take(1)
    if size > WORD:
        raise ValueError(f"an integer of {size} bytes")
    found = np.zeros((count, WORD), np.uint8)
    found[:, :size] = np.frombuffer(cursor.take(count * size), np.uint8).reshape(count, size)
    above = found.view("<u8").ravel().astype(np.uint64, copy=False)
    return (above + np.array(least, np.int64).view(np.uint64)).view(np.int64)
