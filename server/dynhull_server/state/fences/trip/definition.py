"""Fences are created, replaced and deleted: their areas are laid over subjects, and the first events are made."""

from dataclasses import replace
from operator import attrgetter

from ...alarms.rule import AlarmRule
from ...alarms.values import require_area
from ...errors import FenceExistsError, HullNotFoundError, HullUnsuitableError, InvalidFenceError, LimitExceededError
from ...hull import Hull
from ..events.sequences import Swap
from ..index.areas import center_for, lay_area
from ..index.checked import CheckedArea
from ..index.globe import lacks_center, require_frames, require_margin
from ..index.pair import Pair
from ..index.prefixes import require_prefix
from ..index.subjects import Subjects
from ..model.config import FenceConfig
from ..model.delays import Delays
from ..model.fence import Fence
from ..model.records import NO_WAITS, Cause, EventType, FenceRow, Inside, Waits
from ..model.requests import CreateFence, DeleteFence, ReplaceFence
from .alarms import look, watched_hulls
from .comparison import Comparison, Ground
from .delayed import doubt_new, end_all
from .expected import begin, follow
from .leg import FenceLeg, members

# The area of a fence that is replaced does not move.
REPLACEMENT: Swap = Cause.AREA, Cause.CHANGED
# The number of subjects inside of the fences that a trip has created after which it creates no more.
MOST_INSIDE = 2**18
EXPECTED = attrgetter("expected", "expected_by", "expected_within")
SUBJECT_FIELDS = {"hull": "subject_hull", "prefix": "subject_prefix", "other": "other_hull"}


