"""Background work on fences: who is inside is stored now and then, and old events are dropped."""

from functools import partial
from typing import TYPE_CHECKING

from ..state.errors import FenceNotFoundError
from ..state.limits import FenceLimits
from ..storage.port import Storage
from .fences import LiveFence
from .server_time import MICROSECONDS
from .threads import Clock

if TYPE_CHECKING:
    from .engine import Engine

# Events since it was last stored who is inside, at least, before it is stored again: a start reads them.
LEAST_EVENTS = 4096
# Events looked at together to find those that are too old.
LOOKED_AT = 1000
# Fences between two pauses, which let others run.
FENCES_A_STEP = 1000


class FenceKeeping:
    """The work, called periodically by the supervisor.

    Args:
        engine: the fences.
        storage: keeps their events.
        clock: the time.
        limits: how many events are kept, and for how long.
    """

    SECONDS = 1.0

    def __init__(self, engine: "Engine", storage: Storage, clock: Clock, limits: FenceLimits) -> None:
        self._engine = engine
        self._storage = storage
        self._clock = clock
        self._limits = limits

    async def round(self) -> None:
        """Look at every fence once."""
        failure: Exception | None = None
        for number, fence in enumerate(self._engine.fences.all(), start=1):
            if number % FENCES_A_STEP == 0:
                await self._clock.sleep(0)
            if fence.fence.last < fence.fence.first and not fence.fence.unsaved:
                continue
            try:
                await self._keep(fence)
            except FenceNotFoundError:
                continue
            except Exception as error:  # go on with the other fences
                failure = failure or error
        if failure is not None:
            raise failure

    async def _keep(self, live: LiveFence) -> None:
        fence = live.fence
        first = await self._first(live)
        stored = fence.last - fence.unsaved
        if fence.unsaved >= max(LEAST_EVENTS, fence.inside) or (first > stored + 1 and fence.unsaved):
            await self._store(live)
        if first > fence.first and not fence.ended:
            boundary = self._storage.boundary(fence.number, first)
            if boundary > fence.first:
                await live.drop_events(boundary)

    async def _first(self, live: LiveFence) -> int:
        """The sequence of the oldest event that the limits let stay."""
        fence, limits = live.fence, self._limits
        config = fence.row.config
        most = min(config.max_events or limits.max_fence_events, limits.max_fence_events)
        first = max(fence.first, fence.last - most + 1)
        ages = [config.max_event_age, int(limits.max_fence_event_age * MICROSECONDS)]
        age = min((each for each in ages if each), default=0)
        if not age:
            return first
        oldest = self._engine.time() - age
        while first <= fence.last:
            events = await live.events(first - 1, LOOKED_AT)
            if not events:
                break
            young = next((event.sequence for event in events if event.time >= oldest), None)
            if young is not None:
                return young
            first = events[-1].sequence + 1
        return first

    async def _store(self, live: LiveFence) -> None:
        inside = await live.waiting()
        steps = self._storage.inside(live.fence.number, inside)
        while (step := await self._engine.run(self._engine.disk, partial(next, steps, None))) is not None:
            await self._engine.commit([step])
        live.fence.unsaved = max(live.fence.last - inside.sequence, 0)
