"""One hull, watched once for all viewers."""

import asyncio
import math
import time
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from dynhull_client import (
    AsyncHullClient,
    AsyncWatch,
    Deleted,
    DynhullError,
    Event,
    HullCopy,
    HullNotFoundError,
    HullUnsuitableError,
    Progress,
    Verification,
)

from .degrees import SQUARE_KILOMETRE, Center, outline, poles, shown
from .drawing import Drawing
from .outline import Box, apart, box_around, drawn
from .past import LONGEST_SECONDS, past_rows
from .repeating import repeat
from .search import KeySearch
from .time_line import TimeLine

MAX_RATE = 10.0
PROGRESS_SECONDS = 0.5
RETRY_SECONDS = 1.0
TICK_SECONDS = 1.0
SAMPLE_SIZE = 2_000
# A few points are sampled as often as the hull is drawn; among many, no viewer misses one that is late.
FEW_POINTS_SECONDS, MANY_POINTS_SECONDS = 0.1, 2.0
SEARCH_SECONDS = 0.2
VERIFY_SECONDS = 30.0
# Seconds to wait for what the server has kept, before the time lines begin without it.
PAST_SECONDS = 2.0

NO_POINTS = HullCopy().vertices


@dataclass(frozen=True, slots=True)
class Verified:
    """The result of a verification, and its time by `time.monotonic`."""

    outcome: Verification
    at: float


