"""The core of the server: names, the queue of each hull, and the outcome of commits. `step(event) -> effects`.

It is synchronous and pure: no threads, clocks or I/O. The driver passes in one event at a time, and carries out the
effects after the step.

Each name has a queue. The requests that wait in it make one *trip* together: they run in order of arrival, their
changes are committed in one transaction, and their callers are answered only after the commit. Requests that arrive
during a commit therefore share the next one, and no reader sees a change that could be undone. A queue has one trip at
a time. The trip belongs to the server: when a caller disconnects, it is not answered, and nothing else changes.

A request to several hulls waits in all of their queues, and begins when it is the first in each of them: then one trip
occupies all of these queues. It enters the queues in one step, so any two such requests are in the same order wherever
they meet, and there is no deadlock.

The hulls that a fence depends on share one queue, so that what a change of one means for the fence is known before the
next change of any, and is committed with it. Creating and deleting a fence joins and parts queues, in a step in which
none of them has a trip.
"""

from functools import partial
from heapq import heappop, heappush
from typing import TYPE_CHECKING, Any

from sortedcontainers import SortedDict

from .errors import (
    DiskFullError,
    FenceNotFoundError,
    HullNotFoundError,
    LimitExceededError,
    NotStoredError,
    OutcomeUnknownError,
    StoppingError,
    words,
)
from .events import (
    Arrived,
    Commit,
    Committed,
    Compute,
    Computed,
    CreateHull,
    DeleteHull,
    Effect,
    Event,
    Examine,
    Examined,
    Expire,
    Failed,
    Gone,
    NotExamined,
    ReadHull,
    ReadTogether,
    Recenter,
    Reply,
    Request,
    Retried,
    Retry,
    Stir,
    Stopping,
    Tick,
    Together,
    WriteBatch,
    WriteTogether,
)
from .fences.fence import Fence
from .fences.line import Line
from .fences.line_trip import MOST_DUE, Ground, LineTrip
from .fences.pair import Pair
from .fences.queues import SPANNING, components, depends_on, merged
from .fences.recent import RecentEvents
from .fences.requests import (
    PREFIX,
    STRUCTURAL,
    CreateFence,
    DeleteFence,
    DropConsumer,
    DropEvents,
    FenceRequest,
    PassTime,
    PutConsumer,
    ReadFence,
    ReplaceFence,
)
from .fences.restoring import Restored, restore
from .fences.subjects import Subjects
from .hull import Hull
from .hull_state import HullState
from .limits import Limits
from .records import DEFAULT, NO_TIME, Append, HullRow, Kept, Record
from .trip import Leg, Place, Trip, write

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from .fences.records import KeptFence

# A request for at most this many points runs at once: a tenth of a millisecond. It holds the GIL anyway.
SMALL = 128
# Small requests for at most this many points together run at once, too: a thread would begin them later than that.
SMALL_TRIP = 1024
# The most points that the requests of one trip read or write together, unless a single request exceeds it.
TRIP_ROWS = 2**18
# The most fences that one trip creates or deletes, and the most corners of their areas, unless one alone has more.
FENCES_TOGETHER, CORNERS_TOGETHER = 64, 2**14
# Seconds before the storage is examined again: at first, and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0
# Microseconds before those who have been inside of a fence for long are looked at again.
LOOK_AGAIN = 1_000_000
READS = ReadHull | ReadTogether | ReadFence


class _Queue:
    """The work of one name, or of all hulls and fences of a line.

    Attributes:
        name: the name, or one of those of the line.
        hull: the committed hull of that name, or None. None for a line.
        line: the fences of several hulls that share the queue, or None.
        guests: names that begin with the prefix of a fence, and have no hull so far; None for none.
        trip: the trip in progress, or None.
        waiting: the requests for later trips. While there is no trip, the first one waits in other queues, too.
    """

    __slots__ = ("guests", "hull", "line", "name", "trip", "waiting")

    def __init__(self, name: str, hull: Hull | None = None, line: Line | None = None) -> None:
        self.name = name
        self.hull = hull
        self.line = line
        self.guests: set[str] | None = None
        self.trip: Trip | None = None
        self.waiting: list[Request] = []

    @property
    def ill(self) -> Exception | None:
        """Why the storage cannot be read after a failed commit, None unless that is so."""
        return None if self.trip is None else self.trip.ill


