"""What alarms must say: their events follow from the revisions of hulls, by measures in whole numbers and fractions.

An alarm is a fence of the model, whose subjects are hulls as wholes. What it knows of each is written down here as the
documentation says it: the condition begins to hold with a revision, the alarm is raised then or once it has held for
long enough, and it is cleared by a revision that meets the other condition, or with the hull.
"""

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from functools import lru_cache
from itertools import combinations
from math import hypot, inf, isclose, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

from support.sides import Disk, Point, Rings, Shape, apart, edges, segment_distance, squared, turn

from dynhull.keys import key_list
from dynhull_server.state.alarms.conditions import Condition
from dynhull_server.state.alarms.places import Circle, Place
from dynhull_server.state.alarms.rule import AlarmRule
from dynhull_server.state.fences.model.records import AlarmStanding, Cause, Delay, EventType, FenceEvent
from dynhull_server.state.records import NO_TIME

if TYPE_CHECKING:
    from .model import Model, Truth

# Coordinates and lengths are multiples of 1 / 64.
UNIT = 64
# Callers are told the same of both.
BATCH = Cause.MOVED | Cause.APPEARED
# Values are rounded; those of perimeters within one unit in the last place per edge.
ROUNDED = 1e-12
MICROSECONDS = 10**6
MOST_KEYS = 100
# Outlines, or pairs of them, whose measures are remembered: each is asked for again at every look.
OUTLINES = 4096

At = Mapping[str, int]


class Known(NamedTuple):
    """An alarm at one hull.

    Attributes:
        raised: whether it is raised.
        holds: whether the condition holds, or has held when it was raised.
        since: since when, None if only the storage will say so.
        revision: of the hull that began it.
        causes: why it began.
        previous: the measure before it began.
        acknowledged, muted: what else is kept.
    """

    raised: bool = False
    holds: bool = False
    since: int | None = NO_TIME
    revision: int = 0
    causes: int = 0
    previous: float | None = None
    acknowledged: int = NO_TIME
    muted: int = NO_TIME

    def rest(self) -> "Known":
        """The condition holds no longer."""
        return Known(muted=self.muted)


class Change(NamedTuple):
    """What a step means for an alarm at a hull: what is known then, and the event that it makes, if any."""

    hull: str
    known: Known | None
    event: FenceEvent | None = None


def corners_of(rings: Rings) -> tuple[Point, ...]:
    return rings.polygons[0][0] if rings.polygons else ()


def _double_area(corners: tuple[Point, ...]) -> int:
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in edges(corners)) if len(corners) > 2 else 0


@lru_cache(OUTLINES)
def _square_of_width(corners: tuple[Point, ...]) -> Fraction:
    if len(corners) < 3:
        return Fraction(0)
    heights = ((max(turn(a, b, p) for p in corners), squared(a, b)) for a, b in edges(corners))
    return min(Fraction(height**2, base) for height, base in heights)


@lru_cache(OUTLINES)
def _square_of_distance(one: tuple[Point, ...], other: tuple[Point, ...]) -> Fraction:
    if not apart(one, other, 0):
        return Fraction(0)
    far = [segment_distance(p, a, b) for p in one for a, b in edges(other)]
    return min([*far, *(segment_distance(p, a, b) for p in other for a, b in edges(one))])


def _units(length: float) -> int:
    return int(length * UNIT)


def shape_of(place: Place) -> Shape:
    """An area that no hull moves."""
    if isinstance(place, Circle):
        return Disk((_units(place.x), _units(place.y)), _units(place.radius))
    assert not isinstance(place, str)
    return Rings(((tuple((_units(x), _units(y)) for x, y in place.corners),),))


def compared(measured: "Fraction | float", condition: Condition, *, square: bool) -> bool:
    """Whether a condition holds for a value, or for the square of one."""
    bound = Fraction(condition.bound)
    limit = bound**2 if square else bound
    return condition.holds((measured > limit) - (measured < limit))


