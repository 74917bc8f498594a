"""What the core does for fences: their part of trips, and what follows once that is committed or fails."""

from collections.abc import Sequence
from typing import Any

from ..events import Effect, Examine, WakeFences
from ..hull import Hull
from ..leg import Leg
from ..queues import Queue, Queues, names_of
from ..registry import Registry
from ..requests import CreateHull, Request, WriteBatch
from ..schedule import Schedule
from ..trip import Quiet, Trip
from .index.line import Line
from .model.fence import Fence
from .model.records import KeptFence
from .model.requests import CreateFence, FenceRequest, PassTime
from .recovery.restored import Restored, bring_back
from .recovery.rollback import give_back, reading
from .trip.comparison import Ground
from .trip.deadlines import MOST_DUE
from .trip.part import FencePart

# Rows that the alarms at the hulls of a trip weigh, at most, if it is not to be planned with them.
QUIET_WEIGHT = 1024


class FenceCore:
    """All fences of a server.

    Args:
        registry: the hulls and fences that are committed.
        queues: the queues of all names.
        schedule: when fences have something to do because time passes.
        keeps: whether the storage keeps batches.
    """

    def __init__(self, registry: Registry, queues: Queues, schedule: Schedule, *, keeps: bool) -> None:
        self._registry = registry
        self._queues = queues
        self._schedule = schedule
        self._keeps = keeps

    def restore(self, kept: Sequence[KeptFence]) -> None:
        """Add the fences that the storage has kept."""
        self._queues.add_fences(bring_back(kept, self._registry))
        for fence in self._registry.fences.values():
            self._schedule.plan_fence(fence)

    # Trips

    def trip(self, queues: Sequence[Queue], requests: list[Request], now: float, pause: float) -> Trip:
        """A trip on hulls with fences, or one that gives them a fence."""
        quiet = self._quiet_trip(queues, requests, now, pause)
        if quiet is not None:
            return quiet
        names: dict[str, None] = {}
        fences: dict[str, Fence | None] = {}
        numbers: dict[str, int] = {}
        births: set[str] = set()
        for request in requests:
            if type(request) is WriteBatch:  # as a rule
                names[request.write.name] = None
                if request.birth is not None:
                    births.add(request.write.name)
            elif isinstance(request, FenceRequest):
                fences[request.name] = self._registry.fences.get(request.name)
                names |= dict.fromkeys(request.names[1:])
                if isinstance(request, CreateFence):
                    self._reserve(request, numbers)
            else:
                names |= dict.fromkeys(names_of(request))
                if isinstance(request, CreateHull):
                    births.add(request.name)
        hulls = self._registry.hulls
        places = {name: self._registry.reserve_hull() for name in sorted(births) if name not in hulls}
        legs = {name: Leg(name, hulls.get(name), keeps=self._keeps, fenced=True) for name in names}
        lines = [queue.line for queue in queues if queue.line is not None]
        watched = sum([_watches(request) for request in requests if isinstance(request, CreateFence)]) if numbers else 0
        watched += sum([line.watches_new(name) for line in lines for name in places]) if places else 0
        room = self._registry.reserve_watched(watched)
        ground = Ground(legs, lines, fences, numbers, self._registry.tallies, self._registry.limits.fences, room)
        return Trip(legs, requests, now, pause, places, FencePart(ground, requests))

    def quiet_hull(self, line: Line, request: Request) -> Hull | None:
        """The hull of a batch that needs no trip unless an alarm has something to say; None if it may need one."""
        if type(request) is not WriteBatch or not line.has_only_alarms:
            return None
        hull: Hull | None = self._registry.hulls.get(request.name)
        if hull is None or hull.state.contents.clock is not None or line.weight(hull.name) > QUIET_WEIGHT:
            return None
        return hull

    def _quiet_trip(self, queues: Sequence[Queue], requests: list[Request], now: float, pause: float) -> Trip | None:
        """A trip of batches to hulls with alarms alone, which gets a part for these once one is touched; else None."""
        line, hulls = queues[0].line, self._registry.hulls
        if line is None or len(queues) > 1 or not line.has_only_alarms:
            return None
        names = [request.write.name for request in requests if type(request) is WriteBatch]
        if len(names) < len(requests):
            return None
        legs: dict[str, Leg] = {}
        weight = 0
        for name in dict.fromkeys(names):
            hull = hulls.get(name)
            if hull is None:
                return None
            weight += line.weight(name)
            legs[name] = Leg(name, hull, keeps=self._keeps)
        if weight > QUIET_WEIGHT:
            return None
        trip = Trip(legs, requests, now, pause, {})
        trip.quiet = Quiet(line, self._quiet_part)
        return trip

    def _quiet_part(self, line: Line, trip: Trip) -> FencePart:
        registry = self._registry
        return FencePart(Ground(trip.legs, [line], {}, {}, registry.tallies, registry.limits.fences), trip.requests)

    def _reserve(self, request: CreateFence, numbers: dict[str, int]) -> None:
        number = self._registry.reserve_fence(alarm=request.config.rule is not None)
        if number is not None:
            numbers[request.name] = number
        if request.config.kind == "prefix" and request.name not in self._registry.fences:
            self._queues.reserve_prefix(request.name, request.config.subjects)

    def ran(self, part: FencePart) -> None:
        """Let the requests that a trip has left wait before the others."""
        if not part.creates:  # new hulls are counted from now on
            self._leave_room(part)
        for request in reversed(part.left):
            if not request.abandoned:
                for queue in self._queues.at(request.names):
                    queue.waiting.insert(0, request)

    def over(self, trip: Trip, part: FencePart) -> None:
        """Give back what the trip has reserved, and plan the times of its fences."""
        if part.creates:
            self._queues.end_creation(trip, part)
            self._registry.give_back(0, part.creates)
        self._leave_room(part)
        looked_at = [request.fence for request in trip.requests if isinstance(request, PassTime)]  # perhaps too early
        for fence in (*[leg.fence for leg in part.legs.values()], *looked_at):
            if self._registry.fences.get(fence.name) is fence:
                self._schedule.plan_fence(fence)

    def _leave_room(self, part: FencePart) -> None:
        if part.room:
            self._registry.give_back(0, watched=part.room)
            part.room = 0

    # Commits

    def keep(self, trip: Trip, part: FencePart, effects: list[Effect]) -> None:
        """Publish what a trip has committed of fences, and join or part the queues."""
        events, to_wake = part.events, []
        if part.crossed is not None:
            self._registry.tallies.take(part.crossed)
        legs = part.legs.values()
        moved = any(leg.area is not leg.fence.area for leg in legs)
        part.dismiss_deleted()
        for leg in legs:
            fence = leg.fence
            if leg.created:
                self._registry.add_fence(fence)
                for subjects in fence.subjects.values():
                    subjects.fences[fence.number] = fence
            changed = leg.row is not fence.row
            leg.publish()
            if leg.deleted:
                self._queues.free_prefix(fence.name)
                for subjects in fence.subjects.values():
                    subjects.dropped(fence)
            if leg.events or changed:
                to_wake.append(fence)
        if events is not None:
            self._registry.recent.add(events, len(self._registry.fences))
        self._registry.remove_fences([leg.fence for leg in legs if leg.deleted])
        if to_wake or events is not None:
            effects.append(WakeFences(to_wake, events))
        if part.structural:
            self._queues.rejoin(trip, part, moved=moved)

    def examine(self, trip: Trip, part: FencePart, effect: Examine) -> None:
        """Let the storage be examined for the fences that a trip concerns, too."""
        part.examined, effect.restore = reading(trip, part)
        effect.fences = part.examined

    def give_back(self, trip: Trip, part: FencePart, restored: Restored | None) -> None:
        """Return fences to what the storage has of them: the changes of the trip were not committed."""
        assert restored is not None  # so it says, too
        give_back(part, restored, self._registry)
        self._queues.renew(trip, part)

    # Time

    def begin(self, now: int) -> None:
        """Hear what time it is at the start."""
        for fence in self._registry.alarms.values():
            if fence.watched is not None:
                fence.watched.begin(now)
                self._schedule.plan_fence(fence)

    def due(self, fence: Fence, time: int, to: Any) -> PassTime | None:
        """The request for the events of those who have been inside of a fence for long enough; None if nobody has."""
        due = fence.next_due
        if due is None or due > time:
            self._schedule.plan_fence(fence)
            return None
        # It is looked at again even if the request is refused, because the storage cannot be read.
        self._schedule.look_again(fence, time)
        return PassTime(to, fence.name, time, fence, rows=min(fence.waiting, MOST_DUE))


def _watches(request: CreateFence) -> int:
    """The number of hulls that a fence watches if it is an alarm, at most."""
    config = request.config
    if config.rule is None:
        return 0
    return sum(map(config.compares, request.names[1:])) if config.kind == "prefix" else 1
