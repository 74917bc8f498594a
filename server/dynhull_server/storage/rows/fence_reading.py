"""Reading fences during commits."""

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from ...state.alarms.rule import called
from ...state.fences.model.records import Delay, FenceEvent, Inside, KeptFence, Members, Subject
from ...state.records import NO_TIME
from ..port import NEWEST, DamagedError
from .encoding import checksum
from .event_blocks import decode_block, encode_block
from .event_rows import decode_delay, decode_events, decode_inside
from .fence_ledger import ShrinkEvents
from .fence_runs import FenceRows
from .tables import MANY, Reader

OWN = "\0"  # no name of a hull


def read_fences(reader: Reader, fences: Sequence[FenceRows | None]) -> list[KeptFence | None]:
    """Fences with the events after the newest rows that say who was inside; None for None.

    Args:
        reader: reads the rows as of when the fences were copied.
        fences: the rows of fences.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    there = [fence for fence in fences if fence is not None]
    kept = {fence.row.number: read_settled(reader, fence) for fence in there}
    for number, events in read_runs(reader, {fence.row.number: (fence, fence.base) for fence in there}):
        kept[number].events += events
    return [None if fence is None else kept[fence.row.number] for fence in fences]


def read_settled(reader: Reader, fence: FenceRows) -> KeptFence:
    """A fence without its events."""
    consumers = {name: consumer for name, (consumer, _, _) in fence.consumers.items()}
    delays = dict(_delays(reader, fence))
    return KeptFence(fence.row, _inside(reader, fence, fence.base), [], fence.first, consumers, delays)


def read_events(reader: Reader, fence: FenceRows, after: int, most: int) -> list[FenceEvent]:
    """At most that many events after a sequence, from the oldest that is kept."""
    found: list[FenceEvent] = []
    for _, events in read_runs(reader, {fence.row.number: (fence, after)}, most):
        found += events
    return found


def read_runs(
    reader: Reader, wanted: Mapping[int, tuple[FenceRows, int]], most: int = NEWEST
) -> Iterator[tuple[int, list[FenceEvent]]]:
    """Some events of many fences, reading each row once.

    Args:
        reader: reads the rows as of when the fences were copied.
        wanted: fences by number, and the sequences after which their events are wanted.
        most: the number of events of each that are wanted.

    Yields:
        The number of a fence, and its next events, in the order in which they were stored.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    last = {number: max(after, fence.first - 1) for number, (fence, after) in wanted.items()}
    until = {number: min(last[number] + most, fence.last) for number, (fence, _) in wanted.items()}
    places = array("q", sorted({place for fence, _ in wanted.values() for place in fence.places}))
    columns = "events.rowid, fence, first, last, checksum, payload"

    def own(number: int) -> str:
        return wanted[number][0].row.config.subjects if number in wanted else ""

    for place, number, first, end, stored, payload in reader.some("events", columns, places):
        if checksum(payload, number, first, end) != stored:
            fence = next(fence for fence, _ in wanted.values() if place in fence.places)
            raise _damaged(fence, f"row {place} of events is damaged")
        runs: Iterable[tuple[int, list[FenceEvent]]]
        if number == 0:
            block = decode_block(payload, own)
            runs = ((each, block.events(run)) for run, each in enumerate(block.fences.tolist()) if each in wanted)
        else:
            runs = [(number, list(decode_events(payload, first, own(number))))]
        for each, made in runs:
            events = [event for event in made if last[each] < event.sequence <= until[each]]
            if events:
                if events[0].sequence != last[each] + 1:
                    raise _damaged(wanted[each][0], f"event {last[each] + 1} is missing")
                last[each] = events[-1].sequence
                yield each, events
    for number, (fence, _) in wanted.items():
        if last[number] < until[number]:
            raise _damaged(fence, f"event {last[number] + 1} is missing")


def shrunk(reader: Reader, place: int, starts: Mapping[int, int]) -> ShrinkEvents | None:
    """The step that leaves of a row of events of many fences what is needed; None if that is nothing.

    Args:
        reader: reads the row.
        place: the number of the row.
        starts: where the events of each fence begin, by number.

    Raises:
        DamagedError: the row is damaged.
    """
    for stored, payload in reader.some("events", "checksum, payload", array("q", [place])):
        if checksum(payload, *MANY) != stored:
            raise DamagedError(f"row {place} of events is damaged: restore a backup")
        block = decode_block(payload, lambda _: OWN)
        ends = (block.firsts + block.counts).tolist()
        needed = [end > starts.get(number, end) for number, end in zip(block.fences.tolist(), ends, strict=True)]
        if any(needed):
            left = block.only(np.array(needed))
            own = np.array([name == OWN for name in left.names])[left.runs["hull"]]
            return ShrinkEvents(place, len(left.fences), encode_block(left, own))
    return None


def _inside(reader: Reader, fence: FenceRows, base: int) -> Inside:
    rows = fence.insides.get(base)
    if rows is None:
        return Inside()
    places = array("q", (rows.places[part] for part in range(rows.parts)))
    members: list[Members] = []
    columns = "fence, sequence, part, parts, checksum, payload"
    count, time = 0, NO_TIME
    for *keys, stored, payload in reader.some("insides", columns, places):
        if checksum(payload, *keys) != stored or keys != [fence.row.number, base, count, rows.parts]:
            raise _damaged(fence, f"who was inside after event {base} is damaged")
        part = decode_inside(payload, base)
        members += part.members
        time = part.time
        count += 1
    if count < rows.parts:
        raise _damaged(fence, f"who was inside after event {base} is missing")
    return Inside(base, tuple(members), time)


def _delays(reader: Reader, fence: FenceRows) -> Iterator[tuple[Subject, Delay]]:
    places = array("q", (place for place, _ in fence.delays.values()))
    count = 0
    for number, stored, payload in reader.some("delays", "fence, checksum, payload", places):
        if checksum(payload, number) != stored or number != fence.row.number:
            raise _damaged(fence, "a delay is damaged")
        count += 1
        yield decode_delay(payload)
    if count < len(places):
        raise _damaged(fence, "a delay is missing")


def _damaged(fence: FenceRows, words: str) -> DamagedError:
    return DamagedError(f"{called(fence.row.name)}: {words}: restore a backup")