class AlarmJudge:
    """Judges the events of alarms.

    Args:
        model: the model of the hulls.
        corners: the vertices of a hull at some revisions, in units.
    """

    def __init__(self, model: "Model", corners: Any) -> None:
        self._model = model
        self._corners = corners

    # Measures

    def _outline(self, name: str, at: At) -> tuple[Point, ...]:
        return corners_of(self._corners(name, at))

    def _exactly(self, condition: Condition, name: str, at: At) -> tuple[Fraction | float, bool]:
        """The measure, or its square."""
        corners = self._outline(name, at)
        match condition.measure:
            case "area":
                return Fraction(_double_area(corners), 2 * UNIT**2), False
            case "perimeter":
                return sum(hypot(a[0] - b[0], a[1] - b[1]) for a, b in edges(corners)) / UNIT, False
            case "diameter":
                return Fraction(max((squared(a, b) for a, b in combinations(corners, 2)), default=0), UNIT**2), True
            case "width":
                return _square_of_width(corners) / UNIT**2, True
            case "count":
                return Fraction(len(self._truth(name).entities_at(at[name]))), False
            case "vertices":
                return Fraction(len(corners)), False
            case "near":
                other = self._outline(str(condition.subject), at)
                return (_square_of_distance(corners, other) / UNIT**2, True) if corners and other else (inf, False)
        return Fraction(len(self._at_vertices(condition, name, at))), False

    def _at_vertices(self, condition: Condition, name: str, at: At) -> list[Point]:
        """The vertices that the condition is about."""
        corners, subject = self._outline(name, at), condition.subject
        if condition.measure == "vertex":
            truth = self._truth(name)
            key = int(str(subject)) if truth.row.settings.identity == "int" else str(subject)
            entity = truth.held[at[name]].get(key)
            return [] if entity is None else [p for p in corners if p == (_units(entity.x), _units(entity.y))]
        shape = self._corners(subject, at) if isinstance(subject, str) else shape_of(subject)
        return [p for p in corners if shape.holds(p, closed=True)]

    def holds(self, condition: Condition, name: str, at: At) -> bool:
        """Whether a condition holds for a hull."""
        measured, square = self._exactly(condition, name, at)
        return compared(measured, condition, square=square)

    def value(self, condition: Condition, name: str, at: At) -> float:
        """The measure as events have it; infinite for the distance from nothing."""
        measured, square = self._exactly(condition, name, at)
        return sqrt(measured) if square else float(measured)

    def _keys(self, condition: Condition, name: str, at: At) -> list[Any]:
        truth = self._truth(name)
        if not condition.of_vertices or truth.row.settings.identity == "multiset":
            return []
        places = {(_units(entity.x), _units(entity.y)): key for key, entity in truth.held[at[name]].items()}
        return sorted(places[p] for p in self._at_vertices(condition, name, at))

    def _truth(self, name: str) -> "Truth":
        return self._model.alive[name]

    # What a step means

    def after(
        self,
        rule: AlarmRule,
        known: Mapping[str, Known],
        hulls: Iterable[str],
        step: Mapping[str, Any],
        at: At,
        now: At,
    ) -> Iterator[Change]:
        """What a `step` means for an alarm that watches some hulls: revisions of these, or of the other one."""
        other = rule.raises.other
        for name in sorted(hulls):
            if name not in step and other not in step:
                continue
            own = 0 if name not in step else Cause.EXPIRED if self._only_expired(name, at, now) else Cause.MOVED
            cause = own | (Cause.AREA if other in step else 0)
            before = None if name not in known else at
            yield self._looked(rule, known.get(name, Known()), name, int(cause), before, now)

    def _only_expired(self, name: str, at: At, now: At) -> bool:
        revisions = range(at.get(name, 0) + 1, now[name] + 1)
        return len(revisions) > 0 and all(revision in self._truth(name).expiries for revision in revisions)

    def looked(self, rule: AlarmRule, known: Mapping[str, Known], name: str, cause: int, now: At) -> Change:
        """What a hull that comes to an alarm means for it."""
        return self._looked(rule, known.get(name, Known()), name, cause, None, now)

    def _looked(self, rule: AlarmRule, known: Known, name: str, cause: int, before: At | None, now: At) -> Change:
        began = now[name] if cause != Cause.AREA else now[rule.raises.other or ""]
        if rule.silence:
            if not known.raised or cause in (Cause.CREATED, Cause.APPEARED):
                return Change(name, known)
            return self._cleared(rule, known, name, cause, (0.0, None), began, now)
        previous = None if before is None else _finite(self.value(rule.raises, name, before))
        if known.raised:
            if not self.holds(rule.clears, name, now):
                return Change(name, known)
            return self._cleared(rule, known, name, cause, (self.value(rule.raises, name, now), previous), began, now)
        if not self.holds(rule.raises, name, now):
            return Change(name, known.rest())
        if not known.holds:
            known = Known(False, True, None, began, cause, previous, muted=known.muted)
        return Change(name, known) if rule.hold else self.raised(rule, known, name, now)

    def raised(self, rule: AlarmRule, known: Known, name: str, now: At, more: int = 0) -> Change:
        """The alarm is raised for a hull of which the condition holds."""
        raises = rule.raises
        value = rule.silence / MICROSECONDS if rule.silence else self.value(raises, name, now)
        event = _event(EventType.BEGIN, known.causes | more, name, now[name], known.revision)
        event = event._replace(distance=value, previous=_pair(known.previous, raises.limit))
        event = event._replace(event_time=NO_TIME if known.since is None else known.since)
        return Change(name, known._replace(raised=True), _with_keys(event, self._keys(raises, name, now)))

    def _cleared(
        self,
        rule: AlarmRule,
        known: Known,
        name: str,
        cause: int,
        values: tuple[float, float | None],
        began: int,
        now: At,
    ) -> Change:
        event = _event(EventType.CEASE, cause, name, now[name], began)
        event = event._replace(distance=values[0], previous=_pair(values[1], rule.clears.limit))
        return Change(name, known.rest(), event)

    def gone(self, known: Known | None, name: str, revision: int) -> Change:
        """A hull is deleted."""
        if known is None or not known.raised:
            return Change(name, None)
        event = _event(EventType.CEASE, int(Cause.REMOVED), name, revision, revision)
        return Change(name, None, event._replace(distance=inf))

    # What time means

    def by_time(
        self, rule: AlarmRule, known: Known | None, event: FenceEvent, now: At, times: tuple[float, int]
    ) -> Change | None:
        """An alarm is raised by time, as an event says, which must be right; None if it is not.

        `times` are when the alarm was made and the latest that it knows.
        """
        name = event.hull
        if event.type is not EventType.BEGIN or not event.causes & Cause.TIME or known is None or known.raised:
            return None
        if rule.silence:
            first, last = self._moved(name, now, times[0])
            if not first <= event.event_time <= last:
                return None
            known = Known(False, True, event.event_time, now[name], 0, None, muted=known.muted)
        elif not known.holds or not rule.hold:
            return None
        since = event.event_time if known.since is None else known.since
        due = since + (rule.silence or rule.hold)
        if event.time != max(due, times[1]):
            return None
        return self.raised(rule, known._replace(since=since), name, now, int(Cause.TIME))

    def _moved(self, name: str, now: At, begun: float) -> tuple[float, float]:
        """Between which times a hull has changed last, for an alarm that was made at a time.

        If commits are ahead of the server's clock, it counts from then on; so does one without batches after a restart.
        """
        first, last, commit = self._truth(name).moved[now[name]]
        return first, inf if self._model.faulty else max(last, min(commit, begun) if now[name] else begun)

    def late(self, rule: AlarmRule, known: Known, name: str, now: At, begun: float) -> float | None:
        """The time at which time raises an alarm for a hull, at the latest; None if it does not, or is not known."""
        if known.raised:
            return None
        if rule.silence:
            return self._moved(name, now, begun)[1] + rule.silence
        return known.since + rule.hold if known.holds and rule.hold and known.since is not None else None