class Definition:
    """Creates, replaces and deletes the fences of a trip.

    Args:
        ground: what the trip begins with.
        comparison: makes its events.

    Attributes:
        left: the requests that are left for a later trip, because the fences before them have many subjects inside.
    """

    __slots__ = ("_comparison", "_ground", "_inside", "_watching", "left")

    def __init__(self, ground: Ground, comparison: Comparison) -> None:
        self.left: list[CreateFence] = []
        self._ground = ground
        self._comparison = comparison
        self._inside = self._watching = 0

    def create(self, request: CreateFence) -> Fence | None:
        """Create a fence; None if that is left for a later trip."""
        if self._inside > MOST_INSIDE:
            self.left.append(request)
            return None
        ground, config = self._ground, request.config
        if ground.fences[request.name] is not None:
            raise FenceExistsError(request.name)
        number = ground.numbers.get(request.name)
        if number is None and config.rule is not None:
            raise LimitExceededError("max_alarms", ground.limits.max_alarms)
        if number is None:
            raise LimitExceededError("max_fences", ground.limits.max_fences)
        if config.rule is not None:
            return self._create_alarm(request, number, config.rule)
        waits = _waits(config, 0, request.time)
        fence = Fence(FenceRow(number, request.name, request.birth.uid, request.birth.created, config, waits))
        fence.area = self._area(config)
        compared = self._compared(config)
        lacking = [hull for hull in compared if request.gives_center and lacks_center(config, fence.area, hull)]
        center = center_for(config, fence.area, request.checked) if lacking else None
        self._require_frames(config, fence.area, compared, request.checked, lacking)
        self._require_kind(config, compared)
        if config.kind == "other":
            assert fence.area is not None  # checked by the caller
            fence.pair = Pair(fence.area, self._hull(config.subjects), config.near)
            fence.pair.look()
        leg = FenceLeg(fence, created=True)
        try:
            self._lay(fence, [hull for hull in compared if hull not in lacking], request.checked)
            for hull in lacking:  # nothing refuses the fence any more
                self._comparison.applied = True
                hull.state.recenter(center, ground.hulls[hull.name].records)
            self._lay(fence, lacking, request.checked)
        except BaseException:
            self._drop(fence)
            raise
        self._comparison.legs[number] = leg
        doubt_new(leg, request.time)
        if config.initial == "snapshot":
            leg.summed_up(EventType.SNAPSHOT, Cause.CREATED, request.time)
        elif config.initial == "events":
            if fence.pair is not None and fence.pair.near:
                leg.paired(fence.pair, Cause.CREATED, request.time)
            for subjects in fence.subjects.values():
                leg.entered(subjects, request.time)
        else:
            leg.inside = Inside(0, tuple(members(fence)))
        begin(leg, request.time)
        return fence

    def _create_alarm(self, request: CreateFence, number: int, rule: AlarmRule) -> Fence:
        """Create an alarm, which is raised for the hulls for which its condition holds."""
        config, birth = request.config, request.birth
        fence = Fence(FenceRow(number, request.name, birth.uid, birth.created, config))
        fence.area = self._area(config)
        hulls, watching = self._watched(config, rule, fence.area), watched_hulls(fence)
        watching.other = fence.area
        leg = FenceLeg(fence, created=True)
        if self._watching + len(hulls) > self._ground.room:
            raise LimitExceededError("max_alarm_hulls", self._ground.limits.max_alarm_hulls)
        for hull in hulls:
            _require_area(hull, rule)
            look(leg, watching.add(hull, request.time), Cause.CREATED, request.time)
        self._watching += len(hulls)
        self._comparison.legs[number] = leg
        return fence

    def _watched(self, config: FenceConfig, rule: AlarmRule, area: Hull | None) -> list[Hull]:
        """The hulls that a new alarm watches, by name; `area` is the other hull that its rule names."""
        other = None if area is None else area.row.settings
        if config.kind == "prefix":
            found = [leg.after for _, leg in sorted(self._ground.hulls.items()) if config.compares(leg.name)]
            hulls = [hull for hull in found if hull is not None]
            for hull in hulls:
                _require_whole(hull)
            return [hull for hull in hulls if rule.suits(hull.row.settings, other)]
        hull = self._hull(config.subjects)
        if not rule.suits(hull.row.settings, other):
            reason = _why_unsuited(hull, rule, area)
            raise HullUnsuitableError(hull.name, f"{reason}: {rule.when!r} does not suit it", field="rule.when")
        return [hull]

    def replace(self, request: ReplaceFence, fence: Fence) -> Fence:
        """Replace the area and the settings of a fence."""
        comparison = self._comparison
        leg, config = comparison.leg(fence), request.config
        before = leg.row.config
        if config == leg.row.config:
            return fence
        if (config.kind, config.subjects) != (leg.row.config.kind, leg.row.config.subjects):
            field = SUBJECT_FIELDS[config.kind]
            raise InvalidFenceError(field, config.subjects, "the subjects of a fence stay the same")
        area = self._area(config)
        is_prefix = config.kind == "prefix"
        compared = [each.hull for each in fence.subjects.values()] if is_prefix else [self._hull(config.subjects)]
        self._require_frames(config, area, compared, request.checked)
        self._require_kind(config, compared)
        for subjects in fence.subjects.values():
            lay_area(subjects, fence.number, config, area, request.checked)
            comparison.applied = True
        if fence.pair is not None and area is not None:
            self._replace_pair(fence.pair, Pair(area, fence.pair.other, config.near), leg, request.time)
        waits = leg.row.waits
        if config.delays or fence.delays is not None:
            fence.delays = Delays(config, None if fence.delays is None else dict(fence.delays.all()))
            comparison.applied = True
        if config.dwell != leg.row.config.dwell:
            waits = _waits(config, leg.last, leg.time(request.time))
        leg.row = replace(leg.row, config=config, waits=waits)
        leg.area = area
        first = len(leg.events)
        try:
            for subjects in fence.subjects.values():
                comparison.cross(subjects, subjects.take(config, area), {}, REPLACEMENT, request.time)
            end_all(leg, request.time)
            leg.order(first)
            follow(leg, request.time)
        except BaseException:
            comparison.tear()
            raise
        if EXPECTED(config) != EXPECTED(before):
            comparison.applied = True
            begin(leg, request.time)
        return fence

    def delete(self, request: DeleteFence, fence: Fence) -> None:
        """Delete a fence."""
        leg = self._comparison.leg(fence)
        leg.summed_up(EventType.CLOSED, 0, request.time)
        leg.deleted = True
        for subjects in fence.subjects.values():  # here, since it takes long with many inside
            subjects.index.drop(fence.number)
            self._comparison.applied = True

    def undo(self) -> None:
        """Forget fences that were not created after all."""
        legs = self._comparison.legs
        for number in [number for number, leg in legs.items() if leg.created]:
            self._drop(legs.pop(number).fence)

    def _drop(self, fence: Fence) -> None:
        """Let its subjects forget a fence that is not created after all; without any, nothing is compared any more."""
        others = [leg.fence for leg in self._comparison.legs.values() if leg.created]
        for name, subjects in fence.subjects.items():
            if fence.number in subjects.index:
                subjects.index.drop(fence.number)
            subjects.delaying.discard(fence)
            if not subjects.fences and all(other.subjects.get(name) is not subjects for other in others):
                subjects.detach()

    def _replace_pair(self, before: Pair, pair: Pair, leg: FenceLeg, now: int) -> None:
        self._comparison.applied = True
        pair.look()
        leg.pair = pair
        if pair.near != before.near:
            leg.paired(pair, Cause.CHANGED, now)

    def _area(self, config: FenceConfig) -> Hull | None:
        """The hull that is the area; raises HullNotFoundError."""
        name = config.area_hull
        return None if name is None else self._hull(name)

    def _hull(self, name: str) -> Hull:
        hull = self._ground.hulls[name].after
        if hull is None:
            raise HullNotFoundError(name)
        _require_whole(hull)
        return hull

    def _lay(self, fence: Fence, compared: list[Hull], checked: CheckedArea | None) -> None:
        """Compare the keys of some hulls with the area of a new fence."""
        config = fence.row.config
        for subjects in self._subjects(compared, config):
            fence.subjects[subjects.hull.name] = subjects
            lay_area(subjects, fence.number, config, fence.area, checked)
            self._inside += subjects.index.count(fence.number)

    def _require_frames(
        self,
        config: FenceConfig,
        area: Hull | None,
        compared: list[Hull],
        checked: CheckedArea | None,
        lacking: list[Hull] | None = None,
    ) -> None:
        """Refuse a fence because of the frames of its hulls; those that are `lacking` a centre will have one."""
        if config.kind == "prefix":
            require_prefix(config, area, compared, checked, lacking or ())
        elif lacking:
            require_margin(config)
        else:
            require_frames(config, area, compared[0])

    def _require_kind(self, config: FenceConfig, compared: list[Hull]) -> None:
        """Raise InvalidFenceError if a hull cannot have a key that is expected in it."""
        for hull in compared if config.kind == "hull" else ():
            kind = str if hull.row.settings.identity == "str" else int
            for row, key in enumerate(config.expected):
                if not isinstance(key, kind):
                    raise InvalidFenceError(f"expected[{row}]", repr(key), f"is no key that {hull.name!r} can have")

    def _compared(self, config: FenceConfig) -> list[Hull]:
        """The hulls that a fence compares, those with a prefix by name: the keyed ones."""
        if config.kind != "prefix":
            return [self._hull(config.subjects)]
        found = [leg.after for _, leg in sorted(self._ground.hulls.items()) if config.compares(leg.name)]
        hulls = [hull for hull in found if hull is not None]
        for hull in hulls:
            _require_whole(hull)
        return [hull for hull in hulls if hull.row.settings.identity != "multiset"]

    def _subjects(self, compared: list[Hull], config: FenceConfig) -> list[Subjects]:
        """What a new fence compares with its area: the keys of hulls."""
        if config.kind == "other":
            return []
        known = {name: subjects for line in self._ground.lines for name, subjects in line.subjects.items()}
        for leg in self._comparison.legs.values():
            known |= leg.fence.subjects
        for hull in compared:
            if hull.row.settings.identity == "multiset":
                raise HullUnsuitableError(hull.name, "has points without keys", field="config.subject_hull")
        return [known.get(hull.name) or Subjects(hull) for hull in compared]


