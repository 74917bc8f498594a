"""Playing the past of a hull: it goes from revision to revision, with the events of a watch.

The reader has a hull of its own, which is rebuilt once, at the beginning, and then takes the batches as they are read.
So little is held for a reader that is slow: it gets one event for several revisions or, where it sets the pace, the
batches are read later, some milliseconds of them at a time.
"""

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from dynhull.arrays import Points

from ..state.core import SMALL
from ..state.fences.model.fence import Fence
from ..state.hull import Hull
from ..state.hull_state import Counts, HullState
from ..state.records import FOREVER, CommitStamp, Record
from ..storage.past import Erasure
from .driver import Driver
from .fences import Fences
from .live_hull import LiveHull
from .past import Outlined, PastHulls, time_of
from .recalls import Recalls
from .views import Event, Progress, VerticesView, View

T = TypeVar("T")

MICROSECONDS = 1_000_000
# Seconds of work after which there is an event, where the server does not keep up with the speed.
LONGEST_WORK = 1.0


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast the past goes by.

    Attributes:
        speed: how many seconds of it in one; 0 for as fast as the reader takes them.
        every: the least number of microseconds of the past between events.
        interval: the least number of seconds between events.
        progress: seconds without an event after which there is a Progress; None for never.
    """

    speed: float
    every: int
    interval: float
    progress: float | None

    @property
    def combines(self) -> bool:
        """Whether an event may have the changes of several revisions."""
        return bool(self.speed or self.every)

    def after(self, time: int, origin: int) -> int:
        """The first time not before another one at which there may be an event."""
        return time + (origin - time) % self.every if self.every else time

    def before(self, time: int, origin: int) -> int:
        """The last time not after another one at which there may be an event."""
        return time - (time - origin) % self.every if self.every else time


class ReplayedHull(LiveHull):
    """A hull on its way through its past, for one reader.

    Args:
        live: the hull of now.
        pasts: reads the batches.
        state: its state at the first revision, for itself alone.
        erasures: what had been erased from its past before that was read.
        last: the last revision.
    """

    def __init__(
        self,
        driver: Driver,
        hull: Hull,
        recalls: Recalls,
        fences: Fences,
        copies: asyncio.Semaphore,
        live: LiveHull,
        pasts: PastHulls,
        state: HullState,
        erasures: tuple[Erasure, ...],
        last: int,
    ) -> None:
        super().__init__(driver, hull, recalls, fences, copies)
        self._live = live
        self._pasts = pasts
        self._state = state
        self._erasures = erasures
        self._seen = -1  # of the erasures of all hulls
        self._last = last
        self._ahead: deque[Record] = deque()
        # Where only vertices are asked for, the state is ahead of them: these are here, those that follow, and those
        # after them, which are made meanwhile: a thread makes them while the event loop sends the ones before.
        self._at: Outlined | None = None
        self._outlines: deque[Outlined] = deque()
        self._making: asyncio.Future[list[Outlined]] | None = None

    @property
    def counts(self) -> Counts:
        """The counts at the revision that it has come to."""
        return self._state.counts if self._at is None else self._at.counts

    @property
    def committed(self) -> CommitStamp | None:
        """The commit of that revision; None where it is not known."""
        return self._state.committed if self._at is None else self._at.committed

    @property
    def vertex_count(self) -> int:
        """The number of its vertices."""
        return self._state.vertex_count if self._at is None else len(self._at.vertices)

    def erased_at(self, revision: int) -> bool:
        """Whether it may lack keys at a revision that were erased from its past."""
        return any(each.concerns(revision) for each in self._erasures)

    async def outline_only(self) -> None:
        """Be asked for vertices alone from now on: several batches are applied in one step, each with its own."""
        counts, vertices = await self.vertices()
        self._at = Outlined(counts, self.committed, vertices, 0)

    async def vertices(self, min_revision: int = 0, layer: int = 1) -> tuple[Counts, Points]:
        """The vertices, or those of another convex layer; the same array object while they have not changed."""
        if self._at is None:
            return await super().vertices(min_revision, layer)
        await self.reached(min_revision)
        return self._at.counts, self._at.vertices

    async def read(self, function: Callable[[HullState], T], rows: int = 0, min_revision: int = 0) -> tuple[Counts, T]:
        """Call `function` with the state at that revision."""
        await self.reached(min_revision)
        assert self._at is None, "only vertices are asked for"
        work = partial(function, self._state)
        return self.counts, work() if rows <= SMALL else await self._driver.aside(work)

    def fences(self, prefixes: tuple[str, ...] = ("",)) -> list[Fence]:
        """None: fences compare the present."""
        del prefixes
        return []

    async def due(self) -> int | None:
        """The time of the next commit, or of the one before where it is not known; None after the last revision.

        Raises:
            HullNotFoundError: the hull has been deleted.
            RevisionForgottenError, NotStoredError: the next revisions are not kept any more, or cannot be read.
        """
        await self.reached(0)
        if self._at is not None:
            if not self._outlines and self._at.counts.revision < self._last:
                await self._next_outlines()
            return self._outlines[0].time if self._outlines else None
        if not self._ahead:
            if self.counts.revision >= self._last:
                return None
            after = self.counts.revision
            self._ahead.extend(await self._pasts.batches(self._live, after, self._last, self._erasures))
        return time_of(self._ahead[0], self.committed)

    async def _next_outlines(self) -> None:
        """Get the next vertices, and have those after them made."""
        found = await (self._making or self._make())
        self._outlines.extend(found)
        self._making = None
        if found[-1].counts.revision < self._last:
            self._making = asyncio.ensure_future(self._make())

    async def _make(self) -> list[Outlined]:
        return await self._pasts.outlined(self._live, self._state, self._ahead, self._last, self._erasures)

    def close(self) -> None:
        """Make no further vertices: nobody asks for them any more."""
        if self._making is not None and not self._making.cancel() and not self._making.cancelled():
            self._making.exception()  # it is the caller's, who has left

    async def advance(self, until: int | None) -> None:
        """Go to the next revision; and over those after it that were committed by a time, as far as they are at hand.

        It is due. Raises NotStoredError if keys were erased meanwhile that the state, or what is at hand, may have.
        """
        if self._seen != self._pasts.erasures:
            self._seen = self._pasts.erasures
            await self._pasts.require_unerased(self._live, self._erasures)
        if self._at is not None:
            self._at = self._outlines.popleft()
            return
        records = [self._ahead.popleft()]
        while until is not None and self._ahead and time_of(self._ahead[0], self.committed) <= until:
            records.append(self._ahead.popleft())
        await self._pasts.follow(self._state, records)

    async def pause(self, until: float) -> None:
        """Wait for a time of the event loop, or raise HullNotFoundError if the hull is deleted before."""
        try:
            async with asyncio.timeout_at(until):
                await self._live.outlined(FOREVER)
        except TimeoutError:
            return


async def replay(
    hull: ReplayedHull, view: View, pace: Pace, *, origin: int | None, resumed: bool, outline_only: bool
) -> AsyncGenerator[Event, None]:
    """The state of a hull, then an event for each later revision, or for several at once, until the last.

    Args:
        hull: the hull, which is moved.
        view: the part of it to follow.
        pace: how fast it is moved.
        origin: the time of the past at which this begins; None for that of the first commit.
        resumed: whether the reader holds the first state already.
        outline_only: whether there is no event for revisions that leave what the reader holds as it is.

    Raises:
        HullNotFoundError: the hull has been deleted.
        RevisionForgottenError, NotStoredError: there are no further revisions, because they were dropped or damaged.
    """
    loop = asyncio.get_running_loop()
    event = await view.first(0)
    center = event.counts.center
    if isinstance(view, VerticesView) and view.outline_only and not pace.combines:
        await hull.outline_only()
    begun = sent = loop.time()
    if not resumed:
        yield event
    while (due := await hull.due()) is not None:
        origin = due if origin is None else origin
        until = pace.after(due, origin)
        at = sent + pace.interval
        if pace.speed:
            at = max(at, begun + (until - origin) / MICROSECONDS / pace.speed)
        while (now := loop.time()) < at:
            mark = None if pace.progress is None else sent + pace.progress
            await hull.pause(at if mark is None else min(at, max(mark, now)))
            if mark is not None and mark <= loop.time() < at:
                sent = loop.time()
                yield Progress(hull.counts)
        if pace.speed:
            passed = origin + round((loop.time() - begun) * pace.speed * MICROSECONDS)
            until = max(until, pace.before(passed, origin))
        await _go(hull, pace, until)
        event = await view.next()
        unchanged = isinstance(event, Progress) and event.counts.center == center
        center = event.counts.center
        if outline_only and unchanged:
            await asyncio.sleep(0)  # nothing else may have let others run
        else:
            sent = loop.time()
            yield event


async def _go(hull: ReplayedHull, pace: Pace, until: int) -> None:
    """Go on to the next event."""
    loop = asyncio.get_running_loop()
    end = loop.time() + LONGEST_WORK
    if not pace.combines:
        await hull.advance(None)
        return
    while True:
        await hull.advance(until)
        if pace.speed and loop.time() > end:
            return
        due = await hull.due()
        if due is None or due > until:
            return
