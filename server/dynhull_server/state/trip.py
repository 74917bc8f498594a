"""One trip of a hull: requests that run together, and whose changes are committed together."""

from dataclasses import dataclass

from .batch import Applied, Batch, KeyedBatch
from .errors import HullExistsError, HullNotFoundError
from .events import CreateHull, DeleteHull, Expire, ReadHull, Request, WriteBatch
from .hull import Hull
from .hull_state import HullState
from .limits import Limits
from .records import DEFAULT, Append, Change, Create, Delete, HullRow, HullSettings, Kept, Record


@dataclass(slots=True)
class Place:
    """The data for a new hull: its number, the reason if no more hulls are allowed, and the limits on its state."""

    number: int
    refusal: Exception | None
    limits: Limits


class Trip:
    """Runs requests on a hull, in order. Clients see the changes only after the trip is committed.

    Args:
        name: the name of the hull.
        hull: the hull of that name, or None.
        requests: the requests to run.
        now: seconds on a monotonic clock.
        keeps: whether the storage keeps batches.

    Attributes:
        before: the hull before the trip, or None.
        after: the hull after it, or None.
        applied: whether any batch was applied.
        unsaved: the number of points in the batches applied.
        torn: whether a batch was applied in part, because memory ran out in the middle of it.
        failure: the error of the commit, or None.
        unknown: whether it may have been committed despite the failure.
    """

    __slots__ = (
        "_now",
        "_place",
        "_records",
        "after",
        "applied",
        "before",
        "failure",
        "name",
        "requests",
        "torn",
        "unknown",
        "unsaved",
    )
    _place: Place

    def __init__(self, name: str, hull: Hull | None, requests: list[Request], now: float, *, keeps: bool) -> None:
        self.name = name
        self.before = self.after = hull
        self.requests = requests
        self.applied = self.torn = self.unknown = False
        self.unsaved = 0
        self.failure: Exception | None = None
        self._now = now
        self._records: list[Record] | None = [] if keeps else None

    def may_make(self, place: Place) -> None:
        """Allow the trip to create the hull, which does not exist."""
        self._place = place

    def run(self) -> None:
        """Run the requests; their results and errors are stored in them."""
        for request in self.requests:
            try:
                if type(request) is WriteBatch:
                    self._write(request)
                else:
                    request.result = self._do(request)
            except Exception as error:  # any error is the answer to the caller
                refuse(request, error)
            if self.torn:  # later requests would see a part of a batch
                return

    def changes(self) -> list[Change]:
        """The changes to commit."""
        before, after, records = self.before, self.after, self._records
        if after is before:
            return [Append(after.row.number, records)] if records and after is not None else []
        changes: list[Change] = []
        if after is not None:
            changes.append(Create(after.row))
            if records:
                changes.append(Append(after.row.number, records))
        if before is not None and after is None:
            changes.append(Delete(before.row.number))
        return changes

    def landed(self, found: HullState | None) -> bool:
        """Whether the trip was committed, given the state of the hull in the storage: it has all changes, or none."""
        if self.after is None:
            return found is None
        return found is not None and found.counts.revision >= self.after.state.counts.revision

    def _do(self, request: Request) -> object:
        match request:
            case ReadHull():
                return self._read(request)
            case CreateHull():
                if self.after is not None:
                    raise HullExistsError(self.name)
                self.after = self._new_hull(request)
                return self.after
            case Expire():
                self._expire(request)
                return None
            case DeleteHull():
                if self.after is None:
                    raise HullNotFoundError(self.name)
                if self.after is not self.before:
                    raise AssertionError("a hull is deleted in a trip of its own")
                self.after = None
                return None
        raise AssertionError(f"not a request: {request}")

    def _write(self, request: WriteBatch) -> None:
        stream, hull = request.stream, self.after
        if stream is not None and stream.stopped:
            request.abandoned = True
            return
        if hull is None:
            if request.birth is None or (stream is not None and stream.hull is not None):
                raise HullNotFoundError(self.name)
            hull = self._new_hull(request)
        applied = write(request, hull, self._now, self._records)
        self.torn = hull.state.torn
        if applied is None:
            return
        self.after = hull
        if not applied.duplicate:
            self.applied = True
            self.unsaved += applied.inserted + applied.moved + applied.deleted

    def _expire(self, request: Expire) -> None:
        hull = self.after
        if hull is None or hull is not request.hull:
            return
        try:
            self.applied |= hull.state.expire(request.time, self._records)
        finally:
            self.torn = hull.state.torn

    def _read(self, request: ReadHull) -> object:
        hull = self.after
        if hull is None or request.hull is not hull:
            raise HullNotFoundError(self.name)
        return hull.state.counts, request.function(hull.state)

    def _new_hull(self, request: CreateHull | WriteBatch) -> Hull:
        place, birth = self._place, request.birth
        if place.refusal is not None:
            raise place.refusal
        assert birth is not None  # otherwise the request was refused
        settings = request.settings if isinstance(request, CreateHull) else settings_for(request.make())
        row = HullRow(place.number, self.name, birth.uid, birth.created, settings)
        return Hull(row, HullState(place.limits, settings, Kept(), self._now))


def settings_for(batch: Batch | KeyedBatch) -> HullSettings:
    """The settings of a hull that its first batch creates: keyed if the batch names keys."""
    return HullSettings(batch.kind) if isinstance(batch, KeyedBatch) else DEFAULT


def write(request: WriteBatch, hull: Hull, now: float, records: list[Record] | None) -> Applied | None:
    """Apply a batch to a hull, and store the result or the error in the request. None where it was refused."""
    stream = request.stream
    try:
        if stream is not None and stream.hull is not hull and stream.hull is not None:
            raise HullNotFoundError(hull.name)
        request.result = applied = hull.state.apply(request, now, records)
    except Exception as error:  # any error is the answer to the caller
        refuse(request, error)
        return None
    if stream is not None:
        stream.hull = hull
    return applied


def refuse(request: Request, error: Exception) -> None:
    """Store an error in the request, and stop its stream."""
    request.error = error
    if type(request) is WriteBatch and request.stream is not None:
        request.stream.stopped = True
