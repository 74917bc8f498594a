"""The part of a trip that does what requests about fences ask for."""

from dataclasses import replace

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
from ..events import DeleteHull, Recenter, Request
from ..hull import Hull
from ..hull_state import Counts
from ..trip import Leg
from .checked import CheckedArea
from .config import FenceConfig
from .delaying import end_all, end_some
from .delays import Delays
from .fence import Fence
from .fence_leg import FenceLeg, members
from .fenced_trip import FencedTrip, Ground
from .laying import check, lay_area
from .line import Line
from .numbering import Swap
from .on_globe import require_frames
from .pair import Pair
from .records import NO_WAITS, Cause, Consumer, EventType, FenceRow, Inside, Key, Subject, Waits
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
from .subjects import Subjects

REPLACEMENT: Swap = Cause.AREA, Cause.CHANGED
# The number of subjects inside of the fences that a trip has created after which it creates no more.
MOST_INSIDE = 2**18
# The most subjects that make an event together because time has passed.
MOST_DUE = 4096
SUBJECT_FIELDS = {"hull": "subject_hull", "prefix": "subject_prefix", "other": "other_hull"}


class FenceWork(FencedTrip):
    """Runs requests about fences, too.

    Args:
        legs: the hulls that the requests name.
        requests: the requests to run.
        now: seconds on a monotonic clock.
        pause: seconds before the storage is examined again.
        ground: what there is of fences.

    Attributes:
        structural: whether it changes which hulls share a queue.
        creates: the number of fences that it creates, at most.
        left: the requests that it has left for a later trip, because the fences before them have many subjects inside.
    """

    __slots__ = ("_inside", "creates", "left", "structural")

    def __init__(self, legs: list[Leg], requests: list[Request], now: float, pause: float, ground: Ground) -> None:
        super().__init__(legs, requests, now, pause, ground)
        self.structural = isinstance(requests[0], STRUCTURAL)
        self.creates = len(requests) if isinstance(requests[0], CreateFence) else 0
        self.left: list[Request] = []
        self._inside = 0

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
                for subjects in fence.subjects.values():  # here, since it takes long with many inside
                    subjects.index.drop(fence.number)
                    self.applied = True
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
        fence.subjects = {each.hull.name: each for each in self._subjects(config, request.checked)}
        try:
            for subjects in fence.subjects.values():
                lay_area(subjects, number, config, fence.area, request.checked)
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

    def _drop(self, fence: Fence) -> None:
        """Let its subjects forget a fence that is not created after all; without any, nothing is compared any more."""
        others = [leg.fence for leg in self.fence_legs.values() if leg.created]
        for name, subjects in fence.subjects.items():
            if fence.number in subjects.index:
                subjects.index.drop(fence.number)
            if not subjects.fences and all(other.subjects.get(name) is not subjects for other in others):
                subjects.detach()

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
            check(config, area, request.checked)
        for subjects in fence.subjects.values():
            lay_area(subjects, fence.number, config, area, request.checked)
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
        _require_whole(hull)
        return hull

    def _subjects(self, config: FenceConfig, checked: CheckedArea | None) -> list[Subjects]:
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
        for each in hulls:
            if each is not None:
                _require_whole(each)
        for hull in keyed:
            require_frames(config, hull, None)
        if not keyed and config.kind == "prefix":
            check(config, self._area(config), checked)
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


def _require_whole(hull: Hull) -> None:
    if hull.divided:
        raise HullUnsuitableError(hull.name, "is divided among shards, which no fence compares")
