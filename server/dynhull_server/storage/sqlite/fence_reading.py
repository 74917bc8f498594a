"""Reading fences during commits."""

import sqlite3
from array import array
from collections.abc import Iterator, Sequence
from itertools import chain

from ...state.fences.records import Delay, FenceEvent, Inside, KeptFence, Members, Subject
from ...state.records import NO_TIME
from ..port import NEWEST, DamagedError
from .encoding import checksum
from .event_blocks import decode_block
from .event_rows import decode_delay, decode_events, decode_inside
from .fence_ledger import FenceRows
from .reading import rows_by_id


def read_fences(connection: sqlite3.Connection, fences: Sequence[FenceRows | None]) -> list[KeptFence | None]:
    """Fences with the events after the newest rows that say who was inside; None for None.

    Args:
        connection: a connection whose transaction was open when the fences were copied.
        fences: the rows of fences.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    there = [fence for fence in fences if fence is not None]
    events = _events(connection, there, [fence.base for fence in there])
    return [None if fence is None else _kept(connection, fence, events[fence.row.number]) for fence in fences]


def read_events(connection: sqlite3.Connection, fence: FenceRows, after: int, most: int) -> list[FenceEvent]:
    """At most that many events after a sequence, from the oldest that is kept."""
    return _events(connection, [fence], [after], most)[fence.row.number]


def _kept(connection: sqlite3.Connection, fence: FenceRows, events: list[FenceEvent]) -> KeptFence:
    consumers = {name: consumer for name, (consumer, _, _) in fence.consumers.items()}
    delays = dict(_delays(connection, fence))
    return KeptFence(fence.row, _inside(connection, fence, fence.base), events, fence.first, consumers, delays)


def _events(
    connection: sqlite3.Connection, fences: Sequence[FenceRows], after: Sequence[int], most: int = NEWEST
) -> dict[int, list[FenceEvent]]:
    """At most that many events of each fence after a sequence. Each row is read once."""
    by_number = {fence.row.number: fence for fence in fences}
    afters = {fence.row.number: max(each, fence.first - 1) for fence, each in zip(fences, after, strict=True)}
    runs: dict[int, list[list[FenceEvent]]] = {number: [] for number in by_number}
    places = array("q", sorted({place for fence in fences for place in fence.places}))
    columns = "events.rowid, fence, first, last, checksum, payload"

    def own(number: int) -> str:
        return by_number[number].row.config.subjects if number in by_number else ""

    for place, number, first, last, stored, payload in rows_by_id(connection, columns, "events", places):
        if checksum(payload, number, first, last) != stored:
            named = next(fence for fence in fences if place in fence.places)
            raise _damaged(named, "events are damaged")
        if number in by_number:
            runs[number].append(list(decode_events(payload, first, own(number))))
        elif number == 0:
            block = decode_block(payload, own)
            for run, fence in enumerate(block.fences.tolist()):
                if fence in by_number and block.firsts[run] + block.counts[run] > afters[fence] + 1:
                    runs[fence].append(block.events(run))
    return {number: list(_following(by_number[number], found, afters[number], most)) for number, found in runs.items()}


def _following(fence: FenceRows, runs: list[list[FenceEvent]], after: int, most: int) -> Iterator[FenceEvent]:
    """The next events after a sequence; DamagedError if one is missing."""
    until = min(after + most, fence.last)
    expected = after
    in_order: list[list[FenceEvent]] = sorted(runs, key=lambda run: run[0].sequence)
    for event in chain.from_iterable(in_order):
        if expected < event.sequence <= until:
            expected += 1
            if event.sequence != expected:
                break
            yield event
    if expected < until:
        raise _damaged(fence, f"event {expected + 1} is missing")


def _inside(connection: sqlite3.Connection, fence: FenceRows, base: int) -> Inside:
    rows = fence.insides.get(base)
    if rows is None:
        return Inside()
    places = array("q", (rows.places[part] for part in range(rows.parts)))
    members: list[Members] = []
    columns = "fence, sequence, part, parts, checksum, payload"
    count, time = 0, NO_TIME
    for *keys, stored, payload in rows_by_id(connection, columns, "insides", places):
        if checksum(payload, *keys) != stored or keys != [fence.row.number, base, count, rows.parts]:
            raise _damaged(fence, f"who was inside after event {base} is damaged")
        part = decode_inside(payload, base)
        members += part.members
        time = part.time
        count += 1
    if count < rows.parts:
        raise _damaged(fence, f"who was inside after event {base} is missing")
    return Inside(base, tuple(members), time)


def _delays(connection: sqlite3.Connection, fence: FenceRows) -> Iterator[tuple[Subject, Delay]]:
    places = array("q", (place for place, _ in fence.delays.values()))
    count = 0
    for number, stored, payload in rows_by_id(connection, "fence, checksum, payload", "delays", places):
        if checksum(payload, number) != stored or number != fence.row.number:
            raise _damaged(fence, "a delay is damaged")
        count += 1
        yield decode_delay(payload)
    if count < len(places):
        raise _damaged(fence, "a delay is missing")


def _damaged(fence: FenceRows, words: str) -> DamagedError:
    return DamagedError(f"fence {fence.row.name!r}: {words}: restore a backup")