class Core:
    """All names of a server.

    Args:
        limits: the limits on the state.
        next_number: a number greater than that of any hull ever created.
        now: seconds on a monotonic clock.
        immediate: whether a Commit is complete once carried out, and cannot fail: no Committed or Failed follows it.
        keeps: whether the storage keeps batches.
    """

    def __init__(
        self,
        limits: Limits,
        next_number: int = 1,
        now: float = 0.0,
        *,
        immediate: bool = False,
        keeps: bool = True,
    ) -> None:
        self._limits = limits
        self._immediate = immediate
        self._keeps = keeps
        self._next_number = next_number
        self._now = now
        self._queues: dict[str, _Queue] = {}
        self._hulls: SortedDict[str, Hull] = SortedDict()
        self._fences: SortedDict[str, Fence] = SortedDict()
        # The prefixes of fences, by the names of their queues; also of those that are being created.
        self._prefixes: dict[str, str] = {}
        self._recent = RecentEvents(limits.fences.fence_history_bytes)
        self._creating = self._fencing = 0
        self._first_order = self._last_order = 0
        self._trips = 0
        self._stopping = False
        # A heap of the times at which points leave, with the number and name of the hull, and of those at which
        # subjects have been inside of a fence for long, with its number and the name of its queue. An entry is
        # outdated if its time is not that of the plan of the hull or fence.
        self._due: list[tuple[int, int, str]] = []
        self._handlers: dict[type, Callable[[Any, list[Effect]], None]] = {
            WriteBatch: self._asked,
            Arrived: self._arrived,
            WriteTogether: self._asked_together,
            ReadHull: self._asked,
            ReadTogether: self._asked_together,
            CreateHull: self._asked,
            DeleteHull: self._asked,
            Recenter: self._asked,
            CreateFence: self._asked_of_fence,
            ReplaceFence: self._asked_of_fence,
            DeleteFence: self._asked_of_fence,
            ReadFence: self._asked_of_fence,
            PutConsumer: self._asked_of_fence,
            DropConsumer: self._asked_of_fence,
            DropEvents: self._asked_of_fence,
            PassTime: self._asked_of_fence,
            Gone: self._gone,
            Computed: self._computed,
            Committed: self._committed,
            Failed: self._failed,
            Examined: self._examined,
            NotExamined: self._not_examined,
            Retried: self._retried,
            Tick: self._tick,
            Stopping: self._stop,
        }

    def step(self, event: Event) -> list[Effect]:
        """Process an event. Carry out the returned effects in order, before the next step."""
        effects: list[Effect] = []
        self._handlers[type(event)](event, effects)
        return effects

    def check(self) -> None:
        """Raise AssertionError if names share queues otherwise than the fences demand. No trip is in progress.

        O(hulls and fences).
        """
        names = [*self._hulls, *(PREFIX + name for name in self._fences)]
        for group, fences in components(names, self._fences.values()):
            queue = self._queues[group[0]]
            assert all(self._queues[name] is queue for name in group), group
            if queue.line is None:
                assert not fences, group
                assert queue.name == group[0], group
                continue
            line, anew = queue.line, Line(fences, group)
            assert queue.name in line.names, group
            assert anew.names.keys() <= line.names.keys(), group
            assert all(self._queues.get(name) is queue for name in line.names), line.names
            assert line.fences == anew.fences, group
            assert line.subjects == anew.subjects, group
            assert {name: set(each) for name, each in line.pairs.items() if each} == {
                name: set(each) for name, each in anew.pairs.items()
            }, group
            assert {name: each.fences for name, each in line.areas.items()} == {
                name: each.fences for name, each in anew.areas.items()
            }, group

    # Committed state

    @property
    def hulls(self) -> "SortedDict[str, Hull]":
        """The hulls by name."""
        return self._hulls

    @property
    def latest_time(self) -> int | None:
        """The latest time of the server's clock that a hull has recorded, None if there is none. O(hulls)."""
        clocks = [hull.counts.clock for hull in self._hulls.values() if hull.state.contents.follows_server]
        clocks += [fence.time for fence in self._fences.values() if fence.time != NO_TIME]
        return max((clock for clock in clocks if clock is not None), default=None)

    def get(self, name: str) -> Hull:
        """The hull of that name, or raise HullNotFoundError."""
        hull: Hull | None = self._hulls.get(name)
        if hull is None:
            raise HullNotFoundError(name)
        return hull

    @property
    def fences(self) -> "SortedDict[str, Fence]":
        """The fences by name."""
        return self._fences

    def fence(self, name: str) -> Fence:
        """The fence of that name, or raise FenceNotFoundError."""
        fence: Fence | None = self._fences.get(name)
        if fence is None:
            raise FenceNotFoundError(name)
        return fence

    def line(self, name: str) -> Line | None:
        """The fences of a hull, and of those that share its queue; None for a hull without fences."""
        queue = self._queues.get(name)
        return None if queue is None else queue.line

    def idle(self, hull: Hull) -> bool:
        """Whether a small read of a hull needs no request, because nothing goes on in its queue."""
        queue = self._queues.get(hull.name)
        return queue is not None and queue.trip is None and not (queue.waiting or self._stopping or hull.ended)

    @property
    def busy(self) -> bool:
        """Whether any trip is in progress."""
        return self._trips > 0

    @property
    def ill(self) -> bool:
        """Whether the state of any name is unknown, because the storage cannot be read."""
        return any(queue.ill is not None for queue in self._queues.values())

    def expiring(self, time: int) -> bool:
        """Whether points are about to leave, or should have left by a time. O(hulls)."""
        if self._due and self._due[0][0] <= time:
            return True
        for queue in self._queues.values():
            requests = queue.waiting if queue.trip is None else [*queue.waiting, *queue.trip.requests]
            if any(isinstance(request, Expire | PassTime) for request in requests):
                return True
        return False

    def restore(self, row: HullRow, state: HullState, unsaved: int) -> None:
        """Add a hull that the storage has kept. Call this before the first step."""
        hull = self._hulls[row.name] = Hull(row, state, unsaved)
        self._queues[row.name] = _Queue(row.name, hull)
        self._plan(hull)

    def restore_fences(self, kept: "Sequence[KeptFence]") -> None:
        """Add the fences that the storage has kept. Call this after `restore`, and before the first step."""
        subjects: dict[str, Subjects] = {}
        for each in kept:
            fence = Fence(each.row)
            fence.restored(each)
            config = each.row.config
            fence.area = None if config.area_hull is None else self.get(config.area_hull)
            if config.kind == "prefix":
                self._prefixes[PREFIX + fence.name] = config.subjects
            if config.kind == "other" and fence.area is not None:
                fence.pair = Pair(fence.area, self.get(config.subjects), config.near)
            for name in self._compared(fence):
                if name not in subjects:
                    subjects[name] = Subjects(self.get(name))
                subjects[name].fences[fence.number] = fence
                fence.subjects[name] = subjects[name]
            self._fences[fence.name] = fence
        self._adopt(restore(subjects.values(), {}, {each.row.number: each for each in kept}), subjects)
        queues = list(self._queues.values()) + [self._queue(PREFIX + each.row.name) for each in kept]
        self._regroup(queues, self._fences.values())
        for fence in self._fences.values():
            if fence.pair is not None:
                fence.pair.look()
                fence.count_inside()
            self._plan_fence(fence)

    # Requests

    def _asked(
        self, request: CreateHull | DeleteHull | Expire | ReadHull | Recenter | WriteBatch, effects: list[Effect]
    ) -> None:
        name = request.hull.name if type(request) is ReadHull else request.name  # type: ignore[union-attr]
        queue = self._queues.get(name) or self._queue(name)
        if queue.trip is None and not queue.waiting and not self._stopping and not request.abandoned:
            if request.rows <= SMALL and type(request) is ReadHull:
                self._read(queue, request)
                effects.append(Reply([request]))
            elif self._immediate and queue.hull is not None and request.rows <= SMALL and type(request) is WriteBatch:
                self._write(queue, queue.hull, request, effects)
            else:
                self._begin([queue], [request], request.rows, effects)
                if queue.hull is None:
                    self._rest(queue)
            return
        queue.waiting.append(request)
        self._go_on([queue], effects)

    def _arrived(self, event: Arrived, effects: list[Effect]) -> None:
        queue = self._queue(event.batches[0].name)
        queue.waiting += event.batches
        self._go_on([queue], effects)

    def _asked_together(self, request: Together, effects: list[Effect]) -> None:
        self._wait([self._queue(part.name) for part in request.parts], request, effects)

    def _asked_of_fence(self, request: FenceRequest, effects: list[Effect]) -> None:
        request.names = self._involved(request)
        self._wait([self._queue(name) for name in request.names], request, effects)

    def _wait(self, queues: "list[_Queue]", request: SPANNING, effects: list[Effect]) -> None:
        queues = list(dict.fromkeys(queues))
        self._last_order += 1
        request.order = self._last_order
        for queue in queues:
            queue.waiting.append(request)
        self._go_on(queues, effects)

    def _involved(self, request: FenceRequest) -> tuple[str, ...]:
        """The names of the queues of a request about a fence."""
        names = [PREFIX + request.name]
        if isinstance(request, CreateFence | ReplaceFence):
            config = request.config
            if config.area_hull is not None:
                names.append(config.area_hull)
            if config.kind != "prefix":
                names.append(config.subjects)
            elif isinstance(request, CreateFence):
                names += self._overlapping(config.subjects)
        return tuple(names)

    def _overlapping(self, prefix: str) -> list[str]:
        """The names of queues that a fence with this prefix joins: of hulls with it, and of fences that meet it."""
        meets = [name for name, each in self._prefixes.items() if each.startswith(prefix) or prefix.startswith(each)]
        return meets + [name for name in self._queues if name.startswith(prefix) and not name.startswith(PREFIX)]

    def _compared(self, fence: Fence) -> list[str]:
        """The names of the hulls whose keys a fence compares."""
        config = fence.row.config
        if config.kind != "prefix":
            return [config.subjects] if config.kind == "hull" else []
        names = [name for name in self._hulls.irange(config.subjects) if name.startswith(config.subjects)]
        return [name for name in names if self._hulls[name].row.settings.identity != "multiset"]

    def _queue(self, name: str) -> _Queue:
        queue = self._queues.get(name)
        if queue is None:
            queue = self._queues[name] = self._line_queue(name) or _Queue(name)
        return queue

    def _line_queue(self, name: str) -> _Queue | None:
        """The queue of a fence whose prefix a new name has; None if there is none."""
        for key, prefix in self._prefixes.items():
            if name.startswith(prefix):
                queue = self._queues[key]
                queue.guests = (queue.guests or set()) | {name}
                return queue
        return None

    def _read(self, queue: _Queue, request: ReadHull) -> None:
        """Run a small read. It needs no trip while the queue is idle."""
        hull = queue.hull
        if hull is None:  # perhaps one of a line
            hull = self._hulls.get(request.hull.name)
        if hull is None or hull is not request.hull:
            request.error = HullNotFoundError(request.hull.name)
            self._rest(queue)
            return
        try:
            request.result = hull.counts, request.function(hull.state)
        except Exception as error:  # any error is the answer to the caller
            request.error = error

    def _write(self, queue: _Queue, hull: Hull, request: WriteBatch, effects: list[Effect]) -> None:
        """Apply a small batch to an existing hull. It needs no trip where commits are immediate, as in memory."""
        if request.stream is not None and request.stream.stopped:
            return
        records: list[Record] | None = [] if self._keeps else None
        applied = write(request, hull, self._now, records)
        if applied is not None:
            if records:
                effects.append(Commit(None, [Append(hull.row.number, records)]))
            hull.counts = hull.state.counts
            effects.append(Reply([request], () if applied.duplicate else (hull,)))
            if hull.timed:
                self._plan(hull)
        elif hull.state.torn:
            trip = self._new_trip([queue], [request])
            trip.torn = True
            self._ran(trip, effects)
        else:
            effects.append(Reply([request]))

    def _gone(self, event: Gone, effects: list[Effect]) -> None:
        event.what.leave()
        if isinstance(event.what, SPANNING):
            self._go_on(self._remove(event.what), effects)

    def _remove(self, request: SPANNING) -> list[_Queue]:
        """Remove a request from the queues where it waits. Returns these queues: they may go on without it."""
        queues = dict.fromkeys(self._queues[name] for name in _names(request) if name in self._queues)
        left = [queue for queue in queues if request in queue.waiting]
        for queue in left:
            queue.waiting.remove(request)
        return left

    def _go_on(self, queues: "Iterable[_Queue]", effects: list[Effect]) -> None:
        """Begin trips for the waiting requests of these queues, until no queue can begin one."""
        left = list(queues)
        while left:
            queue = left.pop()
            if queue.waiting and (queue.ill is not None or (self._stopping and queue.trip is None)):
                error = StoppingError() if queue.ill is None else _ill(queue.ill)
                left += self._refuse_waiting(queue, error, effects)
            while queue.trip is None and queue.waiting:
                first = queue.waiting[0]
                if isinstance(first, CreateFence) and first.config.kind == "prefix":
                    left += self._complete(first)
                together = self._at(_names(first)) if isinstance(first, SPANNING) else [queue]
                if not all(each.trip is None and each.waiting and each.waiting[0] is first for each in together):
                    break  # the last of these queues that comes so far begins it
                requests, rows = self._taken(together)
                if requests:
                    trip = self._begin(together, requests, rows, effects)
                    left += [each for each in trip.queues if each is not queue]
            self._rest(queue)

    def _complete(self, request: CreateFence) -> list[_Queue]:
        """Let a request wait in queues that it joins and that are newer. Returns these queues.

        Once it is the first in its older queues, it becomes the first there: so it is everywhere in front of requests
        that wait behind it anywhere.
        """
        if not all(queue.waiting and queue.waiting[0] is request for queue in self._at(request.names)):
            return []
        names = [name for name in self._overlapping(request.config.subjects) if name not in request.names]
        queues = [queue for queue in self._at(names) if request not in queue.waiting]
        if queues:
            self._first_order -= 1
            request.order = self._first_order
        for queue in queues:
            queue.waiting.insert(0, request)
        request.names += tuple(names)
        return queues

    def _taken(self, queues: list[_Queue]) -> tuple[list[Request], int]:
        """The requests of the next trip to these queues, and their points."""
        if len(queues) == 1:
            queue = queues[0]
            return _take(queue, lambda request: len(self._at(_names(request))) > 1)
        if isinstance(queues[0].waiting[0], CreateFence):
            return self._taken_creations(queues, queues[0].waiting[0])
        if isinstance(queues[0].waiting[0], FenceRequest) or any(queue.line is not None for queue in queues):
            requests = [queue.waiting.pop(0) for queue in queues][:1]
            return requests, requests[0].rows
        return _take_together(queues)

    def _taken_creations(self, queues: list[_Queue], first: CreateFence) -> tuple[list[Request], int]:
        """A request to create a fence, and those behind it that create others around the same hulls.

        The queues of the others are added to `queues`.
        """
        taken: list[CreateFence] = []
        own, *shared = self._at(first.names)
        corners, following = 0, first
        while True:
            taken.append(following)
            corners += following.config.corners
            for queue in self._at(following.names):
                del queue.waiting[0]
            if own.line is not None or first.config.kind == "prefix" or len(taken) == FENCES_TOGETHER:
                break
            candidate = shared[0].waiting[0] if shared[0].waiting else None
            if not isinstance(candidate, CreateFence) or candidate.config.kind == "prefix":
                break
            following, (its_own, *others) = candidate, self._at(candidate.names)
            if its_own in queues or its_own.line is not None or its_own.trip is not None or set(others) != set(shared):
                break
            if any(not queue.waiting or queue.waiting[0] is not candidate for queue in (its_own, *others)):
                break
            if corners + candidate.config.corners > CORNERS_TOGETHER:
                break
            queues.append(its_own)
        return list(taken), max(request.rows for request in taken)

    def _begin(self, queues: list[_Queue], requests: list[Request], rows: int, effects: list[Effect]) -> Trip:
        trip = self._new_trip(queues, requests)
        if isinstance(trip, LineTrip):
            rows = max(rows, trip.weight)
        if rows > SMALL_TRIP or (rows > SMALL and any(request.rows > SMALL for request in requests)):
            effects.append(Compute(trip))
            return trip
        trip.run()
        self._ran(trip, effects)
        return trip

    def _new_trip(self, queues: list[_Queue], requests: list[Request]) -> Trip:
        if all(queue.line is None for queue in queues) and not isinstance(requests[0], FenceRequest):
            place = None
            if queues[0].hull is None and len(queues) == 1:
                place = Place(self._next_number, self._no_more_hulls(), self._limits)
                self._next_number += 1
                self._creating += 1
            legs = [Leg(queue.name, queue.hull, keeps=self._keeps) for queue in queues]
            trip = Trip(legs, requests, self._now, FIRST_PAUSE, place)
        else:
            trip = self._line_trip(queues, requests)
        trip.queues = queues
        for queue in queues:
            queue.trip = trip
        self._trips += 1
        return trip

    def _no_more_hulls(self) -> Exception | None:
        most = self._limits.max_hulls
        return LimitExceededError("max_hulls", most) if len(self._hulls) + self._creating >= most else None

    def _at(self, names: "Iterable[str]") -> list[_Queue]:
        """The queues of these names."""
        return list(dict.fromkeys(self._queues[name] for name in names))

    def _computed(self, event: Computed, effects: list[Effect]) -> None:
        trip = event.ticket
        self._ran(trip, effects)
        self._go_on(trip.queues, effects)

    def _ran(self, trip: Trip, effects: list[Effect]) -> None:
        if isinstance(trip, LineTrip) and trip.left:
            for request in reversed(trip.left):
                if not request.abandoned:
                    for queue in self._at(_names(request)):
                        queue.waiting.insert(0, request)
        if trip.torn:
            self._fail(trip, MemoryError("a batch was applied in part"), effects)
            return
        changes = trip.changes()
        if changes:
            effects.append(Commit(None if self._immediate else trip, changes))
            if not self._immediate:
                return
        elif not trip.applied:
            self._end(trip, effects, ())
            return
        self._keep(trip, effects)

    def _end(self, trip: Trip, effects: list[Effect], moved: tuple[Hull, ...]) -> None:
        """Complete the trip: answer its callers."""
        requests = trip.requests
        if len(requests) != 1 or requests[0].abandoned:
            requests = [request for request in requests if not request.abandoned]
        effects.append(Reply(requests, moved))
        self._over(trip)

    def _over(self, trip: Trip) -> None:
        self._trips -= 1
        if trip.place is not None:
            self._creating -= 1
        if isinstance(trip, LineTrip):
            if trip.creates:
                self._end_creation(trip)
            self._fencing -= trip.creates
            self._creating -= len(trip.places)
        for queue in trip.queues:
            queue.trip = None
            if queue.hull is not None:
                self._plan(queue.hull)
            elif queue.line is not None:
                for leg in trip.legs:
                    if leg.name in self._hulls:
                        self._plan(self._hulls[leg.name])
        if isinstance(trip, LineTrip):
            for each in trip.fence_legs.values():
                if self._fences.get(each.fence.name) is each.fence:
                    self._plan_fence(each.fence)

    def _rest(self, queue: _Queue) -> None:
        """Remove the queue of a name that has neither a hull nor work."""
        if queue.hull is not None or queue.trip is not None or queue.waiting:
            return
        if queue.line is not None:
            if queue.guests is not None:
                self._dismiss_guests(queue, queue.line, queue.guests)
            return
        if self._queues.get(queue.name) is queue:  # it has not become part of a line
            del self._queues[queue.name]

    def _dismiss_guests(self, queue: _Queue, line: Line, guests: set[str]) -> None:
        """Forget the names without a hull; the others stay."""
        queue.guests = None
        for name in guests:
            if name in self._hulls:
                line.names[name] = None
            else:
                line.names.pop(name, None)
                del self._queues[name]

    # Commits

    def _committed(self, event: Committed, effects: list[Effect]) -> None:
        trip = event.ticket
        self._keep(trip, effects)
        self._go_on(trip.queues, effects)

    def _keep(self, trip: Trip, effects: list[Effect]) -> None:
        """Publish the changes of the trip, which are committed: those of all its hulls in one step."""
        moved = []
        for leg in trip.legs:
            before, after = leg.before, leg.after
            if after is not None:
                after.counts = after.state.counts
                after.unsaved += leg.unsaved
            if after is not before:
                queue = self._queues[leg.name]
                if queue.line is None:
                    queue.hull = after
                else:
                    queue.guests = (queue.guests or set()) | {leg.name}
                if before is not None:
                    before.ended = True
                    del self._hulls[leg.name]
                if after is not None:
                    self._hulls[leg.name] = after
            hull = after or before
            if hull is not None:
                moved.append(hull)
        if isinstance(trip, LineTrip):
            self._keep_fences(trip, effects)
        self._end(trip, effects, tuple(moved))

    def _failed(self, event: Failed, effects: list[Effect]) -> None:
        trip = event.ticket
        if event.unknown:
            trip.failure, trip.unknown = event.error, True
            self._examine(trip, effects)
            return
        self._fail(trip, event.error, effects)
        self._go_on(trip.queues, effects)

    def _fail(self, trip: Trip, error: Exception, effects: list[Effect]) -> None:
        """Handle a trip whose changes were not committed."""
        trip.failure = error
        self._refuse_changes(trip, _not_stored(error), effects)
        if trip.place is None and (trip.applied or trip.torn):
            self._examine(trip, effects)  # the states in memory include the batches
        else:
            if isinstance(trip, LineTrip):
                trip.undo_created()
            self._again(trip)

    def _refuse_changes(self, trip: Trip, error: Exception, effects: list[Effect]) -> None:
        """Refuse the changes of the trip, and stop the streams that sent them."""
        refused: list[Request] = []
        streams: set[int] = set()
        for request in trip.requests:
            if isinstance(request, READS):
                continue
            stream = request.stream if type(request) is WriteBatch else None
            answered = stream is not None and id(stream) in streams
            if not request.abandoned and not answered:
                request.result, request.error = None, error
                refused.append(request)
            request.abandoned = True
            if stream is not None:
                stream.stopped = True
                streams.add(id(stream))
        effects.append(Reply(refused))

    def _again(self, trip: Trip) -> None:
        """Repeat the reads of a trip whose changes were not committed."""
        reads = [request for request in trip.requests if isinstance(request, READS) and not request.abandoned]
        for request in reads:
            request.result = request.error = None
        self._over(trip)
        self._wait_again(trip, reads)

    def _wait_again(self, trip: Trip, requests: "Sequence[Request]") -> None:
        """Put requests of a trip before those that wait in its queues."""
        for queue in trip.queues:
            queue.waiting[:0] = requests

    # Examination of the storage

    def _examine(self, trip: Trip, effects: list[Effect]) -> None:
        hulls: list[tuple[int, Callable[[Kept], HullState]]] = []
        for leg in trip.legs:
            hull = leg.before or leg.after
            number, settings = (0, DEFAULT) if hull is None else (hull.row.number, hull.row.settings)
            hulls.append((number, partial(HullState, self._limits, settings, now=self._now)))
        if isinstance(trip, LineTrip):
            self._examine_fences(trip, hulls, effects)
        else:
            effects.append(Examine(trip, hulls))

    def _under_way(self, trip: Trip) -> bool:
        """Whether a trip is in progress; False where the server is stopping and did not wait for it."""
        return trip.queues[0].trip is trip

    def _examined(self, event: Examined, effects: list[Effect]) -> None:
        trip = event.ticket
        if not self._under_way(trip):
            return
        found = list(zip(trip.legs, event.states, strict=True))
        if trip.unknown and trip.landed(event.states, event.fences):
            self._keep(trip, effects)
        elif any(leg.before is not None and state is None for leg, state in found):
            self._not_examined(NotExamined(trip, LookupError("the hull is not in the storage")), effects)
        else:
            for leg, state in found:
                if leg.before is not None and state is not None:
                    leg.before.state = state
            if isinstance(trip, LineTrip):
                self._restore_fences(trip, event)
            assert trip.failure is not None  # a trip is examined only after a failure
            if trip.unknown:
                self._refuse_changes(trip, _not_stored(trip.failure), effects)
            self._again(trip)
        self._go_on(trip.queues, effects)

    def _not_examined(self, event: NotExamined, effects: list[Effect]) -> None:
        trip = event.ticket
        if not self._under_way(trip):
            return
        trip.ill = event.error
        if trip.unknown:
            self._refuse_changes(trip, OutcomeUnknownError(words(event.error)), effects)
        self._wait_again(trip, [request for request in trip.requests if not request.abandoned])
        trip.requests = []
        if self._stopping:
            self._over(trip)  # the next start reads the outcome from the storage
        else:
            effects.append(Retry(trip, trip.pause, event.error))
            trip.pause = min(2 * trip.pause, LONGEST_PAUSE)
        self._go_on(trip.queues, effects)

    def _retried(self, event: Retried, effects: list[Effect]) -> None:
        if self._under_way(event.ticket):
            self._examine(event.ticket, effects)

    def _refuse_waiting(self, queue: _Queue, error: Exception, effects: list[Effect]) -> list[_Queue]:
        """Refuse the waiting requests. Returns the other queues in which some of them waited."""
        waiting, queue.waiting = queue.waiting, []
        refused: list[Request] = []
        others: list[_Queue] = []
        for request in waiting:
            stream = request.stream if type(request) is WriteBatch else None
            if request.abandoned or (stream is not None and stream.stopped):
                continue
            if stream is not None:
                stream.stopped = True
            request.error = error
            refused.append(request)
            if isinstance(request, SPANNING):
                others += self._remove(request)
        effects.append(Reply(refused))
        return others

    # Fences

    def _line_trip(self, queues: list[_Queue], requests: list[Request]) -> LineTrip:
        """A trip on hulls with fences, or one that gives them a fence."""
        lines = [queue.line for queue in queues if queue.line is not None]
        names: dict[str, None] = {}
        fences: dict[str, Fence | None] = {}
        for request in requests:
            if isinstance(request, FenceRequest):
                fences[request.name] = self._fences.get(request.name)
                names |= dict.fromkeys(request.names[1:])
            else:
                names |= dict.fromkeys(_names(request))
        numbers: dict[str, int] = {}
        for request in requests:
            if isinstance(request, CreateFence):
                self._fencing += 1
                if len(self._fences) + self._fencing <= self._limits.fences.max_fences:
                    numbers[request.name] = self._next_number
                    self._next_number += 1
                if request.config.kind == "prefix" and request.name not in self._fences:
                    self._prefixes.setdefault(PREFIX + request.name, request.config.subjects)
        births = {
            name
            for request in requests
            if isinstance(request, CreateHull | WriteBatch) and request.birth is not None
            for name in _names(request)
            if name not in self._hulls
        }
        places: dict[str, Place] = {}
        for name in sorted(births):
            places[name] = Place(self._next_number, self._no_more_hulls(), self._limits)
            self._next_number += 1
            self._creating += 1
        ground = Ground(lines, places, fences, numbers, self._limits.fences)
        legs = [Leg(name, self._hulls.get(name), keeps=self._keeps) for name in names]
        return LineTrip(legs, requests, self._now, FIRST_PAUSE, ground)

    def _end_creation(self, trip: LineTrip) -> None:
        """Forget the prefix of a fence that was not created after all."""
        for key in [key for key in self._prefixes if key.removeprefix(PREFIX) not in self._fences]:
            if any(queue.name == key for queue in trip.queues):
                del self._prefixes[key]
                fences = {fence.name: fence for line in trip.lines for fence in line.fences.values()}
                trip.queues = self._regroup(trip.queues, fences.values(), trip)

    def _keep_fences(self, trip: LineTrip, effects: list[Effect]) -> None:
        """Publish what a trip has committed of fences, and join or part the queues."""
        events = trip.events
        fences = {leg.fence.number: leg.fence for leg in trip.fence_legs.values()}
        stirred = []
        for fence, told in trip.log.fences():
            fences[fence.number] = fence
            fence.told(told)
            stirred.append(fence)
        moved = any(leg.area is not leg.fence.area for leg in trip.fence_legs.values())
        trip.dismiss()
        for leg in trip.fence_legs.values():
            fence = leg.fence
            if leg.created:
                self._fences[fence.name] = fence
                for subjects in fence.subjects.values():
                    subjects.fences[fence.number] = fence
            changed = leg.row is not fence.row
            leg.publish()
            if leg.deleted:
                del self._fences[fence.name]
                self._prefixes.pop(PREFIX + fence.name, None)
                for subjects in fence.subjects.values():
                    subjects.dropped(fence)
            if leg.events or changed:
                stirred.append(fence)
        if events is not None:
            of_runs = [fences[number] for number in events.fences.tolist()]
            self._recent.add(events, of_runs, len(self._fences))
        if stirred:
            effects.append(Stir(stirred, events))
        if trip.structural:
            self._rejoin(trip, moved=moved)

    def _rejoin(self, trip: LineTrip, *, moved: bool) -> None:
        """Join and part queues after fences were created or deleted, or have moved to the area of another hull."""
        created = [leg.fence for leg in trip.fence_legs.values() if leg.created]
        deleted = [leg.fence for leg in trip.fence_legs.values() if leg.deleted]
        if not (created or deleted or moved):
            return
        home = max(
            (queue for queue in trip.queues if queue.line is not None),
            key=lambda queue: len(queue.line.fences),
            default=None,
        )
        if home is not None and home.line is not None and not moved:
            if created and all(fence.row.config.kind != "prefix" for fence in created):
                self._join(trip, home, home.line, created)
                return
            if not created and len(deleted) < len(home.line.fences) and all(map(_is_leaf, deleted)):
                self._part(trip, home, home.line, deleted)
                return
        fences = {fence.name: fence for line in trip.lines for fence in line.fences.values() if not fence.ended}
        fences |= {fence.name: fence for fence in created}
        trip.queues = self._regroup(trip.queues, fences.values(), trip)

    def _join(self, trip: LineTrip, home: _Queue, line: Line, fences: list[Fence]) -> None:
        """Let the queues of the hulls that new fences depend on, all the same ones, become part of a line.

        O(names and fences of the other queues, and requests).
        """
        joined = self._at(name for fence in fences for name in (PREFIX + fence.name, *depends_on(fence)))
        waiting = merged([queue.waiting for queue in joined])
        for queue in joined:
            queue.waiting = []
            if queue is home:
                continue
            names = dict.fromkeys([queue.name]) if queue.line is None else queue.line.names
            for fence in () if queue.line is None else queue.line.fences.values():
                line.add(fence)
            if queue.guests is not None:
                home.guests = (home.guests or set()) | queue.guests
            line.names |= names
            self._queues |= dict.fromkeys(names, home)
        for fence in fences:
            line.add(fence)
        home.waiting = waiting
        trip.queues = [home, *(queue for queue in trip.queues if queue not in joined)]

    def _part(self, trip: LineTrip, home: _Queue, line: Line, fences: list[Fence]) -> None:
        """Take deleted fences from a line that stays together without them. O(fences and requests)."""
        parted = []
        for fence in fences:
            line.remove(fence)
            name = PREFIX + fence.name
            del line.names[name]
            queue = self._queues[name] = _Queue(name)
            queue.trip = trip
            parted.append(queue)
        home.name = next(iter(line.names))
        trip.queues = [home, *parted]
        waiting, home.waiting = home.waiting, []
        for request in waiting:
            for queue in self._at(_names(request)):
                if queue in trip.queues:  # in others it has never ceased to wait
                    queue.waiting.append(request)

    def _regroup(self, queues: list[_Queue], fences: "Iterable[Fence]", trip: Trip | None = None) -> list[_Queue]:
        """Make queues of these ones: one for all names that fences join, one for each other name.

        None of the queues has another trip. Their requests keep their order.
        """
        names = dict.fromkeys(
            name
            for queue in queues
            for name in (*([queue.name] if queue.line is None else queue.line.names), *(queue.guests or ()))
        )
        waiting = merged([queue.waiting for queue in queues])
        for queue in queues:
            queue.waiting = []
        made: list[_Queue] = []
        for group, of_group in components(list(names), fences):
            if of_group:
                queue = _Queue(PREFIX + of_group[0].name, line=Line(of_group, group))
                guests = {name for name in group if name not in self._hulls and not name.startswith(PREFIX)}
                queue.guests = guests or None
            else:
                (name,) = group
                queue = _Queue(name, self._hulls.get(name))
            queue.trip = trip
            made.append(queue)
            self._queues |= dict.fromkeys(group, queue)
        for request in waiting:
            for queue in self._at(_names(request)):
                if queue in made:  # in others it has never ceased to wait
                    queue.waiting.append(request)
        return made

    def _examine_fences(
        self, trip: LineTrip, hulls: "list[tuple[int, Callable[[Kept], HullState]]]", effects: list[Effect]
    ) -> None:
        """Read the fences that the trip concerns together with its hulls."""
        touched = trip.touched()
        numbers = sorted(
            {number for subjects in touched.values() for number in subjects.fences}
            | trip.fence_legs.keys()
            | trip.pairs()
        )

        def restored(states: "list[HullState | None]", kept: "list[KeptFence | None]") -> Restored | None:
            if trip.unknown and trip.landed(states, kept):
                return None
            stored = dict(zip(numbers, kept, strict=True))
            found = {leg.name: state for leg, state in zip(trip.legs, states, strict=True) if state is not None}
            there = {number: each for number, each in stored.items() if each is not None}
            return restore(touched.values(), found, there)

        trip.examined = numbers
        effects.append(Examine(trip, hulls, numbers, restored))

    def _restore_fences(self, trip: LineTrip, event: Examined) -> None:
        """Return fences to what the storage has of them: the changes of the trip were not committed."""
        restored = event.restored
        assert restored is not None  # the changes were not committed
        trip.undo_created()
        for kept in restored.kept.values():
            fence = self._fences[kept.row.name]
            fence.restored(kept)
            fence.area = None if kept.row.config.area_hull is None else self.get(kept.row.config.area_hull)
            if fence.pair is not None and fence.area is not None:
                fence.pair = Pair(fence.area, fence.pair.other, fence.row.config.near)
                fence.pair.look()
                fence.count_inside()
        self._adopt(restored, trip.touched())
        fences = {fence.name: fence for line in trip.lines for fence in line.fences.values()}
        trip.queues = self._regroup(trip.queues, fences.values(), trip)

    def _adopt(self, restored: Restored, subjects: dict[str, Subjects]) -> None:
        """Give subjects their restored indexes."""
        for name, index in restored.indexes.items():
            subjects[name].index = index
            subjects[name].follow_state()
            for fence in subjects[name].fences.values():
                subjects[name].note_delays(fence)
        for fence in {fence.number: fence for each in subjects.values() for fence in each.fences.values()}.values():
            fence.count_inside()

    # Time and shutdown

    def _tick(self, event: Tick, effects: list[Effect]) -> None:
        """Update the time, and begin what hulls and fences have planned for it."""
        self._now = event.now
        while self._due and self._due[0][0] <= event.time and not self._stopping:
            due, number, name = heappop(self._due)
            if name.startswith(PREFIX):
                fence = self._fences.get(name.removeprefix(PREFIX))
                if fence is not None and fence.number == number and fence.due == due:
                    fence.due = None
                    self._pass_time(fence, event, effects)
                continue
            hull = self._hulls.get(name)
            if hull is not None and hull.row.number == number and hull.due == due:
                hull.due = None
                self._asked(Expire(event.to, hull, event.time, rows=hull.counts.points), effects)

    def _pass_time(self, fence: Fence, event: Tick, effects: list[Effect]) -> None:
        """Begin the events of those who have been inside of a fence for long enough."""
        due = fence.next_due
        if due is None or due > event.time:
            self._plan_fence(fence)
            return
        # It is looked at again even if the request is refused, because the storage cannot be read.
        fence.due = event.time + LOOK_AGAIN
        heappush(self._due, (fence.due, fence.number, PREFIX + fence.name))
        rows = min(fence.waiting, MOST_DUE)
        self._asked_of_fence(PassTime(event.to, fence.name, event.time, fence, rows=rows), effects)

    def _plan_fence(self, fence: Fence) -> None:
        """Plan when the next subject has been inside of a fence for long enough."""
        due = fence.next_due
        if due is not None and (fence.due is None or due < fence.due):
            fence.due = due
            heappush(self._due, (due, fence.number, PREFIX + fence.name))

    def _plan(self, hull: Hull) -> None:
        """Plan when points of a hull leave next. No trip of the hull is in progress."""
        due = hull.state.contents.due
        if due is not None and (hull.due is None or due < hull.due):
            hull.due = due
            heappush(self._due, (due, hull.row.number, hull.name))

    def _stop(self, _: Stopping, effects: list[Effect]) -> None:
        self._stopping = True
        for queue in list(self._queues.values()):
            trip = queue.trip
            if trip is not None and trip.ill is not None:
                self._over(trip)  # the next start reads the outcome from the storage
                self._go_on(trip.queues, effects)
            # Requests that wait for a trip are refused after it, so that the answers of a stream keep their order.


