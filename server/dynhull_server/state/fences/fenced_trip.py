"""What a change of hulls means for their fences: the part of a trip that makes events."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from dynhull import Crossings
from dynhull.keys import key_list, take_keys

from ..batch import Applied
from ..contents.keyed import Keyed
from ..errors import HullUnsuitableError
from ..events import CreateHull, Expire, ReadHull, Request, WriteBatch, WriteTogether
from ..hull import Hull
from ..limits import FenceLimits
from ..records import Record
from ..trip import Leg, Place, Trip, write
from .delaying import NO_ROWS, delay, take_over
from .event_log import EventLog
from .fence import Fence
from .fence_leg import NOBODY, FenceLeg
from .keys_changed import KeysChanged, of_batch, of_expiry, with_expiries
from .line import Line
from .numbering import Swap, first_rows
from .records import Cause, Key, Origin
from .subjects import Subjects
from .tallies import Column, Tallies
from .transfers import carry, known_to

# The hull removes keys whose time has come; the area of a fence that is replaced does not move.
EXPIRY: Swap = Cause.REMOVED, Cause.EXPIRED
NOTHING: Mapping[str, KeysChanged] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Ground:
    """What a trip knows of fences when it begins.

    Attributes:
        lines: the lines of its queues.
        places: for hulls that the trip may create, by name.
        fences: the fences that its requests name; None for those that do not exist.
        numbers: the numbers of new fences, by name; those without one are too many.
        tallies: what is counted of fences, as of the last commit.
        limits: the limits on fences.
    """

    lines: Sequence[Line]
    places: dict[str, Place]
    fences: dict[str, Fence | None]
    numbers: dict[str, int]
    tallies: Tallies
    limits: FenceLimits


class FencedTrip(Trip):
    """Runs requests to hulls; after each revision their fences say what it means for them.

    Args:
        legs: the hulls that the requests name.
        requests: the requests to run.
        now: seconds on a monotonic clock.
        pause: seconds before the storage is examined again.
        ground: what there is of fences.

    Attributes:
        fence_legs: the fences that it changes otherwise than by events of crossings, by number.
        log: the events of crossings.
        weight: the number of subjects that it may concern beside the rows of its requests.
    """

    __slots__ = ("_by_name", "_expired", "_ground", "_journals", "fence_legs", "log", "weight")

    def __init__(self, legs: list[Leg], requests: list[Request], now: float, pause: float, ground: Ground) -> None:
        super().__init__(legs, requests, now, pause, None)
        self.fence_legs: dict[int, FenceLeg] = {}
        self.log = EventLog(ground.tallies)
        self.weight = sum(line.weight(leg.name) for line in ground.lines for leg in legs)
        self._ground = ground
        self._by_name = {leg.name: leg for leg in legs}
        self._journals: dict[str, list[Record]] = {}
        self._expired: dict[str, set[Key]] = {}

    @property
    def places(self) -> dict[str, Place]:
        """The places of the hulls that it may create."""
        return self._ground.places

    @property
    def lines(self) -> Sequence[Line]:
        """The lines of its queues."""
        return self._ground.lines

    def _leg(self, request: Request) -> Leg:
        return self._by_name[request.hull.name if isinstance(request, ReadHull) else request.name]  # type: ignore[attr-defined]

    def _apply(self, request: WriteBatch, hull: Hull, leg: Leg) -> Applied | None:
        def expired() -> None:
            self._watch([hull], request.arrived, EXPIRY, {hull.name: of_expiry(hull)})

        journal = self._journal(leg)
        applied = write(request, hull, self._now, journal, expired)
        if applied is None and hull is not leg.after:  # it was not created after all
            for line in self.lines:
                line.dismiss(hull.name)
        if applied is not None and not applied.duplicate:
            self._watch([hull], request.arrived, None, {hull.name: of_batch(hull, applied, journal)})
        return applied

    def _new_hull(self, request: CreateHull | WriteBatch, leg: Leg) -> Hull:
        if isinstance(request, CreateHull) and request.settings.divided:
            reason = "begins with the prefix of a fence, which does not compare a hull that is divided among shards"
            raise HullUnsuitableError(leg.name, reason, field="config.shards")
        self.place = self._ground.places.get(leg.name)
        try:
            hull = super()._new_hull(request, leg)
        finally:
            self.place = None
        for line in self.lines:
            line.admit(hull)
        return hull

    def _write_together(self, request: WriteTogether) -> None:
        self._expired = {}
        super()._write_together(request)
        hulls = [hull for part in request.parts if (hull := self._by_name[part.name].after) is not None]
        changed = {
            hull.name: of_batch(hull, applied, self._journals[hull.name], self._expired.get(hull.name, frozenset()))
            for hull, applied in zip(hulls, request.result, strict=True)
            if not applied.duplicate
        }
        self._watch(hulls, request.parts[0].arrived, None, changed)

    def _journal(self, leg: Leg) -> list[Record]:
        journal = self._journals[leg.name] = [] if leg.records is None else leg.records
        return journal

    def _left(self, hull: Hull) -> None:
        contents = hull.state.contents
        if isinstance(contents, Keyed):
            self._expired[hull.name] = set(contents.ended)

    def _expire(self, request: Expire, leg: Leg) -> int:
        expired = super()._expire(request, leg)
        if expired:
            self._watch([request.hull], request.time, EXPIRY, {request.name: of_expiry(request.hull)})
        return expired

    def _watch(
        self, hulls: Sequence[Hull], now: int, swap: Swap | None, changed: Mapping[str, KeysChanged] = NOTHING
    ) -> None:
        """Make the events of a change of these hulls."""
        try:
            for line in self.lines:
                alone = line.alone(hulls[0].name) if len(hulls) == 1 else None
                if alone is not None:
                    found = alone.take()
                    if len(found) or alone.delaying:
                        self._cross(alone, found, line.area_revisions(), swap, now, changed.get(alone.hull.name))
                    continue
                carried = carry(line.subjects, changed) if len(changed) > 1 else {}
                for name, origins in carried.items():
                    self._take_over(line.subjects[name], origins)
                crossed: dict[str, tuple[Subjects, Crossings | None]] = {
                    name: (line.subjects[name], None) for name in changed if name in line.subjects
                }
                crossed |= {each.hull.name: (each, crossings) for each, crossings in line.changed(hulls)}
                areas = line.area_revisions()
                for name, (subjects, crossings) in sorted(crossed.items()):
                    self._cross(subjects, crossings, areas, swap, now, changed.get(name), carried.get(name, NOBODY))
                for fence, pair, causes in line.paired(hulls):
                    self._fence_leg(fence).paired(pair, causes, now)
        except BaseException:  # an index may have lost crossings
            self._tear(hulls)
            raise

    def _cross(
        self,
        subjects: Subjects,
        crossings: Crossings | None,
        areas: Mapping[str, int],
        swap: Swap | None,
        now: int,
        changed: KeysChanged | None = None,
        origins: Mapping[Key, Origin] = NOBODY,
    ) -> None:
        """Make the events of a change of the keys of a hull, or of the areas of its fences with these revisions."""
        crossed = set()
        if crossings is not None and len(crossings):
            if changed is not None and changed.expired and swap is not EXPIRY:  # which says it of all
                crossings = with_expiries(crossings, changed.expired)
            apart = self._apart(crossings, origins)
            if apart is not None:
                starts = first_rows(crossings.fences)
                ends = np.append(starts[1:], len(crossings))
                for first, end in zip(starts[apart[starts]].tolist(), ends[apart[starts]].tolist(), strict=True):
                    fence = subjects.fences[int(crossings.fences[first])]
                    crossed.add(fence)
                    leg, rows, own = self._fence_leg(fence), slice(first, end), known_to(fence, origins)
                    if fence.delays is None:
                        leg.crossed(subjects, crossings, rows, swap, now, own)
                    else:
                        delay(leg, subjects, crossings, rows, swap, now, changed, own)
                crossings = _some(crossings, np.flatnonzero(~apart))
            if len(crossings):
                self.log.add(subjects, crossings, areas, swap, now)
        for fence in () if changed is None else list(subjects.delaying):
            if fence not in crossed:  # subjects may have reported that they stay
                leg = self._fence_leg(fence)
                delay(leg, subjects, None, NO_ROWS, None, now, changed, known_to(fence, origins))

    def _apart(self, crossings: Crossings, origins: Mapping[Key, Origin]) -> npt.NDArray[np.bool_] | None:
        """(n,) which crossings are of fences that look at each of their events; None if none is."""
        tallies, fences = self._ground.tallies, crossings.fences
        found = tallies.columns[Column.RULES, tallies.places(fences)] != 0 if tallies.ruled else None
        if self.fence_legs:
            legs = np.isin(fences, list(self.fence_legs))
            found = legs if found is None else found | legs
        if origins:
            moved = fences[[key in origins for key in key_list(crossings.keys)]]
            found = np.isin(fences, moved) if found is None else found | np.isin(fences, moved)
        return found if found is not None and found.any() else None

    def _take_over(self, subjects: Subjects, origins: Mapping[Key, Origin]) -> None:
        """Let subjects that come from other hulls bring their delays."""
        for fence in subjects.fences.values():
            if fence.delays is not None and len(fence.delays):
                own = known_to(fence, origins)
                if own:
                    take_over(self._fence_leg(fence), subjects, own)

    def _tear(self, hulls: Iterable[Hull]) -> None:
        self.torn = True
        for hull in hulls:
            hull.state.torn = True

    def _fence_leg(self, fence: Fence) -> FenceLeg:
        leg = self.fence_legs.get(fence.number)
        if leg is None:
            leg = self.fence_legs[fence.number] = FenceLeg(fence, told=self.log.last(fence.number))
        return leg


def _some(crossings: Crossings, rows: npt.NDArray[np.intp]) -> Crossings:
    columns = {each.name: getattr(crossings, each.name)[rows] for each in fields(crossings) if each.name != "keys"}
    return Crossings(**columns, keys=take_keys(crossings.keys, rows))