def _event(kind: EventType, causes: int, name: str, revision: int, began: int) -> FenceEvent:
    return FenceEvent(0, kind, int(causes), name, None, revision, began, None, None, None, NO_TIME, 0)


def _finite(value: float) -> float | None:
    return value if value < inf else None


def _pair(previous: float | None, bound: float) -> tuple[float, float] | None:
    return None if previous is None else (previous, bound)


def _with_keys(event: FenceEvent, keys: list[Any]) -> FenceEvent:
    return event._replace(inside=tuple(keys))  # type: ignore[arg-type]


def _close(one: float | None, other: float | None) -> bool:
    return one == other or (one is not None and other is not None and isclose(one, other, rel_tol=ROUNDED))


def same_causes(one: int, other: int) -> bool:
    """Whether callers are told the same causes."""
    return (one & ~BATCH, bool(one & BATCH)) == (other & ~BATCH, bool(other & BATCH))


def same_event(real: FenceEvent, expected: FenceEvent) -> bool:
    """Whether an event is as expected; its sequence and time are compared elsewhere."""
    keys = [key for each in real.inside for key in key_list(each.keys)]
    revisions = {(each.hull, each.revision) for each in real.inside} - {(real.hull, real.subject_revision)}
    if sorted(keys, key=str) != sorted(expected.inside, key=str)[:MOST_KEYS] or revisions:
        return False
    if not same_causes(real.causes, expected.causes) or not _close(real.distance, expected.distance):
        return False
    if not all(map(_close, real.previous or (None, None), expected.previous or (None, None))):
        return False
    if expected.event_time not in (NO_TIME, real.event_time) or real.event_time > real.time:
        return False
    left = {"sequence": 0, "time": 0, "event_time": 0, "causes": 0, "distance": None, "previous": None, "inside": ()}
    return real._replace(**left) == expected._replace(**left)


def kept(known: Known) -> Delay | None:
    """What must be stored of an alarm at a hull."""
    standing = AlarmStanding(known.previous, known.acknowledged, known.muted)
    if not (known.holds or known.raised):
        return None if known.muted == NO_TIME else Delay(False, NO_TIME, 0, 0, AlarmStanding(muted=known.muted))
    since = NO_TIME if known.since is None else known.since
    return Delay(known.holds and not known.raised, since, known.revision, known.causes, standing)


def alike(real: Delay | None, expected: Delay | None) -> bool:
    """Whether what is known of an alarm at a hull is as expected."""
    if real is None or expected is None or real.standing is None or expected.standing is None:
        return real is expected
    return (
        same_causes(real.causes, expected.causes)
        and _close(real.standing.previous, expected.standing.previous)
        and real._replace(causes=0, standing=None) == expected._replace(causes=0, standing=None)
        and real.standing._replace(previous=None) == expected.standing._replace(previous=None)
    )
