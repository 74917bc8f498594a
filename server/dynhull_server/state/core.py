"""The core of the server: names, the queue of each hull, and the outcome of commits. `step(event) -> effects`.

It is synchronous and pure: no threads, clocks or I/O. The driver passes in one event at a time, and carries out the
effects after the step.

Each name has a queue. The requests that wait in it make one *trip* together: they run in order of arrival, their
changes are committed in one transaction, and their callers are answered only after the commit. Requests that arrive
during a commit therefore share the next one, and no reader sees a change that could be undone. A queue has one trip at
a time. The trip belongs to the server: when a caller disconnects, it is not answered, and nothing else changes.
"""

from functools import partial
from typing import TYPE_CHECKING, Any

from sortedcontainers import SortedDict

from .errors import (
    DiskFullError,
    HullNotFoundError,
    LimitExceededError,
    NotStoredError,
    OutcomeUnknownError,
    StoppingError,
    words,
)
from .events import (
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
    Failed,
    Gone,
    NotExamined,
    ReadHull,
    Reply,
    Request,
    Retried,
    Retry,
    Stopping,
    Tick,
    WriteBatch,
)
from .hull import Hull
from .hull_state import HullState
from .limits import Limits
from .records import Append, HullRow, Record
from .trip import Place, Trip, write

if TYPE_CHECKING:
    from collections.abc import Callable

# Requests for at most this many points together run at once: a tenth of a millisecond.
SMALL = 128
# The most points that the requests of one trip read or write together, unless a single request exceeds it.
TRIP_ROWS = 2**18
# Seconds before the storage is examined again: at first, and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0


