"""Watching a fence.

A watcher has no queue. It remembers the last sequence that it has sent, and reads the events after it: recent ones from
memory, older ones from the storage. A slow client costs no memory.
"""

import asyncio
from collections.abc import AsyncGenerator
from dataclasses import dataclass, field

from ..state.fences.model.records import EventType, FenceEvent
from .fences import LiveFence

# The number of events that are sent together, at most: a gateway holds them for a reader that does not read. Of more of
# them more cancel each other.
EVENTS_TOGETHER, CONFLATED_TOGETHER = 250, 1000
# Seconds between looks at a fence of which the storage has dropped what is still to be published as dropped.
ABOUT_TO = 0.05


@dataclass(slots=True)
class Sent:
    """What is sent at once.

    Attributes:
        sequence: the sequence that it leads to.
        events: the events, in order.
        lost: the first and the last sequence of events that were dropped before they could be sent, or None.
        conflated: the number of events that were left out.
    """

    sequence: int
    events: list[FenceEvent] = field(default_factory=list)
    lost: tuple[int, int] | None = None
    conflated: int = 0


async def watch_fence(
    fence: LiveFence,
    after: int,
    *,
    conflate: bool = False,
    min_interval: float = 0.0,
    progress_interval: float | None = None,
) -> AsyncGenerator[Sent, None]:
    """The events after a sequence, those that are kept and then new ones, until the fence is deleted.

    Args:
        fence: the fence to watch.
        after: the last sequence that the watcher has.
        conflate: whether to leave out events that cancel each other.
        min_interval: the least number of seconds between responses.
        progress_interval: seconds without an event after which an empty response is sent; None for never.
    """
    loop = asyncio.get_running_loop()
    yield Sent(after)  # the watch has begun
    sent = loop.time()
    while True:
        try:
            async with asyncio.timeout_at(None if progress_interval is None else sent + progress_interval):
                await fence.reached(after + 1)
        except TimeoutError:
            sent = loop.time()
            yield Sent(after)
            continue
        await asyncio.sleep(sent + min_interval - loop.time())
        events = await fence.events(after, CONFLATED_TOGETHER if conflate else EVENTS_TOGETHER)
        response = following(after, events, fence.fence.first)
        if response is None:
            if fence.fence.ended:
                return
            await asyncio.sleep(ABOUT_TO)
            continue
        if conflate:
            response.events = conflated(events)
            response.conflated = len(events) - len(response.events)
        del events
        after = response.sequence
        sent = loop.time()
        yield response
        if fence.fence.ended and after >= fence.fence.last:
            return


def following(after: int, events: list[FenceEvent], first: int) -> Sent | None:
    """What is sent after a sequence, None if that is nothing.

    Args:
        after: the last sequence that the watcher has.
        events: the events after it that are kept.
        first: the sequence of the oldest event that is kept; that of the next event if there is none.
    """
    oldest = events[0].sequence if events else first
    lost = (after + 1, oldest - 1) if oldest > after + 1 else None
    if not events and lost is None:
        return None
    return Sent(events[-1].sequence if events else oldest - 1, events, lost)


def conflated(events: list[FenceEvent]) -> list[FenceEvent]:
    """The events without pairs of an enter and an exit of one subject, and what was between. O(number of events).

    Those of subjects that change hulls all stay: who has only the last one would not know which subject it is about.
    """
    last: dict[tuple[str, str | int | None], list[int]] = {}
    moved = {subject for event in events if event.origin for subject in (event.former, (event.hull, event.key))}
    for row, event in enumerate(events):
        if event.type in (EventType.ENTER, EventType.EXIT) and (event.hull, event.key) not in moved:
            last.setdefault((event.hull, event.key), []).append(row)
    # Of one subject they alternate: an even number of them is nothing, of an odd one the last one stays.
    left_out = {row for rows in last.values() for row in (rows if len(rows) % 2 == 0 else rows[:-1])}
    for row, event in enumerate(events):
        if event.type is EventType.DWELL:
            rows = last.get((event.hull, event.key))
            if rows and rows[0] < row < rows[-1]:  # the stay has begun and ended, and is left out
                left_out.add(row)
    return [event for row, event in enumerate(events) if row not in left_out]
