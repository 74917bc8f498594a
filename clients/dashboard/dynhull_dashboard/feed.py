"""One hull, watched once for all viewers."""

import asyncio
import math
import time
from contextlib import suppress
from dataclasses import dataclass

from dynhull_client import (
    AsyncHullClient,
    AsyncWatch,
    DynhullError,
    HullCopy,
    HullNotFoundError,
    HullUnsuitableError,
    Verification,
)

from .hull_state import SAMPLE_SIZE, HullState
from .kept import Kept
from .past import LONGEST_SECONDS, past_rows
from .repeating import repeat
from .search import KeySearch
from .time_line import TimeLine

MAX_RATE = 10.0
PROGRESS_SECONDS = 0.5
RETRY_SECONDS = 1.0
TICK_SECONDS = 1.0
SEARCH_SECONDS = 0.2
VERIFY_SECONDS = 30.0
KEPT_SECONDS = 2.0
# Seconds to wait for what the server has kept, before the time lines begin without it.
PAST_SECONDS = 2.0


@dataclass(frozen=True, slots=True)
class Verified:
    """The result of a verification, and its time by `time.monotonic`."""

    outcome: Verification
    at: float


class HullFeed(HullState):
    """The latest state of a hull, kept up to date until closed.

    Attributes:
        verified: the last verification; None before the first.
        time_line: one row per second, after those of the last hour that the server has kept.
        keyed: whether the points have keys; True until that is known.
        kept: what the server has kept of its past.
        search: finds keys in the hull.
    """

    def __init__(self, client: AsyncHullClient, name: str) -> None:
        self.search = KeySearch(client, name)
        self.kept = Kept(client, name)
        super().__init__(name)
        self.time_line = TimeLine("time", "points", "vertices", "area", "rate")
        self._client = client
        self._watch: AsyncWatch | None = None
        self._failure: DynhullError | None = None
        self._verify_now = asyncio.Event()
        self._task = asyncio.create_task(self._run())

    def reset(self) -> None:
        """The hull is missing: nothing is known of it, nor of its keys."""
        super().reset()
        self.verified: Verified | None = None
        self.keyed = True  # until the server says otherwise
        self._copy = HullCopy()
        self.search.forget()

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
            tasks.create_task(repeat(self.name, self._sample, lambda: self.sample_pause))
            tasks.create_task(repeat(self.name, self._verify, lambda: VERIFY_SECONDS, self._verify_now))
            tasks.create_task(repeat(self.name, self.kept.ask, lambda: KEPT_SECONDS))
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
                        self._failure = None
                        self.take(event, copy)
            except HullUnsuitableError:
                self.keyed = False
                continue
            except DynhullError as error:
                self._failure = error
                if isinstance(error, HullNotFoundError):
                    self.reset()
            await asyncio.sleep(RETRY_SECONDS)

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
            self.take_sample(
                await self._client.sample_points(self.name, SAMPLE_SIZE, keys=self.keyed and self.followed)
            )

    async def _find(self) -> None:
        await self.search.ask(self._copy)

    async def _verify(self) -> None:
        outcome = await self._client.verify(self.name, timeout=None)
        self.verified = Verified(outcome, time.monotonic())
