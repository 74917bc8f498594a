"""The core of the server: trips, and the outcome of their commits. `step(event) -> effects`.

It is synchronous and pure: no threads, clocks or I/O. The driver passes in one event at a time, and carries out the
effects after the step.

Each name has a queue. The requests that wait in it make one *trip* together: they run in order of arrival, their
changes are committed in one transaction, and their callers are answered only after the commit. Requests that arrive
during a commit therefore share the next one, and no reader sees a change that could be undone. A queue has one trip at
a time. The trip belongs to the server: when a caller disconnects, it is not answered, and nothing else changes.

A request to several hulls waits in all of their queues, and begins when it is the first in each of them: then one trip
occupies all of these queues. The hulls that a fence depends on share one queue: `queues.py`.
"""

from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias, get_args

from .dormant import Dormant
from .errors import (
    DiskFullError,
    HullNotFoundError,
    NotStoredError,
    OutcomeUnknownError,
    StoppingError,
    words_for_callers,
)
from .events import (
    Arrived,
    Commit,
    Committed,
    Compute,
    Computed,
    Divide,
    Effect,
    Event,
    Examine,
    Examined,
    Failed,
    Gone,
    NotExamined,
    Reply,
    Retried,
    Retry,
    Stopping,
    Tick,
)
from .fences.core import FenceCore
from .fences.index.components import SPANNING
from .fences.index.line import Line
from .fences.model.fence import Fence
from .fences.model.requests import AnyFenceRequest, CreateFence, FenceRequest, PassTime, ReadFence
from .fences.model.tallies import Tallies
from .hull import Hull
from .hull_state import HullState
from .leg import Leg
from .limits import Limits
from .queues import Queue, Queues, names_of
from .records import DEFAULT, Append, CommitStamp, HullRow, Kept, Record
from .registry import Registry
from .requests import (
    Expire,
    HullRequest,
    ReadHull,
    ReadTogether,
    Request,
    Stream,
    Together,
    WriteBatch,
    WriteTogether,
)
from .root_state import state_of
from .schedule import Schedule
from .taking import take
from .trip import Trip, refuse, write

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from sortedcontainers import SortedDict

    from .batch import Applied, Batch, Write
    from .changes import Change
    from .fences.model.records import KeptFence

