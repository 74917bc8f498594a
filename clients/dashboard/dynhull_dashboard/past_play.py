"""The past of hulls, played for one viewer from a moment on."""

import asyncio
import json
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from datetime import UTC, datetime

from dynhull_client import (
    AsyncHullClient,
    Deleted,
    DynhullError,
    HullCopy,
    UnavailableError,
)

from .feed import HullFeed
from .hull_state import SAMPLE_SIZE, HullState
from .repeating import log, repeat

PICTURE_SECONDS = 0.1
RETRY_SECONDS = 1.0


class PastClock:
    """The moment that is shown. It begins to move once all hulls are there.

    Args:
        begin: the moment to begin with, in seconds since 1970.
        speed: how many seconds of the past go by in one; 0 for none.
    """

    def __init__(self, begin: float, speed: float) -> None:
        self.speed = speed
        self._begin = begin
        self._begun: float | None = None

    @property
    def moment(self) -> float:
        """The moment, in seconds since 1970: never after now."""
        passed = 0.0 if self._begun is None else self.speed * (time.monotonic() - self._begun)
        return min(self._begin + passed, time.time())

    def start(self) -> None:
        """Begin to move, at the first call."""
        if self._begun is None:
            self._begun = time.monotonic()

    async def reach(self, moment: float) -> None:
        """Wait for this moment."""
        while self.moment < moment:
            await asyncio.sleep(PICTURE_SECONDS)


class PastHull(HullState):
    """A hull as it was, kept up to the moment of the clock until closed.

    Args:
        client: the connection.
        live: the hull as it is.
        clock: the moment.

    Attributes:
        kept: what the server has kept of its past.
        ready: set once the hull is there, or cannot be.
    """

    def __init__(self, client: AsyncHullClient, live: HullFeed, clock: PastClock) -> None:
        super().__init__(live.name)
        self.kept = live.kept
        self.ready = asyncio.Event()
        self._client = client
        self._clock = clock
        self._keyed = live.keyed
        self._failure: DynhullError | None = None
        self._moved = asyncio.Event()
        self._tasks = [
            asyncio.create_task(self._run()),
            asyncio.create_task(repeat(self.name, self._sample, lambda: self.sample_pause, self._moved)),
        ]

    @property
    def trouble(self) -> DynhullError | None:
        """Why it cannot be shown at this moment; None where it can."""
        return self._failure

    @property
    def waits_for(self) -> datetime | None:
        """When its past begins, if that is later than the moment; otherwise None."""
        first = self.kept.first
        return first if first is not None and self._clock.moment < first.timestamp() else None

    async def close(self) -> None:
        """Stop playing it."""
        for task in self._tasks:
            task.cancel()
        await asyncio.wait(self._tasks)

    async def _run(self) -> None:
        """Play it, and again where that ends: the hull may have moved on meanwhile, or a hole lies behind."""
        while True:
            try:
                await self._play()
                self._failure = None
            except DynhullError as error:
                log.info("%s: %s", self.name, error)
                self.reset()
                self._failure = error
            self.ready.set()
            if not self._clock.speed and not isinstance(self._failure, UnavailableError):
                return
            await asyncio.sleep(RETRY_SECONDS)

    async def _play(self) -> None:
        clock, copy = self._clock, HullCopy()
        with suppress(UnavailableError):
            await self.kept.ask()
        start: datetime | int = datetime.fromtimestamp(clock.moment, UTC)
        if first := self.waits_for:
            self.reset()
            self._failure = None
            self.ready.set()
            if not clock.speed:
                return
            await clock.reach(first.timestamp())
            assert self.kept.history is not None  # it has said when it begins
            start = self.kept.history.first_revision
        async with self._client.replay(
            self.name,
            start,
            None if clock.speed else start,
            every=clock.speed * PICTURE_SECONDS or None,
            measures=True,
            copy=copy,
            keys=self._keyed,
            reconnect=False,
        ) as replay:
            async for event in replay:
                self.ready.set()
                if isinstance(event, Deleted):
                    self.reset()
                    return
                if self.followed and event.changed is not None:
                    await clock.reach(event.changed.timestamp())
                self._failure = None
                self.take(event, copy)
                self._moved.set()

    async def _sample(self) -> None:
        revision = self.revision
        if self.followed and self._inner.revision != revision:
            past = await self._client.at(self.name, revision)
            sampled = await past.sample_points(SAMPLE_SIZE, keys=self._keyed)
            if self.followed:
                self.take_sample(sampled)


class PastPlay:
    """What one viewer sees of the past.

    Args:
        client: the connection.
        number: that of the viewer's request, which all messages have.
        clock: the moment.
    """

    def __init__(self, client: AsyncHullClient, number: int, clock: PastClock) -> None:
        self._client = client
        self._number = number
        self._clock = clock
        self._hulls: dict[str, PastHull] = {}
        self._drawn: dict[tuple[str, str], str] = {}
        self._closing: set[asyncio.Task[None]] = set()

    @property
    def hulls(self) -> dict[str, PastHull]:
        """The hulls by name."""
        return self._hulls

    def show(self, live: Iterable[HullFeed]) -> None:
        """Play these hulls and no others."""
        feeds = {feed.name: feed for feed in live}
        for name in self._hulls.keys() - feeds.keys():
            task = asyncio.create_task(self._hulls.pop(name).close())
            self._closing.add(task)
            task.add_done_callback(self._closing.discard)
        for name, feed in feeds.items():
            if name not in self._hulls:
                self._hulls[name] = PastHull(self._client, feed, self._clock)
        self._drawn = {each: message for each, message in self._drawn.items() if each[1] in feeds}

    def messages(self) -> Iterator[str]:
        """The drawings that are new since the last call, and then their moment, as JSON."""
        for name, hull in self._hulls.items():
            for drawing in hull.drawings():
                if self._drawn.get((drawing.kind, name)) is not drawing.message:
                    self._drawn[drawing.kind, name] = drawing.message
                    yield f'{{"kind": "past", "number": {self._number}, "drawn": {drawing.message}}}'
        ready = all(hull.ready.is_set() for hull in self._hulls.values())
        if ready:
            self._clock.start()
        moment = 1000 * self._clock.moment
        yield json.dumps(
            {"kind": "past", "number": self._number, "moment": moment, "ready": ready, "holes": self._holes()}
        )

    def said(self, said: dict[str, str]) -> str:
        """Words and figures for the page, as JSON."""
        return json.dumps({"kind": "past", "number": self._number, "said": said})

    def _holes(self) -> list[str]:
        """The hulls whose past cannot be read at this moment, although it is kept."""
        return [name for name, hull in self._hulls.items() if _is_hole(hull)]

    def close(self) -> None:
        """Stop."""
        self.show(())


def _is_hole(hull: PastHull) -> bool:
    """Whether its past is kept, but cannot be read."""
    return hull.trouble is not None and hull.trouble.reason == "STORAGE_FAILED"