def _is_leaf(fence: Fence) -> bool:
    """Whether a fence joins no hulls: its line stays together without it."""
    return fence.row.config.kind != "prefix" and len(set(depends_on(fence))) == 1


def _names(request: Any) -> "Sequence[str]":
    """The names that a request concerns."""
    match request:
        case FenceRequest():
            names: Sequence[str] = request.names
            return names
        case WriteTogether() | ReadTogether():
            return [part.name for part in request.parts]
        case ReadHull():
            return [request.hull.name]
    return [request.name]


def _take(queue: _Queue, spans: "Callable[[Request], bool]") -> tuple[list[Request], int]:
    """The requests of the next trip, and their points: at most TRIP_ROWS.

    A DeleteHull is always alone, and so are requests that change lines, but some that delete different fences run
    together. Requests to several hulls stay if they wait in other queues too, which `spans` decides.
    """
    waiting, queue.waiting = queue.waiting, []
    requests: list[Request] = []
    rows = 0
    deleted: set[str] = set()
    for i, request in enumerate(waiting):
        if request.abandoned or (type(request) is WriteBatch and request.stream and request.stream.stopped):
            continue
        alone = type(request) is DeleteHull or isinstance(request, STRUCTURAL)
        if type(request) is DeleteFence:
            joins = len(requests) == len(deleted) < FENCES_TOGETHER and request.name not in deleted
        else:
            joins = not (alone or deleted)
        stays = isinstance(request, SPANNING) and spans(request)
        if stays or (requests and not (joins and rows + request.rows <= TRIP_ROWS)):
            queue.waiting = waiting[i:]
            break
        requests.append(request)
        rows += request.rows
        if type(request) is DeleteFence:
            deleted.add(request.name)
        elif alone:
            queue.waiting = waiting[i + 1 :]
            break
    return requests, rows


def _take_together(queues: list[_Queue]) -> tuple[list[Request], int]:
    """The requests of the next trip to these hulls, the first ones in all of their queues, and their points."""
    requests: list[Request] = []
    rows = 0
    for request, *others in zip(*(queue.waiting for queue in queues), strict=False):
        if not isinstance(request, Together) or len(request.parts) != len(queues):
            break
        if any(other is not request for other in others) or (requests and rows + request.rows > TRIP_ROWS):
            break
        requests.append(request)
        rows += request.rows
    for queue in queues:
        del queue.waiting[: len(requests)]
    return requests, rows


def _not_stored(error: Exception) -> NotStoredError:
    full = getattr(error, "full", False)
    return DiskFullError(words(error)) if full else NotStoredError(words(error))


def _ill(error: Exception) -> NotStoredError:
    return NotStoredError(
        f"the last commit of the hull failed, and its data cannot be read yet ({words(error)}): try again later"
    )
