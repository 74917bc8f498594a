"""One trip: requests that run together, and whose changes are committed together."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, assert_never

from .batch import Applied, Batch, KeyedBatch
from .changes import Change
from .errors import HullExistsError, HullNotFoundError, HullUnsuitableError, MisfitError
from .fences.model.requests import AnyFenceRequest
from .hull import Hull
from .hull_state import Counts, HullState
from .leg import Leg
from .limits import Limits
from .records import DEFAULT, HullRow, HullSettings, Kept, Record
from .requests import (
    CreateHull,
    DeleteHull,
    Expire,
    Follow,
    HullRequest,
    ReadHull,
    ReadTogether,
    Recenter,
    Request,
    WriteBatch,
    WriteTogether,
)
from .root_state import RootState, state_of
from .together import apply_together

if TYPE_CHECKING:
    from .fences.index.line import Line
    from .fences.model.records import KeptFence
    from .fences.trip.part import FencePart


@dataclass(slots=True)
class Reservation:
    """The data for a new hull: its number, the reason if no more hulls are allowed, and the limits on its state."""

    number: int
    refusal: Exception | None
    limits: Limits


class Quiet:
    """Alarms that look at the hulls of trips, and as a rule have nothing to say.

    Args:
        line: the alarms.
        part: makes the part of a trip that concerns them, once one may have something to say.

    Attributes:
        line, part: as given.
        restless: whether a batch may mean something that leaves the outline as it is.
    """

    __slots__ = ("_stills", "line", "part", "restless")

    def __init__(self, line: "Line", part: "Callable[[Line, Trip], FencePart]") -> None:
        self.line = line
        self.part = part
        self.restless = line.restless > 0
        self._stills: dict[str, list[Callable[[], bool]]] = {}

    def still(self, hull: Hull) -> bool:
        """Whether a change of a hull's outline means nothing for the alarms: as a rule so; if unsure, it says no."""
        name = hull.row.name
        stills = self._stills.get(name)
        if stills is None:
            stills = self._stills[name] = self.line.stills(name)
        for still in stills:
            if not still():
                break
        else:
            return True
        return False

    def look_again(self, names: Iterable[str]) -> None:
        """Look at hulls as the storage has them, after a commit that failed."""
        for _, watched in self.line.watching(names):
            watched.look_again()