# A request for at most this many points runs at once: a tenth of a millisecond. It holds the GIL anyway.
SMALL = 128
# Small requests for at most this many points together run at once, too: a thread would begin them later than that.
SMALL_TRIP = 1024
# Seconds before the storage is examined again: at first, and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0
READS = ReadHull | ReadTogether | ReadFence
# What the shards of a divided hull carry out.
DIVIDED = WriteBatch | Expire
# A hull, the result of a batch that was applied to it at once, and what to commit.
Written: TypeAlias = "tuple[Hull, Applied, list[Change]]"


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
        self._immediate = immediate
        self._keeps = keeps
        self._now = now
        self._registry = Registry(limits, next_number)
        self._queues = Queues(self._registry)
        self._schedule = Schedule(self._registry)
        self._fences = FenceCore(self._registry, self._queues, self._schedule, keeps=keeps)
        self._own: Any = None  # who gets the answers to the core's own requests
        self._trips = 0
        self._undecided = 0
        self._stopping = False
        self._handlers: dict[type, Callable[[Any, list[Effect]], None]] = {
            **dict.fromkeys((WriteBatch, *get_args(HullRequest)), self._asked),
            Arrived: self._arrived,
            WriteTogether: self._asked_together,
            ReadTogether: self._asked_together,
            **dict.fromkeys(get_args(AnyFenceRequest), self._asked_of_fence),
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
        self._queues.check()

    # Committed state

    @property
    def hulls(self) -> "SortedDict[str, Hull]":
        """The hulls by name."""
        return self._registry.hulls

    def get(self, name: str) -> Hull:
        """The hull of that name, or raise HullNotFoundError."""
        return self._registry.get(name)

    @property
    def fences(self) -> "SortedDict[str, Fence]":
        """The fences by name."""
        return self._registry.fences

    @property
    def tallies(self) -> Tallies:
        """What is counted of the fences."""
        return self._registry.tallies

    def fence(self, name: str) -> Fence:
        """The fence of that name, or raise FenceNotFoundError."""
        return self._registry.fence(name)

    @property
    def latest_time(self) -> int | None:
        """The latest time of the server's clock that a hull or fence has recorded, None for none. O(both)."""
        return self._registry.latest_time

    def line(self, name: str) -> Line | None:
        """The fences of a hull, and of those that share its queue; None for a hull without fences."""
        queue = self._queues.get(name)
        return None if queue is None else queue.line

    def number_of_shard(self) -> int:
        """A number for a shard that is created."""
        return self._registry.number_of_shard()

    def idle(self, hull: Hull) -> bool:
        """Whether a small read of a hull needs no request, because nothing goes on in its queue."""
        queue = self._queues.get(hull.name)
        return queue is not None and queue.trip is None and not (queue.waiting or self._stopping or hull.ended)

    @property
    def busy(self) -> bool:
        """Whether any trip is in progress."""
        return self._trips > 0

    @property
    def undecided(self) -> bool:
        """Whether a commit has perhaps taken place, and what it has changed is not published."""
        return self._undecided > 0

    @property
    def ill(self) -> bool:
        """Whether the state of any name is unknown, because the storage cannot be read."""
        return any(queue.ill is not None for queue in self._queues)

    def expiring(self, time: int) -> bool:
        """Whether points are about to leave, or should have left by a time. O(hulls)."""
        if self._schedule.has(time):
            return True
        for queue in self._queues:
            requests = queue.waiting if queue.trip is None else [*queue.waiting, *queue.trip.requests]
            if any(isinstance(request, Expire | PassTime) for request in requests):
                return True
        return False

    def restore(self, row: HullRow, state: HullState | Dormant, unsaved: int) -> None:
        """Add a hull that the storage has kept. Call this before the first step."""
        hull = self._registry.hulls[row.name] = Hull(row, state, unsaved)
        self._queues.add(hull)
        self._schedule.plan(hull)

    def restore_fences(self, kept: "Sequence[KeptFence]") -> None:
        """Add the fences that the storage has kept. Call this after `restore`, and before the first step."""
        self._fences.restore(kept)

    # Requests

    def _asked(self, request: HullRequest | WriteBatch, effects: list[Effect]) -> None:
        if self._schedule.fences and type(request) is WriteBatch:
            self._pass_time(request.write.arrived, effects)
        queue = self._queues.of(request.name)
        hull = queue.hull
        if hull is None and self._immediate and queue.line is not None:
            hull = self._fences.quiet_hull(queue.line, request)
        if hull is not None and hull.divided and isinstance(request, DIVIDED):
            self._divide(hull, [request], effects)
        elif queue.trip is not None or queue.waiting or self._stopping or request.abandoned:
            queue.waiting.append(request)
            self._go_on([queue], effects)
        elif self._immediate and hull is not None and request.rows <= SMALL and type(request) is WriteBatch:
            self._write(queue, hull, request, effects)
        elif request.rows <= SMALL and type(request) is ReadHull:
            self._read(queue, request)
            effects.append(Reply([request]))
        else:
            self._begin([queue], [request], request.rows, effects)
            if hull is None:
                self._queues.rest(queue)

    def _arrived(self, event: Arrived, effects: list[Effect]) -> None:
        if self._schedule.fences:
            self._pass_time(event.batches[0].write.arrived, effects)
        queue = self._queues.of(event.batches[0].name)
        if queue.hull is not None and queue.hull.divided:
            self._divide(queue.hull, list(event.batches), effects)
            return
        queue.waiting += event.batches
        self._go_on([queue], effects)

    def _divide(self, hull: Hull, requests: "list[WriteBatch | Expire]", effects: list[Effect]) -> None:
        """Leave requests to the shards of a hull."""
        if not self._stopping:
            effects.append(Divide(hull, requests))
            return
        refused: list[Request] = []
        for request in requests:
            stream = request.stream if type(request) is WriteBatch else None
            if not (request.abandoned or (stream is not None and stream.stopped)):
                refuse(request, StoppingError())
                refused.append(request)
        effects.append(Reply(refused))

    def _asked_together(self, request: Together, effects: list[Effect]) -> None:
        if type(request) is WriteTogether:
            self._pass_time(request.parts[0].arrived, effects)
        self._go_on(self._queues.put(request, [part.name for part in request.parts]), effects)

    def _asked_of_fence(self, request: FenceRequest, effects: list[Effect]) -> None:
        request.names = self._queues.involved(request)
        self._go_on(self._queues.put(request, request.names), effects)

    def _read(self, queue: Queue, request: ReadHull) -> None:
        """Run a small read. It needs no trip while the queue is idle."""
        hull = queue.hull
        if hull is None:  # perhaps one of a line
            hull = self._registry.hulls.get(request.hull.name)
        if hull is None or hull is not request.hull:
            request.error = HullNotFoundError(request.hull.name)
            self._queues.rest(queue)
            return
        try:
            request.result = hull.counts, request.function(hull.state)
        except Exception as error:  # any error is the answer to the caller
            request.error = error

    def _write(self, queue: Queue, hull: Hull, request: WriteBatch, effects: list[Effect]) -> None:
        """Apply a small batch to an existing hull. It needs no trip where commits are immediate, as in memory."""
        if request.stream is not None and request.stream.stopped:
            return
        records: list[Record] | None = [] if self._keeps else None
        applied = None if hull.state.torn else write(request, hull, self._now, records)
        line = queue.line
        if line is not None and applied is not None and line.stirred(hull, applied, request.write.arrived):
            trip = self._new_trip([queue], [request])
            trip.alarmed(request, applied, records)
            self._ran(trip, effects)
        elif applied is not None:
            if records:
                effects.append(Commit(None, [Append(hull.row.number, records)]))
            hull.counts = hull.state.counts
            effects.append(Reply([request], () if applied.duplicate else (hull,)))
            if hull.timed:
                self._schedule.plan(hull)
        elif hull.state.torn:
            trip = self._new_trip([queue], [request])
            trip.torn = True
            self._ran(trip, effects)
        else:
            effects.append(Reply([request]))

    def _free(self, stream: Stream) -> Hull | None:
        """The hull of a stream, if nothing goes on in its queue or depends on it; otherwise a batch takes a request."""
        queue = self._queues.get(stream.name)
        if queue is None or queue.trip is not None or queue.waiting or self._stopping or not self._immediate:
            return None
        hull = queue.hull
        if hull is None or hull is not stream.hull or stream.stopped or hull.divided or hull.state.torn:
            return None
        return None if queue.line is not None or self._schedule.fences else hull

    def apply_points(self, stream: Stream, batch: "Batch") -> "Written | None":
        """Apply a small batch of points and nothing else as `write_at_once` does, where none is kept.

        None where it is refused, or more may follow from it. Then nothing has changed, unless the hull is torn.
        """
        hull = self._free(stream)
        if hull is None or self._keeps or len(batch.inserts) + len(batch.deletes) > SMALL:
            return None
        try:
            applied = hull.state.apply_points(batch)
        except Exception:  # a request is refused with it
            return None
        if applied is None:
            return None
        hull.counts = hull.state.counts
        return hull, applied, []

    def write_at_once(self, stream: Stream, write: "Write") -> "Written | None":
        """Apply a small batch of a stream as `_write` does, without a request: the hull, the result, what to commit.

        None where it takes one: the batch is refused, or something goes on in the queue of the hull, or depends on it.
        Then nothing has changed, unless the hull is torn.
        """
        hull = self._free(stream)
        if hull is None or write.rows > SMALL:
            return None
        records: list[Record] | None = [] if self._keeps else None
        try:
            applied = hull.state.apply(write, self._now, records)
        except Exception:  # a request is refused with it
            return None
        hull.counts = hull.state.counts
        if hull.timed:
            self._schedule.plan(hull)
        return hull, applied, [Append(hull.row.number, records)] if records else []

    def _gone(self, event: Gone, effects: list[Effect]) -> None:
        event.what.leave()
        if isinstance(event.what, SPANNING):
            self._go_on(self._queues.remove(event.what), effects)

    def _go_on(self, queues: "Iterable[Queue]", effects: list[Effect]) -> None:
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
                    left += self._queues.complete(first)
                together = self._queues.at(names_of(first)) if isinstance(first, SPANNING) else [queue]
                if not all(each.trip is None and each.waiting and each.waiting[0] is first for each in together):
                    break  # the last of these queues that comes so far begins it
                requests, rows = self._take(together, effects)
                if requests:
                    trip = self._begin(together, requests, rows, effects)
                    left += [each for each in trip.queues if each is not queue]
            self._queues.rest(queue)

    def _take(self, queues: list[Queue], effects: list[Effect]) -> tuple[list[Request], int]:
        """The requests of the next trip, without those that are for shards: they have waited for their hull."""
        requests, rows = take(self._queues, queues)
        hull = queues[0].hull
        if hull is None or not hull.divided:
            return requests, rows
        for_shards = [request for request in requests if isinstance(request, DIVIDED)]
        if for_shards:
            self._divide(hull, for_shards, effects)
        return [request for request in requests if not isinstance(request, DIVIDED)], rows

    def _begin(self, queues: list[Queue], requests: list[Request], rows: int, effects: list[Effect]) -> Trip:
        trip = self._new_trip(queues, requests)
        if trip.fences is not None:
            rows = max(rows, trip.fences.weight)
        if rows > SMALL_TRIP or (rows > SMALL and max([request.rows for request in requests]) > SMALL):
            effects.append(Compute(trip))
            return trip
        trip.run()
        self._ran(trip, effects)
        return trip

    def _new_trip(self, queues: list[Queue], requests: list[Request]) -> Trip:
        if all(queue.line is None for queue in queues) and not isinstance(requests[0], FenceRequest):
            places = {}
            if queues[0].hull is None and len(queues) == 1:
                places[queues[0].name] = self._registry.reserve_hull()
            legs = {queue.name: Leg(queue.name, queue.hull, keeps=self._keeps) for queue in queues}
            trip = Trip(legs, requests, self._now, FIRST_PAUSE, places)
        else:
            trip = self._fences.trip(queues, requests, self._now, FIRST_PAUSE)
        trip.queues = queues
        for queue in queues:
            queue.trip = trip
        self._trips += 1
        return trip

    def _computed(self, event: Computed, effects: list[Effect]) -> None:
        trip = event.ticket
        self._ran(trip, effects)
        self._go_on(trip.queues, effects)

    def _ran(self, trip: Trip, effects: list[Effect]) -> None:
        if trip.fences is not None:
            self._fences.ran(trip.fences)
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
        self._registry.give_back(len(trip.places))
        if trip.fences is not None:
            self._fences.over(trip, trip.fences)
        for queue in trip.queues:
            queue.trip = None
            if queue.hull is not None:
                self._schedule.plan(queue.hull)
            elif queue.line is not None:
                for name in trip.legs:
                    if name in self._registry.hulls:
                        self._schedule.plan(self._registry.hulls[name])

    # Commits

    def _committed(self, event: Committed, effects: list[Effect]) -> None:
        trip = event.ticket
        self._keep(trip, effects, event.commit)
        self._go_on(trip.queues, effects)

    def _keep(self, trip: Trip, effects: list[Effect], commit: CommitStamp | None = None) -> None:
        """Publish the changes of the trip, which are committed: those of all its hulls in one step."""
        moved = []
        for leg in trip.legs.values():
            before, after = leg.before, leg.after
            changed = after is not before
            if after is not None:
                changed |= after.counts is not after.state.counts
                after.counts = after.state.counts
                after.unsaved += leg.unsaved
            if after is not before:
                queue = self._queues.of(leg.name)
                if queue.line is None:
                    queue.hull = after
                else:
                    queue.guests = (queue.guests or set()) | {leg.name}
                if before is not None:
                    before.ended = True
                    del self._registry.hulls[leg.name]
                if after is not None:
                    self._registry.hulls[leg.name] = after
            hull = after or before
            if hull is not None and changed:  # a trip of a fence names hulls that it leaves as they are
                hull.committed = commit or hull.committed
                moved.append(hull)
        if trip.fences is not None:
            self._fences.keep(trip, trip.fences, effects)
        self._end(trip, effects, tuple(moved))

    def _failed(self, event: Failed, effects: list[Effect]) -> None:
        trip = event.ticket
        if event.unknown:
            trip.failure, trip.unknown = event.error, True
            self._undecided += 1
            self._examine(trip, effects)
            return
        self._fail(trip, event.error, effects)
        self._go_on(trip.queues, effects)

    def _fail(self, trip: Trip, error: Exception, effects: list[Effect]) -> None:
        """Handle a trip whose changes were not committed."""
        trip.failure = error
        self._refuse_changes(trip, not_stored(error), effects)
        if trip.fences is None and trip.places:  # the new hull is forgotten
            self._again(trip)
        elif trip.applied or trip.torn:
            self._examine(trip, effects)  # the states in memory include the batches
        else:
            if trip.fences is not None:
                trip.fences.undo_created()
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
        for leg in trip.legs.values():
            hull = leg.before or leg.after
            number, settings = (0, DEFAULT) if hull is None else (hull.row.number, hull.row.settings)
            hulls.append((number, partial(state_of, self._registry.limits, settings, now=self._now)))
        examine = Examine(trip, hulls)
        if trip.fences is not None:
            self._fences.examine(trip, trip.fences, examine)
        effects.append(examine)

    def _under_way(self, trip: Trip) -> bool:
        """Whether a trip is in progress; False where the server is stopping and did not wait for it."""
        return trip.queues[0].trip is trip

    def _examined(self, event: Examined, effects: list[Effect]) -> None:
        trip = event.ticket
        if not self._under_way(trip):
            return
        found = list(zip(trip.legs.values(), event.states, strict=True))
        if trip.unknown and trip.landed(event.states, event.fences):
            commits = [state.committed for state in event.states if state is not None and state.committed is not None]
            self._undecided -= 1
            self._keep(trip, effects, max(commits, default=None))
        elif any(leg.before is not None and state is None for leg, state in found):
            self._not_examined(NotExamined(trip, LookupError("the hull is not in the storage")), effects)
        else:
            for leg, state in found:
                if leg.before is not None and state is not None:
                    leg.before.replace(state)
            if trip.quiet is not None:
                trip.quiet.look_again(trip.legs)
            if trip.fences is not None:
                self._fences.give_back(trip, trip.fences, event.restored)
            assert trip.failure is not None  # a trip is examined only after a failure
            if trip.unknown:
                self._undecided -= 1
                self._refuse_changes(trip, not_stored(trip.failure), effects)
            self._again(trip)
        self._go_on(trip.queues, effects)

    def _not_examined(self, event: NotExamined, effects: list[Effect]) -> None:
        trip = event.ticket
        if not self._under_way(trip):
            return
        trip.ill = event.error
        if trip.unknown:
            self._refuse_changes(trip, OutcomeUnknownError(words_for_callers(event.error)), effects)
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

    def _refuse_waiting(self, queue: Queue, error: Exception, effects: list[Effect]) -> list[Queue]:
        """Refuse the waiting requests. Returns the other queues in which some of them waited."""
        waiting, queue.waiting = queue.waiting, []
        refused: list[Request] = []
        others: list[Queue] = []
        for request in waiting:
            stream = request.stream if type(request) is WriteBatch else None
            if request.abandoned or (stream is not None and stream.stopped):
                continue
            if stream is not None:
                stream.stopped = True
            request.error = error
            refused.append(request)
            if isinstance(request, SPANNING):
                others += self._queues.remove(request)
        effects.append(Reply(refused))
        return others

    # Time and shutdown

    def _tick(self, event: Tick, effects: list[Effect]) -> None:
        """Update the time, and begin what hulls and fences have planned for it."""
        if self._own is None:
            self._fences.begin(event.time)
        self._now, self._own = event.now, event.to
        self._pass_time(event.time, effects)
        for hull in () if self._stopping else self._schedule.take(event.time):
            self._asked(Expire(event.to, hull, event.time, rows=hull.counts.points), effects)

    def _pass_time(self, time: int, effects: list[Effect]) -> None:
        """Have fences make what time has made up to now, before what comes now."""
        if self._stopping or self._own is None:
            return
        for fence in self._schedule.take_fences(time):
            request = self._fences.due(fence, time, self._own)
            if request is not None:
                self._asked_of_fence(request, effects)

    def _stop(self, _: Stopping, effects: list[Effect]) -> None:
        self._stopping = True
        for queue in list(self._queues):
            trip = queue.trip
            if trip is not None and trip.ill is not None:
                self._over(trip)  # the next start reads the outcome from the storage
                self._go_on(trip.queues, effects)
            # Requests that wait for a trip are refused after it, so that the answers of a stream keep their order.


def not_stored(error: Exception) -> NotStoredError:
    """The refusal of what was not committed, for this reason."""
    full = getattr(error, "full", False)
    reason = words_for_callers(error)
    return DiskFullError(reason) if full else NotStoredError(reason)


def _ill(error: Exception) -> NotStoredError:
    return NotStoredError(
        "the last commit of the hull failed, and its data cannot be read yet "
        f"({words_for_callers(error)}): try again later"
    )
