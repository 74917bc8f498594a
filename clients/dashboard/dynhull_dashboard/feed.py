"""One hull, watched once for everybody who looks at it."""

import asyncio
import logging
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from dynhull_client import AsyncHullClient, AsyncWatch, Deleted, DynhullError, Event, HullCopy, Progress, Verification

from .drawing import Drawing, points_of, vertices_of
from .history import History
from .outline import Box, outline, without

MAX_RATE = 10.0
PROGRESS_SECONDS = 0.5
RETRY_SECONDS = 1.0
TICK_SECONDS = 1.0
SAMPLE_SIZE = 2_000
# Few points move with their hull; of many nobody misses one.
FEW_POINTS_SECONDS, MANY_POINTS_SECONDS = 0.1, 2.0
VERIFY_SECONDS = 30.0
# Samples and verifications cost the server work in proportion to the points: they get a twentieth of the time.
REST = 19

NO_POINTS = HullCopy().vertices

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Verified:
    """What came out of a verification, and when by `time.monotonic`."""

    outcome: Verification
    at: float


class HullFeed:
    """The latest of a hull, kept up to date until closed.

    Attributes:
        name: the hull's.
        revision: its revision.
        points: how many points it has, with multiplicity.
        vertices: how many vertices.
        area: its area; NaN before it is known.
        bounds: the smallest box around it; None where it is empty.
        verified: the last verification; None before the first.
        rate: batches a second, over the last second.
        history: a row a second.
    """

    def __init__(self, client: AsyncHullClient, name: str) -> None:
        self.name = name
        self.revision = 0
        self.points = 0
        self.vertices = 0
        self.area = math.nan
        self.bounds: Box | None = None
        self._outline = Drawing(vertices_of(name), 0, NO_POINTS)
        self._inner = Drawing(points_of(name), 0, NO_POINTS)
        self.verified: Verified | None = None
        self.rate = math.nan
        self.history = History("time", "points", "vertices", "area", "rate")
        self._client = client
        self._watch: AsyncWatch | None = None
        self._failure: str | None = "waiting for the first event"
        self._verify_now = asyncio.Event()
        self._task = asyncio.create_task(self._run())

    def drawings(self) -> tuple[Drawing, Drawing]:
        """What to draw: the vertices, and some of the other points."""
        return self._outline, self._inner

    def verify_now(self) -> None:
        """Do not wait until the next verification is due."""
        self._verify_now.set()

    async def close(self) -> None:
        """Look no longer."""
        self._task.cancel()
        await asyncio.wait([self._task])

    async def _run(self) -> None:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._follow())
            tasks.create_task(self._count())
            tasks.create_task(self._repeat(self._sample, self._sample_pause, asyncio.Event()))
            tasks.create_task(self._repeat(self._verify, lambda: VERIFY_SECONDS, self._verify_now))

    @property
    def trouble(self) -> str | None:
        """Why it is not followed at the moment; None where it is."""
        lost = self._watch and self._watch.lost
        return self._failure or (str(lost) if lost else None)

    async def _follow(self) -> None:
        """The watch outlives lost connections, but not its hull: one of the name may come again."""
        while True:
            copy = HullCopy()
            try:
                async with self._client.watch(
                    self.name, max_rate=MAX_RATE, progress_interval=PROGRESS_SECONDS, measures=True, copy=copy
                ) as self._watch:
                    async for event in self._watch:
                        self._take(event, copy)
            except DynhullError as error:
                self._failure = str(error)
            await asyncio.sleep(RETRY_SECONDS)

    def _take(self, event: Event, copy: HullCopy) -> None:
        self._failure = None
        self.revision, self.points = event.revision, event.points
        if isinstance(event, Progress | Deleted):
            return
        assert event.measures is not None  # asked for
        self.vertices = len(copy.vertices)
        self.area = event.measures.area
        self.bounds = event.measures.bounds if self.vertices else None
        self._outline = Drawing(vertices_of(self.name), event.revision, outline(copy.vertices))

    async def _count(self) -> None:
        """A row of the history every second."""
        before, then = self.revision, time.monotonic()
        while True:
            await asyncio.sleep(TICK_SECONDS)
            revision, now = self.revision, time.monotonic()
            # A hull that is followed again, or is another of its name, has not made all these batches just now.
            steady = self.trouble is None and 0 < before <= revision
            self.rate = (revision - before) / (now - then) if steady else math.nan
            before, then = (0 if self.trouble else revision), now
            if self.trouble is None:
                self.history.append(time.time() * 1000, self.points, self.vertices, self.area, self.rate)
            else:
                self.history.append(time.time() * 1000, math.nan, math.nan, math.nan, math.nan)

    async def _sample(self) -> None:
        if self._inner.revision != self.revision:
            sampled = await self._client.sample_points(self.name, SAMPLE_SIZE)
            others = without(sampled.points, self._outline.points)
            self._inner = Drawing(points_of(self.name), sampled.revision, others)

    def _sample_pause(self) -> float:
        return FEW_POINTS_SECONDS if self.points <= SAMPLE_SIZE else MANY_POINTS_SECONDS

    async def _verify(self) -> None:
        outcome = await self._client.verify(self.name, timeout=None)
        self.verified = Verified(outcome, time.monotonic())

    async def _repeat(
        self, work: Callable[[], Awaitable[None]], pause: Callable[[], float], at_once: asyncio.Event
    ) -> None:
        """Work again and again, with a pause between, longer after work that took long; none when told."""
        while True:
            begun = time.monotonic()
            try:
                await work()
            except DynhullError as error:  # the watch ends for the same reason, and says so on the page
                log.info("%s: %s", self.name, error)
            took = time.monotonic() - begun
            try:
                await asyncio.wait_for(at_once.wait(), max(pause(), REST * took))
            except TimeoutError:
                continue
            at_once.clear()