class Trip:
    """Runs requests in order. Clients see the changes only after the trip is committed.

    Args:
        legs: the hulls that the requests name.
        requests: the requests to run.
        now: seconds on a monotonic clock.
        pause: seconds before the storage is examined again.
        places: for the hulls that the trip may create, by name.
        fences: what it does to fences; None where none depends on its hulls.

    Attributes:
        legs: the hulls by name.
        applied: whether any batch was applied, or a fence has changed in memory.
        torn: whether the requests were applied in part, because memory ran out in the middle of one.
        quiet: the alarms at its hulls, as long as none has been touched; None where it has none, or has `fences`.
        queues: the queues that it occupies; only the core looks into them.
        failure: the error of the commit, or None.
        unknown: whether it may have been committed despite the failure.
        ill: set while the commit has failed and the storage cannot be read: the error of the last attempt.
        pause: seconds before the next attempt.
    """

    __slots__ = (
        "_now",
        "applied",
        "failure",
        "fences",
        "ill",
        "legs",
        "pause",
        "places",
        "queues",
        "quiet",
        "requests",
        "torn",
        "unknown",
    )

    def __init__(
        self,
        legs: Mapping[str, Leg],
        requests: list[Request],
        now: float,
        pause: float,
        places: Mapping[str, Reservation],
        fences: "FencePart | None" = None,
    ) -> None:
        self.legs = legs
        self.requests = requests
        self.places = places
        self.fences = fences
        self.quiet: Quiet | None = None
        self.pause = pause
        self.applied = self.torn = self.unknown = False
        self.failure: Exception | None = None
        self.ill: Exception | None = None
        self.queues: list[Any] = []
        self._now = now

    def run(self) -> None:
        """Run the requests; their results and errors are stored in them."""
        for request in self.requests:
            try:
                if type(request) is WriteBatch:
                    self._write(request)
                elif type(request) is WriteTogether:
                    self._write_together(request)
                elif type(request) is ReadTogether:
                    request.result = self._read_together(request)
                else:
                    request.result = self._do(request)
            except Exception as error:  # any error is the answer to the caller
                refuse(request, error)
                if self.fences is not None:
                    self.torn |= self.fences.torn
            if self.torn:  # later requests would see a part of a batch
                break
        if self.fences is not None:
            self.applied |= self.fences.applied
            self.fences.settle(self.requests)

    def alarmed(self, request: WriteBatch, applied: Applied, records: list[Record] | None) -> None:
        """Take over a batch that was applied without a trip, and about which an alarm has something to say."""
        if self.quiet is not None:
            self.fences, self.quiet = self.quiet.part(self.quiet.line, self), None
        leg = self.legs[request.name]
        leg.records = records
        assert self.fences is not None  # it was made for a hull with alarms,
        assert leg.after is not None  # which has the batch
        self.fences.wrote(leg, leg.after, applied, request.write.arrived)
        self._count(leg, applied)
        self.fences.settle(self.requests)

    def changes(self) -> list[Change]:
        """The changes to commit."""
        changes = [change for leg in self.legs.values() for change in leg.changes()]
        return changes if self.fences is None else [*changes, *self.fences.changes()]

    def landed(self, states: list[HullState | None], fences: "list[KeptFence | None]") -> bool:
        """Whether the trip was committed, given what the storage has of its hulls and of the examined fences.

        It has all changes, or none.
        """
        hulls = all(leg.landed(state) for leg, state in zip(self.legs.values(), states, strict=True))
        return hulls and (self.fences is None or self.fences.landed(fences))

    def _do(self, request: Request) -> object:
        if isinstance(request, AnyFenceRequest):
            assert self.fences is not None  # only the fences' room makes trips of them
            return self.fences.do(request)
        assert isinstance(request, HullRequest)  # batches and what names several hulls are run elsewhere
        leg = self.legs[request.name]
        match request:
            case ReadHull():
                return _read(request, leg)
            case CreateHull():
                if leg.after is not None:
                    raise HullExistsError(leg.name)
                leg.after = self._new_hull(request, leg)
                if self.fences is not None:
                    self.fences.created(leg.after, request.time)
                return leg.after
            case Expire():
                return self._expire(request, leg)
            case Follow():
                return self._follow(request, leg)
            case Recenter():
                return self._recenter(request, leg)
            case DeleteHull():
                self._delete(request, leg)
                return None
            case _:
                assert_never(request)

    def _delete(self, request: DeleteHull, leg: Leg) -> None:
        if self.fences is not None:
            self.fences.require_free(leg.name)
        if leg.after is None:
            raise HullNotFoundError(leg.name)
        if leg.after is not leg.before:
            raise AssertionError("a hull is deleted in a trip of its own")
        leg.after = None
        if self.fences is not None:
            self.fences.hull_deleted(leg.name, request.time)

    def _write(self, request: WriteBatch) -> None:
        leg = self.legs[request.write.name]
        stream, hull = request.stream, leg.after
        if stream is not None and stream.stopped:
            request.abandoned = True
            return
        if hull is None:
            if request.birth is None or (stream is not None and stream.hull is not None):
                raise HullNotFoundError(leg.name)
            hull = self._new_hull(request, leg)
        elif hull.divided:  # it is created by the same trip, so the batch came before the hull
            raise HullNotFoundError(leg.name)
        expired = None
        if (self.fences is not None or self.quiet is not None) and hull.state.contents.clock is not None:
            expired = partial(self._expired_before, hull, request.write.arrived)
        applied = write(request, hull, self._now, leg.records, expired)
        self.torn = hull.state.torn
        fences, quiet = self.fences, self.quiet
        if quiet is not None and (
            applied is None or quiet.restless or (applied.hull_changed and not quiet.still(hull))
        ):
            fences = self._fences_at(hull, request.write.arrived)
        if fences is not None:
            fences.wrote(leg, hull, applied, request.write.arrived)
        if applied is None:
            return
        leg.after = hull
        self._count(leg, applied)

    def _expired_before(self, hull: Hull, now: int) -> None:
        """Points have left a hull, as a revision of its own, before its batch."""
        fences = self._fences_at(hull, now)
        if fences is not None:
            fences.expired(hull, now)

    def _fences_at(self, hull: Hull, now: int) -> "FencePart | None":
        """What the trip does to fences, now that a hull has perhaps a new revision."""
        if self.quiet is not None and self.quiet.line.touched(hull, now):
            self.fences, self.quiet = self.quiet.part(self.quiet.line, self), None
        return self.fences

    def _write_together(self, request: WriteTogether) -> None:
        """Apply a batch to each hull. All requests of such a trip name the same hulls, perhaps in another order."""
        fences = self.fences
        ordered = [self.legs[part.name] for part in request.parts]
        hulls: list[Hull] = []
        for index, leg in enumerate(ordered):
            if leg.after is None:
                request.refused = index
                raise HullNotFoundError(leg.name)
            if leg.after.divided:
                request.refused = index
                raise HullUnsuitableError(leg.name, "is divided among shards, so no batch is over it and other hulls")
            hulls.append(leg.after)
        try:
            expired = None if fences is None else fences.expired_before
            request.result = apply_together(request, hulls, [leg.records for leg in ordered], self._now, expired)
        finally:
            self.torn = any(hull.state.torn for hull in hulls)
        for leg, applied in zip(ordered, request.result, strict=True):
            self._count(leg, applied)
        if fences is not None:
            fences.wrote_together(ordered, request.result, request.parts[0].arrived)

    def _read_together(self, request: ReadTogether) -> object:
        for hull in request.parts:
            if self.legs[hull.name].after is not hull:
                raise HullNotFoundError(hull.name)
        return [hull.state.counts for hull in request.parts], request.function([hull.state for hull in request.parts])

    def _count(self, leg: Leg, applied: Applied) -> None:
        if not applied.duplicate:
            self.applied = True
            leg.unsaved += applied.inserted + applied.moved + applied.deleted + applied.expired + len(applied.held)

    def _expire(self, request: Expire, leg: Leg) -> int:
        hull = leg.after
        if hull is None or hull is not request.hull:
            return 0
        try:
            expired = hull.state.expire(request.time, leg.records)
        finally:
            self.torn = hull.state.torn
        self.applied |= expired > 0
        leg.unsaved += expired
        if expired and self.fences is not None:
            self.fences.expired(hull, request.time)
        return expired

    def _follow(self, request: Follow, leg: Leg) -> Counts:
        hull = leg.after
        if hull is None or hull is not request.hull:
            raise HullNotFoundError(leg.name)
        state = hull.state
        assert isinstance(state, RootState)  # only they are followed
        try:
            state.follow(request.records, self._now, leg.records)
        finally:
            self.torn = state.torn
        state.due = request.due
        self.applied |= bool(request.records)
        leg.unsaved += sum(map(unsaved_of, request.records))
        return state.counts

    def _recenter(self, request: Recenter, leg: Leg) -> tuple[Counts, bool]:
        hull = leg.after
        if self.fences is not None:
            # The projection of fences and subjects stays the same; of alarms it does not.
            self.fences.require_free(leg.name, recenters=True)
        if hull is None:
            raise HullNotFoundError(leg.name)
        try:
            hull_changed = hull.state.recenter(request.center, leg.records)
        except MisfitError as misfit:
            raise HullUnsuitableError(leg.name, str(misfit), field=misfit.field) from None
        self.applied = True
        if self.fences is not None:
            self.fences.recentered(hull, request.time)
        return hull.state.counts, hull_changed

    def _new_hull(self, request: CreateHull | WriteBatch, leg: Leg) -> Hull:
        place, birth = self.places[leg.name], request.birth  # the hull is missing, so it may be created
        if place.refusal is not None:
            raise place.refusal
        assert birth is not None  # otherwise the request was refused
        settings = request.settings if isinstance(request, CreateHull) else settings_for(request.write.batch)
        if self.fences is not None:
            settings = self.fences.settled(leg.name, settings)
        row = HullRow(place.number, leg.name, birth.uid, birth.created, settings)
        hull = Hull(row, state_of(place.limits, settings, Kept(), self._now))
        if self.fences is not None:
            self.fences.admit(hull)
        return hull