class _Queue:
    """The work of one name.

    Attributes:
        name: the name.
        hull: the committed hull of that name, or None.
        trip: the trip in progress, or None.
        waiting: the requests for later trips.
        ill: set while a commit has failed and the storage cannot be read: the error of the last attempt.
        pause: seconds before the next attempt.
    """

    __slots__ = ("hull", "ill", "name", "pause", "trip", "waiting")

    def __init__(self, name: str, hull: Hull | None = None) -> None:
        self.name = name
        self.hull = hull
        self.trip: Trip | None = None
        self.waiting: list[Request] = []
        self.ill: Exception | None = None
        self.pause = FIRST_PAUSE


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
        self._creating = 0
        self._trips = 0
        self._stopping = False
        self._handlers: dict[type, Callable[[Any, list[Effect]], None]] = {
            WriteBatch: self._asked,
            ReadHull: self._asked,
            CreateHull: self._asked,
            DeleteHull: self._asked,
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

    # Committed state

    @property
    def hulls(self) -> "SortedDict[str, Hull]":
        """The hulls by name."""
        return self._hulls

    def get(self, name: str) -> Hull:
        """The hull of that name, or raise HullNotFoundError."""
        hull: Hull | None = self._hulls.get(name)
        if hull is None:
            raise HullNotFoundError(name)
        return hull

    @property
    def busy(self) -> bool:
        """Whether any trip is in progress."""
        return self._trips > 0

    @property
    def ill(self) -> bool:
        """Whether the state of any name is unknown, because the storage cannot be read."""
        return any(queue.ill is not None for queue in self._queues.values())

    def restore(self, row: HullRow, state: HullState, unsaved: int) -> None:
        """Add a hull that the storage has kept. Call this before the first step."""
        hull = self._hulls[row.name] = Hull(row, state, unsaved)
        self._queues[row.name] = _Queue(row.name, hull)

    # Requests

    def _asked(self, request: CreateHull | DeleteHull | ReadHull | WriteBatch, effects: list[Effect]) -> None:
        name = request.hull.name if type(request) is ReadHull else request.name  # type: ignore[union-attr]
        queue = self._queues.get(name)
        if queue is None:
            queue = self._queues[name] = _Queue(name)
        if queue.trip is None and not self._stopping and not request.abandoned:
            if request.rows <= SMALL and type(request) is ReadHull:
                self._read(queue, request)
                effects.append(Reply([request]))
            elif self._immediate and queue.hull is not None and request.rows <= SMALL and type(request) is WriteBatch:
                self._write(queue, queue.hull, request, effects)
            else:
                self._begin(queue, [request], request.rows, effects)
                if queue.hull is None or queue.waiting:
                    self._go_on(queue, effects)
            return
        queue.waiting.append(request)
        if queue.ill is not None:
            self._refuse_waiting(queue, _ill(queue.ill), effects)
        self._go_on(queue, effects)

    def _read(self, queue: _Queue, request: ReadHull) -> None:
        """Run a small read. It needs no trip while the queue is idle."""
        hull = queue.hull
        if hull is None or hull is not request.hull:
            request.error = HullNotFoundError(queue.name)
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
            effects.append(Reply([request], None if applied.duplicate else hull))
        elif hull.state.torn:
            trip = queue.trip = Trip(queue.name, hull, [request], self._now, keeps=self._keeps)
            trip.torn = True
            self._trips += 1
            self._ran(queue, trip, effects)
        else:
            effects.append(Reply([request]))

    def _gone(self, event: Gone, _: list[Effect]) -> None:
        event.what.leave()

    def _go_on(self, queue: _Queue, effects: list[Effect]) -> None:
        """Begin trips for the waiting requests, until one of them does not complete at once."""
        while queue.trip is None and queue.waiting:
            if self._stopping:
                self._refuse_waiting(queue, StoppingError(), effects)
            requests, rows = self._take(queue)
            if requests:
                self._begin(queue, requests, rows, effects)
        self._rest(queue)

    def _begin(self, queue: _Queue, requests: list[Request], rows: int, effects: list[Effect]) -> None:
        hull = queue.hull
        trip = queue.trip = Trip(queue.name, hull, requests, self._now, keeps=self._keeps)
        self._trips += 1
        if hull is None:
            trip.may_make(Place(self._next_number, self._no_more_hulls(), self._limits))
            self._next_number += 1
            self._creating += 1
        if rows > SMALL:
            effects.append(Compute(trip))
            return
        trip.run()
        self._ran(queue, trip, effects)

    def _take(self, queue: _Queue) -> tuple[list[Request], int]:
        """The requests of the next trip: at most TRIP_ROWS points, and a DeleteHull always alone."""
        waiting, queue.waiting = queue.waiting, []
        requests: list[Request] = []
        rows = 0
        for i, request in enumerate(waiting):
            if request.abandoned or (type(request) is WriteBatch and request.stream and request.stream.stopped):
                continue
            deletes = type(request) is DeleteHull
            if requests and (deletes or rows + request.rows > TRIP_ROWS):
                queue.waiting = waiting[i:]
                break
            requests.append(request)
            rows += request.rows
            if deletes:
                queue.waiting = waiting[i + 1 :]
                break
        return requests, rows

    def _no_more_hulls(self) -> Exception | None:
        most = self._limits.max_hulls
        return LimitExceededError("max_hulls", most) if len(self._hulls) + self._creating >= most else None

    def _computed(self, event: Computed, effects: list[Effect]) -> None:
        trip = event.ticket
        queue = self._queues[trip.name]
        self._ran(queue, trip, effects)
        self._go_on(queue, effects)

    def _ran(self, queue: _Queue, trip: Trip, effects: list[Effect]) -> None:
        if trip.torn:
            self._fail(queue, trip, MemoryError("a batch was applied in part"), effects)
            return
        changes = trip.changes()
        if changes:
            effects.append(Commit(None if self._immediate else trip, changes))
            if not self._immediate:
                return
        elif not trip.applied:
            self._end(queue, trip, effects, None)
            return
        self._keep(queue, trip, effects)

    def _end(self, queue: _Queue, trip: Trip, effects: list[Effect], moved: Hull | None) -> None:
        """Complete the trip: answer its callers."""
        requests = trip.requests
        if len(requests) != 1 or requests[0].abandoned:
            requests = [request for request in requests if not request.abandoned]
        effects.append(Reply(requests, moved))
        self._over(queue, trip)

    def _over(self, queue: _Queue, trip: Trip) -> None:
        queue.trip = None
        queue.ill = None
        queue.pause = FIRST_PAUSE
        self._trips -= 1
        if trip.before is None:
            self._creating -= 1

    def _rest(self, queue: _Queue) -> None:
        """Remove the queue of a name that has neither a hull nor a trip."""
        if queue.hull is None and queue.trip is None:
            del self._queues[queue.name]

    # Commits

    def _committed(self, event: Committed, effects: list[Effect]) -> None:
        queue = self._queues[event.ticket.name]
        self._keep(queue, event.ticket, effects)
        self._go_on(queue, effects)

    def _keep(self, queue: _Queue, trip: Trip, effects: list[Effect]) -> None:
        """Publish the changes of the trip, which are committed."""
        before, after = trip.before, trip.after
        if after is not None:
            after.counts = after.state.counts
            after.unsaved += trip.unsaved
        if after is not before:
            queue.hull = after
            if before is not None:
                before.ended = True
                del self._hulls[queue.name]
            if after is not None:
                self._hulls[queue.name] = after
        self._end(queue, trip, effects, after or before)

    def _failed(self, event: Failed, effects: list[Effect]) -> None:
        trip = event.ticket
        queue = self._queues[trip.name]
        if event.unknown:
            trip.failure, trip.unknown = event.error, True
            self._examine(trip, effects)
            return
        self._fail(queue, trip, event.error, effects)
        self._go_on(queue, effects)

    def _fail(self, queue: _Queue, trip: Trip, error: Exception, effects: list[Effect]) -> None:
        """Handle a trip whose changes were not committed."""
        trip.failure = error
        self._refuse_changes(trip, _not_stored(error), effects)
        if trip.before is not None and (trip.applied or trip.torn):
            self._examine(trip, effects)  # its state in memory includes the batches
        else:
            self._again(queue, trip)

    def _refuse_changes(self, trip: Trip, error: Exception, effects: list[Effect]) -> None:
        """Refuse the changes of the trip, and stop the streams that sent them."""
        refused: list[Request] = []
        streams: set[int] = set()
        for request in trip.requests:
            if type(request) is ReadHull:
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

    def _again(self, queue: _Queue, trip: Trip) -> None:
        """Repeat the reads of a trip whose changes were not committed."""
        reads = [request for request in trip.requests if type(request) is ReadHull and not request.abandoned]
        for request in reads:
            request.result = request.error = None
        self._over(queue, trip)
        queue.waiting[:0] = reads

    # Examination of the storage

    def _examine(self, trip: Trip, effects: list[Effect]) -> None:
        hull = trip.before or trip.after
        assert hull is not None  # a trip without a hull changes nothing
        row = hull.row
        load = partial(HullState, self._limits, row.max_points, now=self._now)
        effects.append(Examine(trip, row.number, trip.unknown, load))

    def _under_way(self, trip: Trip) -> _Queue | None:
        """The queue of a trip; None where the server is stopping and did not wait for it."""
        queue = self._queues.get(trip.name)
        return queue if queue is not None and queue.trip is trip else None

    def _examined(self, event: Examined, effects: list[Effect]) -> None:
        trip, found = event.ticket, event.state
        queue = self._under_way(trip)
        if queue is None:
            return
        if trip.unknown and trip.landed(found):
            self._keep(queue, trip, effects)
        elif trip.before is not None and found is None:
            self._not_examined(NotExamined(trip, LookupError("the hull is not in the storage")), effects)
        else:
            if trip.before is not None and found is not None:
                trip.before.state = found
            assert trip.failure is not None  # a trip is examined only after a failure
            if trip.unknown:
                self._refuse_changes(trip, _not_stored(trip.failure), effects)
            self._again(queue, trip)
        self._go_on(queue, effects)

    def _not_examined(self, event: NotExamined, effects: list[Effect]) -> None:
        trip = event.ticket
        queue = self._under_way(trip)
        if queue is None:
            return
        queue.ill = event.error
        if trip.unknown:
            self._refuse_changes(trip, OutcomeUnknownError(words(event.error)), effects)
        reads = [request for request in trip.requests if not request.abandoned]
        trip.requests = []
        queue.waiting[:0] = reads
        if self._stopping:
            self._abandon(queue, trip, effects)
            return
        self._refuse_waiting(queue, _ill(event.error), effects)
        effects.append(Retry(trip, queue.pause, event.error))
        queue.pause = min(2 * queue.pause, LONGEST_PAUSE)

    def _retried(self, event: Retried, effects: list[Effect]) -> None:
        if self._under_way(event.ticket) is not None:
            self._examine(event.ticket, effects)

    def _refuse_waiting(self, queue: _Queue, error: Exception, effects: list[Effect]) -> None:
        waiting, queue.waiting = queue.waiting, []
        refused: list[Request] = []
        for request in waiting:
            stream = request.stream if type(request) is WriteBatch else None
            if request.abandoned or (stream is not None and stream.stopped):
                continue
            if stream is not None:
                stream.stopped = True
            request.error = error
            refused.append(request)
        effects.append(Reply(refused))

    # Time and shutdown

    def _tick(self, event: Tick, _: list[Effect]) -> None:
        self._now = event.now

    def _stop(self, _: Stopping, effects: list[Effect]) -> None:
        self._stopping = True
        for queue in list(self._queues.values()):
            if queue.ill is not None and queue.trip is not None:
                self._abandon(queue, queue.trip, effects)
            # Requests that wait for a trip are refused after it, so that the answers of a stream keep their order.

    def _abandon(self, queue: _Queue, trip: Trip, effects: list[Effect]) -> None:
        """End a trip with an unknown outcome; the next start reads the outcome from the storage."""
        self._over(queue, trip)
        self._go_on(queue, effects)


def _not_stored(error: Exception) -> NotStoredError:
    full = getattr(error, "full", False)
    return DiskFullError(words(error)) if full else NotStoredError(words(error))


def _ill(error: Exception) -> NotStoredError:
    return NotStoredError(
        f"the last commit of the hull failed, and its data cannot be read yet ({words(error)}): try again later"
    )
