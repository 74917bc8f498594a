"""Fences as their callers use them."""

import asyncio
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from typing import TypeVar

import numpy as np

from ..state.alarms.rule import MARK
from ..state.errors import FenceNotFoundError, HullNotFoundError, NotStoredError, words_for_callers
from ..state.fences.events.block import EventBlock
from ..state.fences.index.checked import CheckedArea, check_polygons
from ..state.fences.model.config import FenceConfig, PolygonArea
from ..state.fences.model.fence import Fence
from ..state.fences.model.records import Consumer, FenceEvent, Inside
from ..state.fences.model.requests import (
    Acknowledge,
    CreateFence,
    DeleteConsumer,
    DeleteFence,
    ReadFence,
    ReplaceFence,
    TrimEvents,
)
from ..state.fences.trip.leg import members
from ..state.frames import Globe
from ..state.registry import page_of
from ..storage.port import Storage, StorageError
from .driver import Driver
from .waiter import Waiter

T = TypeVar("T")
# The checks of polygons at one time. Invalid ones may take long, and large reads have the same threads.
MOST_CHECKS = 2
# Rows of a batch that take about as long as it takes to measure a hull.
ROWS_A_HULL = 16


class LiveFence:
    """A fence that many callers read and watch.

    Attributes:
        fence: its committed state.
    """

    def __init__(self, driver: Driver, storage: Storage, watched: "dict[int, LiveFence]", fence: Fence) -> None:
        self.fence = fence
        self._driver = driver
        self._watched = watched
        self._storage = storage
        self._moved: asyncio.Event | None = None

    @property
    def name(self) -> str:
        """Its name."""
        return self.fence.name

    @property
    def uid(self) -> str:
        """Distinguishes it from other fences of its name."""
        return self.fence.row.uid

    @property
    def created(self) -> datetime:
        """The time of its creation."""
        return datetime.fromtimestamp(self.fence.row.created, UTC)

    async def inside(self) -> Inside:
        """The subjects that are inside, all at one moment. O(number of them)."""
        return await self.read(
            lambda fence, events: Inside(_last(fence, events), tuple(members(fence))), rows=self.fence.inside
        )

    async def waiting(self) -> Inside:
        """As `inside`, with the times since when they wait for their dwell events."""
        return await self.read(who_waits, rows=self.fence.inside)

    async def acknowledge(self, consumer: str, sequence: int | None, uid: str = "") -> Consumer:
        """Acknowledge events for a consumer, which is created if it is new."""
        request = Acknowledge(Waiter(), self.name, self._driver.time(), consumer, sequence, uid)
        found: Consumer = await self._driver.ask(request)
        return found

    async def drop_consumer(self, consumer: str) -> None:
        """Delete a consumer."""
        await self._driver.ask(DeleteConsumer(Waiter(), self.name, self._driver.time(), consumer))

    async def drop_events(self, first: int) -> None:
        """Drop the events before `first`."""
        await self._driver.ask(TrimEvents(Waiter(), self.name, self._driver.time(), self.fence, first))

    async def events(self, after: int, most: int) -> list[FenceEvent]:
        """At most that many events after a sequence, from the oldest one that is kept.

        Raises:
            NotStoredError: the storage cannot be read.
        """
        found = self.fence.events(after, most)
        if found is not None:
            return found
        try:
            read = partial(self._storage.read_events, self.fence.number, after, most)
            events: list[FenceEvent] = await self._driver.on_disk(read)
        except KeyError:  # deleted meanwhile: what is left of it is in memory
            return self.fence.events(self.fence.oldest_recent - 1, most) or []
        except (StorageError, OSError, MemoryError) as error:
            raise NotStoredError(words_for_callers(error)) from error
        return self.fence.published_among(events)

    async def reached(self, sequence: int) -> None:
        """Wait until the fence has an event of this sequence or a later one, or is deleted."""
        while not self.fence.ended and self.fence.last < sequence:
            if self._moved is None:
                self._moved = asyncio.Event()
                self._watched[self.fence.number] = self
            await self._moved.wait()

    def moved(self) -> None:
        """Wake the waiting callers."""
        if self._moved is not None:
            del self._watched[self.fence.number]
            self._moved.set()
            self._moved = None

    async def read(self, function: Callable[[Fence, Sequence[FenceEvent]], T], rows: int) -> T:
        """The value of a function of the fence between two changes, and of its events that are not yet committed.

        Args:
            function: the function.
            rows: the number of subjects that it reads, about.
        """
        found: T = await self._driver.ask(ReadFence(Waiter(), self.name, self._driver.time(), function, rows=rows))
        return found