def settings_for(batch: Batch | KeyedBatch) -> HullSettings:
    """The settings of a hull that its first batch creates: keyed if the batch names keys."""
    return HullSettings(batch.kind) if isinstance(batch, KeyedBatch) else DEFAULT


def _read(request: ReadHull, leg: Leg) -> object:
    hull = leg.after
    if hull is None or request.hull is not hull:
        raise HullNotFoundError(leg.name)
    return hull.state.counts, request.function(hull.state)


def write(
    request: WriteBatch,
    hull: Hull,
    now: float,
    records: list[Record] | None,
    expired: Callable[[], None] | None = None,
) -> Applied | None:
    """Apply a batch to a hull, and store the result or the error in the request. None where it was refused.

    `expired` is called after the revision of points that left before the batch.
    """
    stream = request.stream
    try:
        if stream is not None and stream.hull is not hull and stream.hull is not None:
            raise HullNotFoundError(hull.name)
        request.result = applied = hull.state.apply(request.write, now, records, expired)
    except Exception as error:  # any error is the answer to the caller
        refuse(request, error)
        return None
    if stream is not None:
        stream.hull = hull
    return applied


def unsaved_of(record: Record) -> int:
    """The points in a revision, or 1 if it is a root's: then others than vertices may have come and gone."""
    return len(record.rows) or int(record.shares is not None)


def refuse(request: Request, error: Exception) -> None:
    """Store an error in the request, and stop its stream."""
    request.error = error
    if type(request) is WriteBatch and request.stream is not None:
        request.stream.stopped = True
