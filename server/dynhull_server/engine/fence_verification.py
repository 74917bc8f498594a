"""Comparison of live fences with what positions, areas and events say."""

import asyncio
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice

from ..state.errors import FenceNotFoundError
from ..state.fences.events.order import EventOrder, subjects_of
from ..state.fences.model.faults import FenceFault
from ..state.fences.model.fence import Fence
from ..state.fences.model.records import Consumer, FenceEvent, Inside
from ..state.fences.recovery.sides import Sides, wrong_sides
from ..state.fences.trip.leg import members
from .fences import LiveFence
from .steps import Run

# Faults of a verification, at most: an area that is wrong is wrong for many subjects.
MOST_FAULTS = 100
# Events read together.
EVENTS_TOGETHER = 1000
# Seconds after which it is published at the latest that events have been dropped, and between looks at it.
PUBLISHED_AFTER, LOOK_AGAIN = 10.0, 0.05


@dataclass(frozen=True, slots=True)
class FenceVerification:
    """The result of a comparison.

    Attributes:
        faults: what is wrong.
        seconds: the processor time.
        last: the sequence of the last event.
        inside: the number of subjects inside after it.
    """

    faults: Sequence[FenceFault]
    seconds: float
    last: int = 0
    inside: int = 0

    @property
    def equal(self) -> bool:
        """Whether there is no fault."""
        return not self.faults


async def verify_sides(sides: Sides, run: Run) -> FenceVerification:
    """Compare who is inside of fences with positions and areas, in a thread by `run`."""
    found: FenceVerification = await run(partial(_timed, lambda: list(islice(wrong_sides(sides), MOST_FAULTS))))
    return found


async def verify_events(fence: LiveFence, run: Run, since: FenceVerification | None = None) -> FenceVerification:
    """Compare the events of a fence, or those since an earlier verification, with each other and with its state.

    Raises:
        FenceNotFoundError, NotStoredError: the fence cannot be read.
    """
    now = await fence.read(_state, rows=fence.fence.inside)
    after = now.first - 1 if since is None else max(since.last, now.first - 1)
    order, seconds = EventOrder(fence.name, after), 0.0
    last = now.inside.sequence
    while order.last < last:
        events = [each for each in await fence.events(order.last, EVENTS_TOGETHER) if each.sequence <= last]
        oldest = events[0].sequence if events else last + 1
        if oldest > order.last + 1:
            if await _are_dropped(fence, oldest):
                order.dropped(oldest)
            elif not events:
                break
        begun, before = time.thread_time(), order.last
        order.take(events)
        seconds += time.thread_time() - begun
        if order.last <= before:  # not in order, which is a fault
            break
    found = await run(partial(_timed, lambda: order.finish(subjects_of(now.inside.members), last, now.consumers)))
    faults = list(found.faults)
    count = sum(max(len(each.keys), 1) for each in now.inside.members)
    if now.count not in (None, count):
        faults.append(FenceFault(fence.name, "", None, 0, f"{count} subjects inside", f"a count of {now.count}"))
    if since is not None and after == since.last and order.balance not in (None, count - since.inside):
        words = f"{since.inside} inside after event {after}, and {order.balance:+} since"
        faults.append(FenceFault(fence.name, "", None, 0, words, f"{count} inside"))
    return FenceVerification(faults, seconds + found.seconds, order.last, count)


async def _are_dropped(fence: LiveFence, oldest: int) -> bool:
    """Whether the events before a sequence have been dropped, which is published soon after it is committed.

    Raises:
        FenceNotFoundError: the fence has been deleted.
    """
    with suppress(TimeoutError):
        async with asyncio.timeout(PUBLISHED_AFTER):
            while fence.fence.first < oldest and not fence.fence.ended:
                await asyncio.sleep(LOOK_AGAIN)
    if fence.fence.ended:
        raise FenceNotFoundError(fence.name)
    return fence.fence.first >= oldest


@dataclass(frozen=True, slots=True)
class _State:
    """A fence at one moment: who is inside after the last event, and their number; None if that is not known."""

    inside: Inside
    first: int
    consumers: list[Consumer]
    count: int | None


def _state(fence: Fence, events: Sequence[FenceEvent]) -> _State:
    """The state after `events`, which are not yet committed."""
    last = events[-1].sequence if events else fence.last
    inside = Inside(last, tuple(members(fence)))
    return _State(inside, fence.first, list(fence.consumers.values()), None if events else fence.inside)


def _timed(function: Callable[[], list[FenceFault]]) -> FenceVerification:
    begun = time.thread_time()
    faults = function()
    return FenceVerification(faults, time.thread_time() - begun)
