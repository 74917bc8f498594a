"""Background work on fences: who is inside is stored now and then, and old events are dropped."""

from collections.abc import Iterator
from functools import partial
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from ..state.errors import FenceNotFoundError
from ..state.fences.model.fence import Fence
from ..state.fences.model.tallies import Column
from ..storage.port import Storage
from .driver import Driver
from .fences import Fences, LiveFence
from .server_time import MICROSECONDS

# Events since it was last stored who is inside, at least, before it is stored again: a start reads them.
LEAST_EVENTS = 4096
# Events looked at together to find those that are too old.
LOOKED_AT = 1000
# Fences between two pauses, which let others run.
FENCES_A_STEP = 1000


class _Plan(NamedTuple):
    """When the oldest event of a fence that is young enough will be too old.

    Attributes:
        fence: the fence.
        due: that time.
        age: the age at which events are too old.
    """

    fence: Fence
    due: int
    age: int


class FenceKeeping:
    """The work, called periodically by the supervisor.

    Args:
        driver: drives the core that has the fences, and knows how many events are kept, and for how long.
        fences: the fences.
        storage: keeps their events.
    """

    SECONDS = 1.0

    def __init__(self, driver: Driver, fences: Fences, storage: Storage) -> None:
        self._driver = driver
        self._fences = fences
        self._storage = storage
        self._clock = driver.machine.clock
        self._limits = driver.limits.fences
        self._plans: dict[int, _Plan] = {}
        self._due: list[tuple[int, int]] = []  # a heap of times and numbers; outdated where the plan has another time
        fences.changed.update(dict.fromkeys(driver.core.fences.values()))

    async def round(self) -> None:
        """Look at the fences that have changed since the last round, and at those whose oldest events are too old."""
        fences = self._fences
        changed, fences.changed = fences.changed, {}
        changed |= dict.fromkeys(self._crossed())
        now = self._driver.time()
        while self._due and self._due[0][0] <= now:
            due, number = heappop(self._due)
            plan = self._plans.get(number)
            if plan is not None and plan.due == due:
                del self._plans[number]
                changed[plan.fence] = None
        failure: Exception | None = None
        for count, fence in enumerate(changed, start=1):
            if count % FENCES_A_STEP == 0:
                await self._clock.sleep(0)
            if fence.ended or self._rests(fence):
                continue
            try:
                await self._keep(fence)
            except FenceNotFoundError:
                continue
            except Exception as error:  # go on with the other fences
                fences.changed[fence] = None
                failure = failure or error
        if failure is not None:
            raise failure

    def _crossed(self) -> Iterator[Fence]:
        """The fences that subjects have crossed, but those with which there is nothing to do: nearly all, as a rule."""
        tallies, limits = self._driver.core.tallies, self._limits
        columns = tallies.columns
        changed = tallies.changed()
        if not limits.max_fence_event_age:
            many = columns[Column.LAST] - columns[Column.FIRST] >= limits.max_fence_events
            many |= columns[Column.UNSAVED] >= np.maximum(columns[Column.INSIDE], LEAST_EVENTS)
            changed &= many | (columns[Column.LIMITED] != 0)
        return (tallies.owners[place] for place in np.flatnonzero(changed).tolist())

    def _rests(self, fence: Fence) -> bool:
        """Whether there is nothing to do for a fence."""
        kept = fence.last - fence.first + 1
        if kept > self._most(fence) or fence.unsaved >= max(LEAST_EVENTS, fence.inside):
            return False
        plan = self._plans.get(fence.number)
        return (
            not kept or (plan is None and not self._age(fence)) or (plan is not None and plan.age == self._age(fence))
        )

    def _most(self, fence: Fence) -> int:
        """The number of events to keep."""
        most = self._limits.max_fence_events
        return min(fence.row.config.max_events or most, most)

    def _age(self, fence: Fence) -> int:
        """The age in microseconds at which events are too old, 0 for none."""
        ages = [fence.row.config.max_event_age, int(self._limits.max_fence_event_age * MICROSECONDS)]
        return min((each for each in ages if each), default=0)

    async def _keep(self, fence: Fence) -> None:
        config = fence.row.config
        first = await self._first(fence)
        if fence.row.config is not config:  # replaced meanwhile: the next round looks by the limits of now
            self._fences.changed[fence] = None
            return
        stored = fence.last - fence.unsaved
        if fence.unsaved >= max(LEAST_EVENTS, fence.inside) or (first > stored + 1 and fence.unsaved):
            await self._store(self._fences.live(fence))
        if first > fence.first and not fence.ended:
            try:
                boundary = self._storage.boundary(fence.number, first)
            except KeyError:  # its deletion is committed, and about to be published
                return
            if boundary > fence.first:
                await self._fences.live(fence).drop_events(boundary)

    async def _first(self, fence: Fence) -> int:
        """The sequence of the oldest event that the limits let stay."""
        first = max(fence.first, fence.last - self._most(fence) + 1)
        age = self._age(fence)
        plan = self._plans.get(fence.number)
        if not age or (plan is not None and plan.age == age):
            return first
        oldest = self._driver.time() - age
        while first <= fence.last:
            events = await self._fences.live(fence).events(first - 1, LOOKED_AT)
            if not events:
                break
            young = next((event for event in events if event.time >= oldest), None)
            if young is not None:
                self._plans[fence.number] = _Plan(fence, young.time + age, age)
                heappush(self._due, (young.time + age, fence.number))
                return young.sequence
            first = events[-1].sequence + 1
        return first

    async def _store(self, live: LiveFence) -> None:
        inside = await live.waiting()
        steps = self._storage.inside(live.fence.number, inside)
        while (step := await self._driver.on_disk(partial(next, steps, None))) is not None:
            await self._driver.commit([step])
        live.fence.unsaved = max(live.fence.last - inside.sequence, 0)