class Fences:
    """The fences of an engine.

    Args:
        driver: drives the core that has them.
        storage: keeps their events.

    Attributes:
        events: the number of committed events by type, since the start.
        changed: the fences that have changed otherwise than by crossings of subjects, until their keeping has seen
            them.
        watched: those whose next event somebody waits for, by number.
    """

    def __init__(self, driver: Driver, storage: Storage) -> None:
        self._driver = driver
        self._storage = storage
        self._live: dict[Fence, LiveFence] = {}
        self._checks = asyncio.Semaphore(MOST_CHECKS)
        self.events: Counter[int] = Counter()
        self.changed: dict[Fence, None] = {}
        self.watched: dict[int, LiveFence] = {}

    def all(self) -> list[LiveFence]:
        """All fences, by name, and among them the alarms."""
        return [self.live(fence) for fence in list(self._driver.core.fences.values())]

    def get(self, name: str) -> LiveFence:
        """The fence of that name, or raise FenceNotFoundError."""
        return self.live(self._driver.core.fence(name))

    def page(self, prefixes: Sequence[str], after: str, size: int) -> tuple[list[LiveFence], bool]:
        """At most `size` fences whose names follow `after`, and whether there are more.

        Only names that begin with one of the prefixes. These are sorted, and none of them begins with another.
        """
        names, more = page_of(self._driver.core.fences, prefixes, after, size, but=MARK)
        return [self.get(name) for name in names], more

    async def create(self, name: str, config: FenceConfig, *, gives_center: bool = True) -> LiveFence:
        """Create a fence, or raise the error that refuses it; `gives_center` as in CreateFence."""
        driver = self._driver
        checked = await self.checked(config)
        rows = self._rows(config)
        request = CreateFence(Waiter(), name, driver.time(), config, driver.birth(), checked, gives_center, rows=rows)
        return self.live(await driver.ask(request))

    async def replace(self, name: str, config: FenceConfig) -> LiveFence:
        """Replace the area and the settings of a fence, or raise the error that refuses it."""
        checked = await self.checked(config)
        request = ReplaceFence(Waiter(), name, self._driver.time(), config, checked, rows=self._rows(config))
        return self.live(await self._driver.ask(request))

    async def delete(self, name: str) -> None:
        """Delete a fence, or raise FenceNotFoundError or NotStoredError."""
        fence = self._driver.core.fences.get(name)
        if fence is None:
            raise FenceNotFoundError(name)
        await self._driver.ask(DeleteFence(Waiter(), name, self._driver.time(), rows=fence.inside))

    def notify(self, fences: Sequence[Fence], events: EventBlock | None) -> None:
        """Count new events, and wake those who watch their fences.

        Args:
            fences: those that have changed otherwise than by crossings of subjects.
            events: the events; None for none.
        """
        if events is not None:
            for kind, count in enumerate(np.bincount(events.types).tolist()):
                self.events[kind] += count
            if self.watched:
                for number in self.watched.keys() & set(events.fences.tolist()):
                    self.watched[number].moved()
        self.changed.update(dict.fromkeys(fences))
        for fence in fences:
            live = self._live.get(fence)
            if live is not None:
                live.moved()
                if fence.ended:
                    del self._live[fence]

    async def checked(self, config: FenceConfig) -> CheckedArea | None:
        """The polygons of an area, checked while other requests run; None for other areas.

        On the globe they are checked about the centre that the subjects have now, or get; if that moves, once more.
        """
        area = config.area
        if not isinstance(area, PolygonArea):
            return None
        frames = self._frames(config)
        await self._checks.acquire()
        checking = asyncio.ensure_future(self._driver.aside(partial(check_polygons, area, frames)))
        checking.add_done_callback(lambda _: self._checks.release())
        # A caller who leaves does not end it, nor free its thread.
        checked: CheckedArea = await asyncio.shield(checking)
        return checked

    def _frames(self, config: FenceConfig) -> list[Globe | None]:
        """Those in which the area of a fence is checked, until it is valid in one."""
        hulls = self._driver.core.hulls
        if config.kind != "prefix":
            hull = hulls.get(config.subjects)
            return [None if hull is None else hull.state.contents.globe]
        for name in hulls.irange(config.subjects, f"{config.subjects}\U0010ffff"):
            settings = hulls[name].row.settings
            if settings.identity != "multiset":
                return [Globe(None) if settings.geographic else None]
        return [None, Globe(None)]

    def _rows(self, config: FenceConfig) -> int:
        """The number of subjects, about; of an alarm, about as many rows of a batch as take as long as its hulls."""
        if config.rule is not None and config.kind == "prefix":
            hulls = self._driver.core.hulls.irange(config.subjects, f"{config.subjects}\U0010ffff")
            return ROWS_A_HULL * sum(1 for _ in hulls)
        try:
            return self._driver.core.get(config.subjects).counts.points
        except HullNotFoundError:
            return 0

    def live(self, fence: Fence) -> LiveFence:
        """The fence as its callers use it."""
        live = self._live.get(fence)
        if live is None:
            live = LiveFence(self._driver, self._storage, self.watched, fence)
            if not fence.ended:
                self._live[fence] = live
        return live


def _last(fence: Fence, events: Sequence[FenceEvent]) -> int:
    """The sequence of the last event; `events` are those that are not yet committed."""
    return events[-1].sequence if events else fence.last


def who_waits(fence: Fence, events: Sequence[FenceEvent]) -> Inside:
    """Who is inside, and since when; `events` are those that are not yet committed."""
    dwelling = fence.dwelling
    if dwelling is not None and events:
        dwelling = dwelling.copy()
        dwelling.follow(events)
    time = events[-1].time if events else fence.time
    return Inside(_last(fence, events), tuple(members(fence, dwelling)), time)