class HullFeed:
    """The latest state of a hull, kept up to date until closed.

    Attributes:
        name: the name of the hull.
        followed: whether an event has arrived since the hull was last missing.
        revision: its revision.
        points: its number of points, with multiplicity.
        vertices: its number of vertices.
        area: its area, of a geographic hull in square metres; NaN before it is known.
        bounds: the smallest box around it; None while it is empty or unknown.
        center: the centre of a geographic hull; None for a plane, or while there is none.
        poles: the poles in it, such as "south".
        verified: the last verification; None before the first.
        rate: batches per second, over the last second.
        time_line: one row per second, after those of the last hour that the server has kept.
        keyed: whether the points have keys; True until that is known.
        search: finds keys in the hull.
    """

    def __init__(self, client: AsyncHullClient, name: str) -> None:
        self.name = name
        self.search = KeySearch(client, name)
        self._reset()
        self.rate = math.nan
        self.time_line = TimeLine("time", "points", "vertices", "area", "rate")
        self._client = client
        self._watch: AsyncWatch | None = None
        self._failure: DynhullError | None = None
        self._verify_now = asyncio.Event()
        self._task = asyncio.create_task(self._run())

    def _reset(self) -> None:
        self.followed = False
        self.revision = 0
        self.points = 0
        self.vertices = 0
        self.area = math.nan
        self.bounds: Box | None = None
        self.center: Center | None = None
        self.poles: list[str] = []
        self._outline = Drawing("vertices", self.name, 0, NO_POINTS)
        self._inner = Drawing("points", self.name, 0, NO_POINTS)
        self.verified: Verified | None = None
        self.keyed = True  # until the server says otherwise
        self._copy = HullCopy()
        self.search.forget()

    def drawings(self) -> tuple[Drawing, Drawing]:
        """The vertices, and a sample of the other points."""
        return self._outline, self._inner

    def verify_now(self) -> None:
        """Start the next verification without waiting for its time."""
        self._verify_now.set()

    async def close(self) -> None:
        """Stop following the hull."""
        self._task.cancel()
        await asyncio.wait([self._task])

    async def _run(self) -> None:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._follow())
            tasks.create_task(self._count())
            tasks.create_task(repeat(self.name, self._sample, self._sample_pause))
            tasks.create_task(repeat(self.name, self._verify, lambda: VERIFY_SECONDS, self._verify_now))
            tasks.create_task(repeat(self.name, self._find, lambda: SEARCH_SECONDS, self.search.asked))

    @property
    def trouble(self) -> DynhullError | None:
        """The error that interrupts the watch at the moment; None while there is none."""
        return self._failure or (self._watch.lost if self._watch else None)

    @property
    def live(self) -> bool:
        """Whether the attributes are up to date."""
        return self.followed and self.trouble is None

    async def _follow(self) -> None:
        """Watch the hull. A watch survives lost connections, but ends when the hull is deleted: then start another."""
        while True:
            self._copy = copy = HullCopy()
            try:
                async with self._client.watch(
                    self.name,
                    max_rate=MAX_RATE,
                    progress_interval=PROGRESS_SECONDS,
                    measures=True,
                    copy=copy,
                    keys=self.keyed,
                ) as self._watch:
                    async for event in self._watch:
                        self._take(event, copy)
            except HullUnsuitableError:
                self.keyed = False
                continue
            except DynhullError as error:
                self._failure = error
                if isinstance(error, HullNotFoundError):
                    self._reset()
            await asyncio.sleep(RETRY_SECONDS)

    def _take(self, event: Event, copy: HullCopy) -> None:
        self._failure, self.followed = None, True
        self.revision, self.points = event.revision, event.points
        if isinstance(event, Progress | Deleted):
            return
        assert event.measures is not None  # requested by measures=True
        self.vertices = len(copy.vertices)
        self.area = event.measures.area
        self.center = copy.center
        rows = drawn(self.vertices)
        corners = shown(copy.vertices[rows], self.center)
        self.bounds, self.poles, rings = None, [], None
        if self.vertices and self.center is None:
            self.bounds = event.measures.bounds
        elif self.vertices:
            rings = outline(copy.vertices[rows], self.center)
            self.bounds, self.poles = box_around(np.concatenate(rings)), poles(rings)
        keys = None if copy.vertex_keys is None else copy.vertex_keys[rows]
        self._outline = Drawing("vertices", self.name, event.revision, corners, keys, rings)

    @property
    def shown_area(self) -> float:
        """The area as it is shown: of a geographic hull in square kilometres."""
        return self.area if self.center is None else self.area / SQUARE_KILOMETRE

    async def _count(self) -> None:
        """Begin the time line with what the server has kept, then add a row every second."""
        with suppress(DynhullError):  # the server is away or of an earlier version, or the hull is not there
            series = await self._client.series(self.name, LONGEST_SECONDS, timeout=PAST_SECONDS)
            self.time_line.begin(past_rows(series, time.time() * 1000))
        before, then = self.revision, time.monotonic()
        while True:
            await asyncio.sleep(TICK_SECONDS)
            revision, now = self.revision, time.monotonic()
            # After a gap, or when another hull took the name, the difference is not the work of the last second.
            steady = self.live and 0 < before <= revision
            self.rate = (revision - before) / (now - then) if steady else math.nan
            before, then = (revision if self.live else 0), now
            if self.live:
                self.time_line.append(time.time() * 1000, self.points, self.vertices, self.shown_area, self.rate)
            else:
                self.time_line.append(time.time() * 1000, math.nan, math.nan, math.nan, math.nan)

    async def _sample(self) -> None:
        if self._inner.revision != self.revision:
            sampled = await self._client.sample_points(self.name, SAMPLE_SIZE, keys=self.keyed and self.followed)
            points = shown(sampled.points, self.center)
            inner = apart(points, self._outline.points)
            keys = None if sampled.keys is None else [sampled.keys[row] for row in np.flatnonzero(inner)]
            self._inner = Drawing("points", self.name, sampled.revision, points[inner], keys)

    async def _find(self) -> None:
        await self.search.ask(self._copy)

    def _sample_pause(self) -> float:
        return FEW_POINTS_SECONDS if self.points <= SAMPLE_SIZE else MANY_POINTS_SECONDS

    async def _verify(self) -> None:
        outcome = await self._client.verify(self.name, timeout=None)
        self.verified = Verified(outcome, time.monotonic())
