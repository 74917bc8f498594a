"""Reading fences during commits."""

import sqlite3
from array import array
from collections.abc import Iterator

from ...state.fences.records import Delay, FenceEvent, Inside, KeptFence, Members, Subject
from ...state.records import NO_TIME
from ..port import DamagedError
from .encoding import checksum
from .event_rows import decode_delay, decode_events, decode_inside
from .fence_ledger import FenceRows
from .reading import rows_by_id


def read_fence(connection: sqlite3.Connection, fence: FenceRows, first: int) -> KeptFence:
    """A fence with the events after the newest rows that say who was inside.

    Args:
        connection: a connection whose transaction was open when `fence` was copied.
        fence: the rows of the fence.
        first: the sequence of its oldest event.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    base = fence.base
    events = list(_events(connection, fence, base))
    consumers = {name: consumer for name, (consumer, _, _) in fence.consumers.items()}
    delays = dict(_delays(connection, fence))
    return KeptFence(fence.row, _inside(connection, fence, base), events, first, consumers, delays)


def read_events(connection: sqlite3.Connection, fence: FenceRows, after: int, most: int) -> list[FenceEvent]:
    """At most that many events after a sequence, from the oldest that is kept."""
    found: list[FenceEvent] = []
    for event in _events(connection, fence, after):
        if len(found) == most:
            break
        found.append(event)
    return found


def _events(connection: sqlite3.Connection, fence: FenceRows, after: int) -> Iterator[FenceEvent]:
    number = fence.row.number
    expected = max(after, fence.first - 1)
    columns = "fence, first, last, checksum, payload"
    for found, first, last, stored, payload in rows_by_id(connection, columns, "events", fence.places):
        if checksum(payload, found, first, last) != stored or found != number:
            raise _damaged(fence, f"events {first} to {last} are damaged")
        for event in decode_events(payload, first, fence.row.config.subjects):
            if event.sequence > expected:
                if event.sequence != expected + 1:
                    raise _damaged(fence, f"event {expected + 1} is missing")
                expected = event.sequence
                yield event
    if expected < fence.last:
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