def _waits(config: FenceConfig, sequence: int, time: int) -> Waits:
    return Waits(sequence, time) if config.dwell else NO_WAITS


def _require_whole(hull: Hull) -> None:
    if hull.divided:
        raise HullUnsuitableError(hull.name, "is divided among shards, which no fence compares")


def _require_area(hull: Hull, rule: AlarmRule) -> None:
    """Raise HullUnsuitableError if the area of a rule is invalid where the hull is."""
    if rule.raises.measure == "vertex in":
        try:
            require_area(rule.raises.subject, geographic=hull.row.settings.geographic)
        except ValueError as error:
            reason = f"{_frame(hull)}: {rule.when!r} does not suit it: {error}"
            raise HullUnsuitableError(hull.name, reason, field="rule.when") from None


def _frame(hull: Hull) -> str:
    return "is geographic" if hull.row.settings.geographic else "is a plane"


def _why_unsuited(hull: Hull, rule: AlarmRule, area: Hull | None) -> str:
    settings, frame = hull.row.settings, _frame(hull)
    if area is not None and area.row.settings.geographic != settings.geographic:
        return f"{frame}, and {area.name!r} is not"
    if rule.raises.measure == "vertex":
        keys = {"multiset": "has points without keys", "int": "has keys that are integers"}
        return keys.get(settings.identity, frame)
    return f"{frame}, where hulls have no width" if settings.geographic else frame
