"""One trip: requests that run together, and whose changes are committed together."""

from dataclasses import dataclass

from .batch import Applied
from .errors import HullExistsError, HullNotFoundError
from .events import CreateHull, DeleteHull, ReadHull, Request, WriteBatch, WriteTogether
from .hull import Hull
from .hull_state import HullState
from .limits import Limits
from .records import DEFAULT, Append, Change, Create, Delete, HullRow, Kept, Record
from .together import apply_together


@dataclass(slots=True)
class Place:
    """The data for a new hull: its number, the reason if no more hulls are allowed, and the limits on its state."""

    number: int
    refusal: Exception | None
    limits: Limits


class Leg:
    """The part of a trip at one hull.

    Args:
        name: the name of the hull.
        hull: the hull of that name, or None.
        keeps: whether the storage keeps batches.

    Attributes:
        before: the hull before the trip, or None.
        after: the hull after it, or None.
        records: the batches applied; None where the storage keeps none.
        unsaved: the number of points in them.
    """

    __slots__ = ("after", "before", "name", "records", "unsaved")

    def __init__(self, name: str, hull: Hull | None, *, keeps: bool) -> None:
        self.name = name
        self.before = self.after = hull
        self.records: list[Record] | None = [] if keeps else None
        self.unsaved = 0

    def changes(self) -> list[Change]:
        """The changes to commit."""
        before, after, records = self.before, self.after, self.records
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
        """Whether the changes were committed, given the state of the hull in the storage."""
        if self.after is None:
            return found is None
        return found is not None and found.counts.revision >= self.after.state.counts.revision


class Trip:
    """Runs requests in order. Clients see the changes only after the trip is committed.

    Args:
        legs: the hulls: one, or those of the WriteTogether that are the requests.
        requests: the requests to run.
        now: seconds on a monotonic clock.
        place: for a hull that the trip may create, or None.

    Attributes:
        applied: whether any batch was applied.
        torn: whether the requests were applied in part, because memory ran out in the middle of one.
        failure: the error of the commit, or None.
        unknown: whether it may have been committed despite the failure.
        ill: set while the commit has failed and the storage cannot be read: the error of the last attempt.
        pause: seconds before the next attempt.
    """

    __slots__ = (
        "_now",
        "applied",
        "failure",
        "ill",
        "legs",
        "pause",
        "place",
        "requests",
        "torn",
        "unknown",
    )

    def __init__(self, legs: list[Leg], requests: list[Request], now: float, pause: float, place: Place | None) -> None:
        self.legs = legs
        self.requests = requests
        self.place = place
        self.pause = pause
        self.applied = self.torn = self.unknown = False
        self.failure: Exception | None = None
        self.ill: Exception | None = None
        self._now = now

    def run(self) -> None:
        """Run the requests; their results and errors are stored in them."""
        for request in self.requests:
            try:
                if type(request) is WriteBatch:
                    self._write(request)
                elif type(request) is WriteTogether:
                    self._write_together(request)
                else:
                    request.result = self._do(request, self.legs[0])
            except Exception as error:  # any error is the answer to the caller
                refuse(request, error)
            if self.torn:  # later requests would see a part of a batch
                return

    def changes(self) -> list[Change]:
        """The changes to commit."""
        if len(self.legs) == 1:
            return self.legs[0].changes()
        return [change for leg in self.legs for change in leg.changes()]

    def landed(self, found: list[HullState | None]) -> bool:
        """Whether the trip was committed, given the state of each hull in the storage: it has all changes, or none."""
        return all(leg.landed(state) for leg, state in zip(self.legs, found, strict=True))

    def _do(self, request: Request, leg: Leg) -> object:
        match request:
            case ReadHull():
                return _read(request, leg)
            case CreateHull():
                if leg.after is not None:
                    raise HullExistsError(leg.name)
                leg.after = self._new_hull(request, leg)
                return leg.after
            case DeleteHull():
                if leg.after is None:
                    raise HullNotFoundError(leg.name)
                if leg.after is not leg.before:
                    raise AssertionError("a hull is deleted in a trip of its own")
                leg.after = None
                return None
        raise AssertionError(f"not a request: {request}")

    def _write(self, request: WriteBatch) -> None:
        leg = self.legs[0]
        stream, hull = request.stream, leg.after
        if stream is not None and stream.stopped:
            request.abandoned = True
            return
        if hull is None:
            if request.birth is None or (stream is not None and stream.hull is not None):
                raise HullNotFoundError(leg.name)
            hull = self._new_hull(request, leg)
        applied = write(request, hull, self._now, leg.records)
        self.torn = hull.state.torn
        if applied is None:
            return
        leg.after = hull
        self._count(leg, applied)

    def _write_together(self, request: WriteTogether) -> None:
        legs = {leg.name: leg for leg in self.legs}
        parts = [(part, legs[part.name]) for part in request.parts]
        states = []
        for request.refused, (_, leg) in enumerate(parts):
            if leg.after is None:
                raise HullNotFoundError(leg.name)
            states.append(leg.after.state)
        self.torn = True  # unless
