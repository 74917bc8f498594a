"""A trip on hulls with fences: its batches, and the events that follow from them, are committed together."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from dynhull import Crossings, FenceIndex, KeyedHull
from dynhull.keys import key_list, take_keys

from ..batch import Applied
from ..changes import Change
from ..contents.keyed import Keyed
from ..errors import (
    ConsumerNotFoundError,
    FenceExistsError,
    FenceNotFoundError,
    FenceReplacedError,
    HullFencedError,
    HullNotFoundError,
    HullUnsuitableError,
    InvalidFenceError,
    LimitExceededError,
    SequenceAheadError,
)
from ..events import CreateHull, DeleteHull, Expire, ReadHull, Recenter, Request, WriteBatch, WriteTogether
from ..hull import Hull
from ..hull_state import Counts, HullState
from ..limits import FenceLimits
from ..records import KeyRows, Record
from ..trip import Leg, Place, Trip, write
from .config import CircleArea, FenceConfig, PolygonArea
from .delaying import NO_ROWS, KeysChanged, delay, end_all, end_some, take_over
from .delays import Delays
from .event_block import EventBlock, block_of, joined
from .event_log import EventLog, Swap, first_rows
from .fence import Fence
from .fence_leg import NOBODY, FenceLeg, members
from .line import Line
from .on_globe import require_frames
from .pair import Pair
from .records import (
    NO_WAITS,
    AppendEvents,
    Cause,
    Consumer,
    EventType,
    FenceRow,
    Inside,
    KeptFence,
    Key,
    Origin,
    Subject,
    Waits,
)
from .requests import (
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
from .subjects import Subjects, lay
from .tallies import Column, Tallies
from .transfers import carry, known_to

POINT_BYTES = 16
# The hull removes keys whose time has come; the area of a fence that is replaced does not move.
EXPIRY: Swap = Cause.REMOVED, Cause.EXPIRED
REPLACEMENT: Swap = Cause.AREA, Cause.CHANGED
# The number of subjects inside of the fences that a trip has created after which it creates no more.
MOST_INSIDE = 2**18
# The most subjects that make an event together because time has passed.
MOST_DUE = 4096
NOTHING: Mapping[str, KeysChanged] = MappingProxyType({})
# How the library names a ring.
RING = re.compile(r"polygon (\d+)(?: ring (\d+):?)? (.*)", re.DOTALL)
SUBJECT_FIELDS = {"hull": "subject_hull", "prefix": "subject_prefix", "other": "other_hull"}


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


class LineTrip(Trip):
    """Runs requests in order; after each revision the fences say what it means for them.

    Args:
        legs: the hulls that the requests name.
        requests: the requests to run.
        now: seconds on a monotonic clock.
        pause: seconds before the storage is examined again.
        ground: what there is of fences.

    Attributes:
        fence_legs: the fences that it changes otherwise than by events of crossings, by number.
        log: the events of crossings.
        events: all events that it has made, also the last ones of fences that it deletes; None for none.
        examined: the numbers of the fences that are examined after a failure.
        structural: whether it changes which hulls share a queue.
        creates: the number of fences that it creates, at most.
        left: the requests that it has left for a later trip, because the fences before them have many subjects inside.
        weight: the number of subjects that it may concern beside the rows of its requests.
    """

    __slots__ = (
        "_by_name",
        "_expired",
        "_ground",
        "_inside",
        "_journals",
        "creates",
        "events",
        "examined",
        "fence_legs",
        "left",
        "log",
        "structural",
        "weight",
    )

    def __init__(self, legs: list[Leg], requests: list[Request], now: float, pause: float, ground: Ground) -> None:
        super().__init__(legs, requests, now, pause, None)
        self.fence_legs: dict[int, FenceLeg] = {}
        self.log = EventLog(ground.tallies)
        self.events: EventBlock | None = None
        self._ground = ground
        self._by_name = {leg.name: leg for leg in legs}
        self._journals: dict[str, list[Record]] = {}
        self._expired: dict[str, set[Key]] = {}
        self.examined: list[int] = []
        self.structural = isinstance(requests[0], STRUCTURAL)
        self.creates = len(requests) if isinstance(requests[0], CreateFence) else 0
        self.left: list[Request] = []
        self._inside = 0
        self.weight = sum(line.weight(leg.name) for line in ground.lines for leg in legs)

    def run(self) -> None:
        """Run the requests."""
        super().run()
        self.log.settle()
        self.events = self._block(self.fence_legs.values())
        if self.left:
            del self.requests[-len(self.left) :]

    @property
    def places(self) -> dict[str, Place]:
        """The places of the hulls that it may create."""
        return self._ground.places

    @property
    def lines(self) -> Sequence[Line]:
        """The lines of its queues."""
        return self._ground.lines

    def changes(self) -> list[Change]:
        """The changes to commit."""
        legs = self.fence_legs.values()
        stored = self.events
        if any(leg.deleted for leg in legs):
            stored = self._block([leg for leg in legs if not leg.deleted])
        return [
            *(change for leg in self.legs for change in leg.changes()),
            *(change for leg in legs for change in leg.settings()),
            *([] if stored is None else [AppendEvents(stored)]),
            *(change for leg in legs for change in leg.changes()),
        ]

    def _block(self, legs: Iterable[FenceLeg]) -> EventBlock | None:
        """The events of crossings, then those of these legs; None for none."""
        crossed, of_legs = self.log.block(), {leg.fence.number: leg.events for leg in legs if leg.events}
        found = [crossed] if crossed is not None else []
        if of_legs:
            found.append(block_of(of_legs))
        return joined(found) if found else None

    def touched(self) -> dict[str, Subjects]:
        """The hulls by name whose subjects may differ from what the storage has, if the trip is not committed.

        An examination reads all hulls of the trip anew, also those that it has not changed.
        """
        touched: dict[str, Subjects] = {}
        for line in self.lines:
            for name in self._by_name:
                if name in line.subjects:
                    touched[name] = line.subjects[name]
                if name in line.areas:
                    for fence in line.areas[name].fences.values():
                        touched |= fence.subjects
        for leg in self.fence_legs.values():
            if not leg.created:
                touched |= leg.fence.subjects
        for each in self.legs:
            if each.before is None:  # a hull that is created has none in the storage
                touched.pop(each.name, None)
        return touched

    def landed(self, states: list[HullState | None], fences: list[KeptFence | None]) -> bool:
        """Whether the trip was committed, given what the storage has of its hulls and the examined fences."""
        found = dict(zip(self.examined, fences, strict=True))
        if not super().landed(states, fences):
            return False
        told = self.log.told
        lasts = {} if told is None else dict(zip(told.fences.tolist(), told.lasts.tolist(), strict=True))
        kept = ((found[number], last) for number, last in lasts.items() if number not in self.fence_legs)
        return all(leg.landed(found[number]) for number, leg in self.fence_legs.items()) and all(
            each is not None and each.last == last for each, last in kept
        )

    def pairs(self) -> set[int]:
        """The numbers of the fences that compare its hulls as wholes."""
        return {fence.number for line in self.lines for name in self._by_name for fence in line.pairs.get(name, ())}

    def dismiss(self) -> None:
        """Forget the subjects of hulls that it has deleted."""
        for leg in self.legs:
            if leg.before is not None and leg.after is None:
                for line in self.lines:
                    line.dismiss(leg.name)

    def undo_created(self) -> None:
        """Forget fences and hulls that were not created after all."""
        for each in self.legs:
            if each.before is None:
                for line in self.lines:
                    line.dismiss(each.name)
        for number in [number for number, leg in self.fence_legs.items() if leg.created]:
            self._drop(self.fence_legs.pop(number).fence)

    def _drop(self, fence: Fence) -> None:
        """Let its subjects forget a fence that is not created after all; without any, nothing is compared any more."""
        others = [leg.fence for leg in self.fence_legs.values() if leg.created]
        for name, subjects in fence.subjects.items():
            if fence.number in subjects.index:
                subjects.index.drop(fence.number)
            if not subjects.fences and all(other.subjects.get(name) is not subjects for other in others):
                subjects.detach()

    # Hulls

    def _leg(self, request: Request) -> Leg:
        return self._by_name[request.hull.name if isinstance(request, ReadHull) else request.name]  # type: ignore[attr-defined]

    def _apply(self, request: WriteBatch, hull: Hull, leg: Leg) -> Applied | None:
        def expired() -> None:
            self._watch([hull], request.arrived, EXPIRY, {hull.name: _keys_expired(hull)})

        journal = self._journal(leg)
        applied = write(request, hull, self._now, journal, expired)
        if applied is None and hull is not leg.after:  # it was not created after all
            for line in self.lines:
                line.dismiss(hull.name)
        if applied is not None and not applied.duplicate:
            self._watch([hull], request.arrived, None, {hull.name: _keys_changed(hull, applied, journal)})
        return applied

    def _new_hull(self, request: CreateHull | WriteBatch, leg: Leg) -> Hull:
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
            hull.name: _keys_changed(hull, applied, self._journals[hull.name], self._expired.get(hull.name, ()))
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
            self._watch([request.hull], request.time, EXPIRY, {request.name: _keys_expired(request.hull)})
        return expired

    def _watch(
        self, hulls: Sequence[Hull], now: int, swap: Swap | None, changed: Mapping[str, KeysChanged] = NOTHING
    ) -> None:
        """Make the events of a change of these hulls."""
        try:
            for line in self.lines:
                carried = carry(line.subjects, changed) if len(changed) > 1 else {}
                for name, origins in carried.items():
                    self._take_over(line.subjects[name], origins)
                crossed: dict[str, tuple[Subjects, Crossings | None]] = {
                    name: (line.subjects[name], None) for name in changed if name in line.subjects
                }
                crossed |= {each.hull.name: (each, crossings) for each, crossings in line.changed(hulls)}
                areas = {name: area.hull.state.counts.revision for name, area in line.areas.items()}
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
            if changed is not None and changed.expired:
                crossings = _with_expiries(crossings, changed.expired)
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

    def _do(self, request: Request) -> object:
        if isinstance(request, FenceRequest):
            return self._do_fence(request)
        if isinstance(request, DeleteHull):
            self._refuse_deletion(request.name)
            super()._do(request)
            for line in self.lines:
                self._delete_subjects(line, request)
            return None
        return super()._do(request)

    def _recenter(self, request: Recenter, leg: Leg) -> tuple[Counts, bool]:
        self._refuse_deletion(request.name)  # the projection of fences and subjects stays the same
        return super()._recenter(request, leg)

    def _refuse_deletion(self, name: str) -> None:
        """Raise HullFencedError if a fence depends on the hull, other than by a prefix."""
        for line in self.lines:
            for fence in line.fences.values():
                config = fence.row.config
                if name == config.area_hull or (config.kind != "prefix" and name == config.subjects):
                    raise HullFencedError(name, fence.name)

    def _delete_subjects(self, line: Line, request: DeleteHull) -> None:
        """The keys of a deleted hull leave the fences with its prefix."""
        subjects = line.subjects.get(request.name)
        if subjects is not None:
            for fence in subjects.fences.values():
                leg = self._fence_leg(fence)
                keys = fence.keys_inside(subjects)
                for key in () if fence.delays is None else list(fence.delays.of(request.name)):
                    leg.put_delay((request.name, key), None)
                    self.applied = True
                leg.left(subjects, keys, int(Cause.REMOVED), request.time)

    # Fences

    def _do_fence(self, request: FenceRequest) -> object:
        if isinstance(request, CreateFence):
            if self._inside > MOST_INSIDE:
                self.left.append(request)
                return None
            return self._create(request)
        fence = self._ground.fences[request.name]
        if fence is None:
            if isinstance(request, DropEvents):
                return None
            if isinstance(request, PassTime):
                return 0
            raise FenceNotFoundError(request.name)
        match request:
            case ReadFence():
                leg, made = self.fence_legs.get(fence.number), self.log.events(fence.number)
                return request.function(fence, made if leg is None else [*made, *leg.events])
            case ReplaceFence():
                return self._replace(request, fence)
            case DeleteFence():
                leg = self._fence_leg(fence)
                leg.summed_up(EventType.CLOSED, 0, request.time)
                leg.deleted = True
                return None
            case PutConsumer():
                return self._put_consumer(request, self._fence_leg(fence))
            case DropConsumer():
                leg = self._fence_leg(fence)
                if request.consumer not in leg.consumers:
                    raise ConsumerNotFoundError(fence.name, request.consumer)
                leg.consumers = {name: each for name, each in leg.consumers.items() if name != request.consumer}
                return None
            case PassTime():
                self._pass_time(request, fence)
                return 0
            case DropEvents():
                self._drop_events(request, fence)
                return None
        raise AssertionError(f"not a request: {request}")

    def _create(self, request: CreateFence) -> Fence:
        ground, config = self._ground, request.config
        if ground.fences[request.name] is not None:
            raise FenceExistsError(request.name)
        number = ground.numbers.get(request.name)
        if number is None:
            raise LimitExceededError("max_fences", ground.limits.max_fences)
        row = FenceRow(
            number,
            request.name,
            request.birth.uid,
            request.birth.created,
            config,
            _waits(config, 0, request.time),
        )
        fence = Fence(row)
        fence.area = self._area(config)
        require_frames(config, fence.area, None if config.kind == "prefix" else self._hull(config.subjects))
        if config.kind == "other":
            assert fence.area is not None  # checked by the caller
            fence.pair = Pair(fence.area, self._hull(config.subjects), config.near)
            fence.pair.look()
        leg = FenceLeg(fence, created=True)
        fence.subjects = {each.hull.name: each for each in self._subjects(config)}
        try:
            for subjects in fence.subjects.values():
                _lay(subjects, number, config, fence.area)
                self._inside += subjects.index.count(number)
        except BaseException:
            self._drop(fence)
            raise
        self.fence_legs[number] = leg
        if config.initial == "snapshot":
            leg.summed_up(EventType.SNAPSHOT, Cause.CREATED, request.time)
        elif config.initial == "events":
            if fence.pair is not None and fence.pair.near:
                leg.paired(fence.pair, Cause.CREATED, request.time)
            for subjects in fence.subjects.values():
                leg.entered(subjects, request.time)
        else:
            leg.inside = Inside(0, tuple(members(fence)))
        return fence

    def _replace(self, request: ReplaceFence, fence: Fence) -> Fence:
        leg, config = self._fence_leg(fence), request.config
        if config == leg.row.config:
            return fence
        if (config.kind, config.subjects) != (leg.row.config.kind, leg.row.config.subjects):
            field = SUBJECT_FIELDS[config.kind]
            raise InvalidFenceError(field, config.subjects, "the subjects of a fence stay the same")
        area = self._area(config)
        require_frames(config, area, None if config.kind == "prefix" else self._hull(config.subjects))
        if not fence.subjects and config.kind == "prefix":  # nobody is there to refuse an invalid area
            _check(config, area)
        for subjects in fence.subjects.values():
            _lay(subjects, fence.number, config, area)
            self.applied = True
        if fence.pair is not None and area is not None:
            self._replace_pair(fence.pair, Pair(area, fence.pair.other, config.near), leg, request.time)
        waits = leg.row.waits
        if config.delays or fence.delays is not None:
            fence.delays = Delays(config, None if fence.delays is None else dict(fence.delays.all()))
            self.applied = True
        if config.dwell != leg.row.config.dwell:
            waits = _waits(config, leg.last, leg.time(request.time))
        leg.row = replace(leg.row, config=config, waits=waits)
        leg.area = area
        try:
            for subjects in fence.subjects.values():
                self._cross(subjects, subjects.take(config, area), {}, REPLACEMENT, request.time)
            end_all(leg, request.time)
        except BaseException:
            self._tear(())
            raise
        return fence

    def _replace_pair(self, before: Pair, pair: Pair, leg: FenceLeg, now: int) -> None:
        self.applied = True
        pair.look()
        leg.pair = pair
        if pair.near != before.near:
            leg.paired(pair, Cause.CHANGED, now)

    def _area(self, config: FenceConfig) -> Hull | None:
        """The hull that is the area; raises HullNotFoundError."""
        name = config.area_hull
        return None if name is None else self._hull(name)

    def _hull(self, name: str) -> Hull:
        hull = self._by_name[name].after
        if hull is None:
            raise HullNotFoundError(name)
        return hull

    def _subjects(self, config: FenceConfig) -> list[Subjects]:
        """The hulls whose keys a new fence compares, by name."""
        known = {name: subjects for line in self.lines for name, subjects in line.subjects.items()}
        for leg in self.fence_legs.values():
            known |= leg.fence.subjects
        if config.kind == "hull":
            hull = self._hull(config.subjects)
            if hull.row.settings.identity == "multiset":
                raise HullUnsuitableError(hull.name, "has points without keys", field="config.subject_hull")
            return [known.get(hull.name) or Subjects(hull)]
        hulls = [leg.after for _, leg in sorted(self._by_name.items()) if config.compares(leg.name)]
        keyed = [hull for hull in hulls if hull is not None and hull.row.settings.identity != "multiset"]
        for hull in keyed:
            require_frames(config, hull, None)
        if not keyed and config.kind == "prefix":
            _check(config, self._area(config))
        return [known.get(hull.name) or Subjects(hull) for hull in keyed]

    def _pass_time(self, request: PassTime, fence: Fence) -> None:
        """Make the events for which time has passed, in the order of hulls and keys."""
        if fence is not request.fence:
            return
        self._end_delays(request, fence)
        made = self.fence_legs.get(fence.number)
        # The events of this trip come after those that `dwelling` knows.
        changed = set() if made is None else {event.former for event in made.events if event.key is not None}
        waited: dict[str, dict[Key, tuple[EventType, int, int]]] = {}
        due = () if fence.dwelling is None else fence.dwelling.due(request.time - fence.row.config.dwell, MOST_DUE)
        for (hull, key), since in due:
            if (hull, key) not in changed:
                waited.setdefault(hull, {})[key] = EventType.DWELL, int(Cause.TIME), since
        for hull, keys in sorted(waited.items()):
            self._fence_leg(fence).report(fence.subjects[hull], keys, request.time)

    def _end_delays(self, request: PassTime, fence: Fence) -> None:
        ripe: dict[str, list[Subject]] = {}
        for subject in () if fence.delays is None else fence.delays.due(request.time, MOST_DUE):
            ripe.setdefault(subject[0], []).append(subject)
        for hull, found in sorted(ripe.items()):
            self.applied = True
            end_some(self._fence_leg(fence), fence.subjects[hull], found, Cause.TIME, request.time)

    def _put_consumer(self, request: PutConsumer, leg: FenceLeg) -> Consumer:
        fence = leg.fence
        if request.uid and request.uid != fence.row.uid:
            raise FenceReplacedError(fence.name, fence.row.uid)
        known = leg.consumers.get(request.consumer)
        if known is None and len(leg.consumers) >= self._ground.limits.max_fence_consumers:
            raise LimitExceededError("max_fence_consumers", self._ground.limits.max_fence_consumers)
        if request.sequence is not None and request.sequence > leg.last:
            raise SequenceAheadError("sequence", request.sequence, leg.last)
        acknowledged = leg.first - 1 if known is None else known.acknowledged
        lost = 0 if known is None else known.lost
        consumer = Consumer(request.consumer, max(acknowledged, request.sequence or 0), lost)
        if consumer != known:
            leg.acknowledge(consumer)
        return consumer

    def _drop_events(self, request: DropEvents, fence: Fence) -> None:
        leg = self._fence_leg(fence)
        if fence is not request.fence or request.first <= leg.first:
            return
        dropped = request.first - 1
        for name, consumer in leg.consumers.items():
            lost = dropped - max(consumer.acknowledged, leg.first - 1)
            if lost > 0:
                leg.acknowledge(Consumer(name, consumer.acknowledged, consumer.lost + lost))
        leg.first = request.first


def _waits(config: FenceConfig, sequence: int, time: int) -> Waits:
    return Waits(sequence, time) if config.dwell else NO_WAITS


def _keys_changed(
    hull: Hull, applied: Applied, journal: Sequence[Record], expired: Collection[Key] = ()
) -> KeysChanged:
    """What an applied batch, the last one of the journal, has done to keys."""
    rows = journal[-1].rows
    fewer = hull.row.settings.window is not None and (applied.evicted or applied.expired)
    return KeysChanged(rows if isinstance(rows, KeyRows) else None, expired, bool(fewer))


def _keys_expired(hull: Hull) -> KeysChanged:
    """What an expiry has done to keys."""
    contents = hull.state.contents
    ended = contents.ended if isinstance(contents, Keyed) else ()
    return KeysChanged(None, ended, hull.row.settings.window is not None)


def _with_expiries(crossings: Crossings, expired: Collection[Key]) -> Crossings:
    """The crossings; keys whose time had come were not removed by the batch that followed at once."""
    gone = np.flatnonzero(crossings.causes & Cause.REMOVED)
    ended = gone[[crossings.keys[row] in expired for row in gone.tolist()]] if len(gone) else gone
    causes = crossings.causes.copy()
    causes[ended] ^= np.uint8(Cause.REMOVED | Cause.EXPIRED)
    return replace(crossings, causes=causes)


def _some(crossings: Crossings, rows: npt.NDArray[np.intp]) -> Crossings:
    columns = {each.name: getattr(crossings, each.name)[rows] for each in fields(crossings) if each.name != "keys"}
    return Crossings(**columns, keys=take_keys(crossings.keys, rows))


def _check(config: FenceConfig, area: Hull | None) -> None:
    """Raise InvalidFenceError if the area of a fence without subjects is invalid."""
    try:
        lay(FenceIndex(KeyedHull("str")), 0, config, None if area is None else area.state.vertices())
    except ValueError as error:
        raise _invalid(config, str(error)) from None


def _lay(subjects: Subjects, number: int, config: FenceConfig, area: Hull | None) -> None:
    vertices = None if area is None else area.state.vertices()
    try:
        subjects.lay(number, config, vertices)
    except ValueError as error:
        raise _invalid(config, str(error)) from None


def _invalid(config: FenceConfig, message: str) -> InvalidFenceError:
    """The error of an area that the library refuses."""
    named = RING.match(message)
    if isinstance(config.area, CircleArea):
        circle = f"center ({config.area.x}, {config.area.y}), radius {config.area.radius}"
        problem = message if named is None else f"the polygon that stands for it {named.group(3)}"
        return InvalidFenceError("circle_area", circle, problem)
    if named is None or not isinstance(config.area, PolygonArea):
        return InvalidFenceError("area", "", message)
    polygon, ring, problem = named.groups()
    field = f"polygon_area.polygons[{polygon}]"
    rings = config.area.polygons[int(polygon)]
    if ring is None:
        return InvalidFenceError(field, f"{len(rings)} rings", problem)
    part = "exterior" if ring == "0" else f"holes[{int(ring) - 1}]"
    return InvalidFenceError(f"{field}.{part}", f"{len(rings[int(ring)]) // POINT_BYTES} corners", problem)
