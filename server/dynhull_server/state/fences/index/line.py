"""The fences of hulls that share a queue: what a change of one of these hulls means for them."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

from dynhull.arrays import Points
from dynhull.crossings import PackedCrossings

from ...alarms.watched import Watched
from ...batch import Applied
from ...hull import Hull
from ...records import HullSettings
from ..model.fence import Fence
from ..model.records import Cause
from .pair import Pair
from .prefixes import admit, given_center, require_admissible
from .subjects import Subjects

# Finding an inner layer takes about as long as so many rows of a batch.
PEELED = 2048
# And to measure a hull for an alarm about as long as so many for each vertex.
MEASURED = 4


@dataclass(slots=True)
class AreaHull:
    """A hull that is the area of fences.

    Attributes:
        hull: the hull.
        fences: the fences by number.
        as_of: the hull's count of changes when the fences last got its vertices.
        layers: the vertices of its inner layers that fences got last, by number.
    """

    hull: Hull
    fences: dict[int, Fence] = field(default_factory=dict)
    as_of: int = -1
    layers: dict[int, Points] = field(default_factory=dict)

    @property
    def layered(self) -> bool:
        """Whether an inner layer is the area of a fence, so that any point may change it."""
        return any(fence.row.config.area_layer > 1 for fence in self.fences.values())

    def moved(self) -> Iterator[tuple[Fence, Points]]:
        """The fences whose area has perhaps changed since this was last called, with its vertices."""
        state = self.hull.state
        outline_changed, self.as_of = self.as_of != state.hull.changes, state.hull.changes
        held, self.layers = self.layers, {}
        for fence in self.fences.values():
            number = fence.row.config.area_layer
            if number > 1:
                vertices = self.layers[number] = state.layer(number)
                if vertices is not held.get(number):
                    yield fence, vertices
            elif outline_changed:
                yield fence, state.vertices()


class Line:
    """The fences of the hulls of one queue.

    Args:
        fences: all fences that depend on one of these hulls.
        names: the names of the hulls, and of the queues of the fences.

    Attributes:
        names: the names that share the queue.
        fences: the fences by name.
        subjects: the hulls whose keys are compared, by name.
        areas: the hulls that are areas of keys, by name.
        pairs: the fences that compare a hull as a whole with another one, by the names of both.
        alarms: the alarms that compare a hull, or others with it, by its name.
        restless: the number of alarms to which a batch may mean something that leaves the outline as it is.
    """

    def __init__(self, fences: Iterable[Fence], names: Iterable[str]) -> None:
        self.names = dict.fromkeys(names)
        self.fences: dict[str, Fence] = {}
        self.subjects: dict[str, Subjects] = {}
        self.areas: dict[str, AreaHull] = {}
        self.pairs: dict[str, list[Fence]] = {}
        self.alarms: dict[str, list[Fence]] = {}
        self.restless = 0
        for fence in fences:
            self.add(fence)

    def add(self, fence: Fence) -> None:
        """Add a fence that has compared the hulls as they are now."""
        self.fences[fence.name] = fence
        self.restless += _is_restless(fence)
        self.subjects.update(fence.subjects)
        for name in _looked_at(fence):
            self.alarms.setdefault(name, []).append(fence)
        if fence.pair is not None:
            for hull in (fence.pair.area, fence.pair.other):
                self.pairs.setdefault(hull.name, []).append(fence)
        elif fence.area is not None and fence.watched is None:
            area = self.areas.get(fence.area.name)
            if area is None:
                area = self.areas[fence.area.name] = AreaHull(fence.area, as_of=fence.area.state.hull.changes)
            area.fences[fence.number] = fence

    def remove(self, fence: Fence) -> None:
        """Remove a fence, after its subjects have dropped it."""
        del self.fences[fence.name]
        self.restless -= _is_restless(fence)
        for name, subjects in fence.subjects.items():
            if not subjects.fences:
                self.subjects.pop(name, None)  # or another of the fences that are removed has done it
        for name in _looked_at(fence):
            self.alarms[name].remove(fence)
            if not self.alarms[name]:
                del self.alarms[name]
        if fence.pair is not None:
            for hull in (fence.pair.area, fence.pair.other):
                self.pairs[hull.name].remove(fence)
        elif fence.area is not None and fence.watched is None:
            area = self.areas[fence.area.name]
            del area.fences[fence.number]
            if not area.fences:
                del self.areas[fence.area.name]

    def paired(self, hulls: Iterable[Hull]) -> Iterator[tuple[Fence, Pair, int]]:
        """The fences around pairs of hulls that begin or cease to be near, now that these have changed, and why."""
        for fence in {fence.number: fence for hull in hulls for fence in self.pairs.get(hull.name, ())}.values():
            pair = fence.pair
            assert pair is not None  # that of a fence in `pairs`
            area, other = pair.moved()
            if area or other:
                before = pair.near
                pair.look()
                if pair.near != before:
                    yield fence, pair, (Cause.AREA if area else 0) | (Cause.MOVED if other else 0)

    @property
    def has_only_alarms(self) -> bool:
        """Whether nothing but alarms depends on its hulls."""
        return not (self.subjects or self.areas or self.pairs)

    def stirred(self, hull: Hull, applied: Applied, now: int) -> bool:
        """Whether a batch may mean anything for one of the alarms at a hull: as a rule it does not."""
        return (applied.hull_changed or self.restless > 0) and self.touched(hull, now)

    def touched(self, hull: Hull, now: int) -> bool:
        """Whether a new revision of a hull may mean anything for one of the alarms at it: as a rule it does not."""
        name, found = hull.row.name, False
        for fence in self.alarms.get(name, ()):
            if fence.watched is not None:
                for watched in fence.watched.at(name):
                    if watched.touched(now):
                        found = True  # the others take note of the revision, too
        return found

    def stills(self, name: str) -> list[Callable[[], bool]]:
        """What is asked of the alarms at a hull after each change of its outline, as long as all say yes."""
        found = []
        for _, watched in self.watching((name,)):
            still = watched.still
            if still is None:
                return [never]
            found.append(still)
        return found

    def watching(self, names: Iterable[str]) -> Iterator[tuple[Fence, Watched]]:
        """What alarms compare after a change of the hulls with these names; something may come several times."""
        for name in names:
            for fence in self.alarms.get(name, ()):
                if fence.watched is not None:
                    for watched in fence.watched.at(name):
                        yield fence, watched

    def watching_new(self, hull: Hull) -> list[Fence]:
        """The alarms that are to watch a new hull, by their prefix."""
        found = []
        for fence in self._prefixes(hull.name):
            rule, other = fence.row.config.rule, None if fence.area is None else fence.area.row.settings
            if rule is not None and rule.suits(hull.row.settings, other):
                found.append(fence)
        return found

    def watches_new(self, name: str) -> int:
        """The number of alarms that are to watch a new hull, at most."""
        return sum(fence.watched is not None for fence in self._prefixes(name))

    def admit(self, hull: Hull) -> None:
        """Compare the keys of a new hull with the areas of the fences whose prefix its name has, and watch it."""
        fences = [fence for fence in self._prefixes(hull.name) if fence.watched is None]
        if fences and hull.row.settings.identity != "multiset":
            subjects = Subjects(hull)
            for fence in fences:
                admit(fence, subjects)
            self.subjects[hull.name] = subjects
            for fence in fences:
                subjects.fences[fence.number] = fence
                fence.subjects = fence.subjects | {hull.name: subjects}
        for fence in self.watching_new(hull):
            if fence.watched is not None:
                fence.watched.add(hull)
                self.alarms.setdefault(hull.name, []).append(fence)

    def settled(self, name: str, settings: HullSettings) -> HullSettings:
        """The settings of a new hull: a geographic one without a centre gets the middle of the first fence that has it.

        Raises HullUnsuitableError if fences over its prefix cannot compare it.
        """
        fences = [fence for fence in self._prefixes(name) if fence.watched is None]
        if settings.identity == "multiset":
            return settings
        for fence in fences:
            require_admissible(fence, name, settings)
        if not fences or not settings.geographic or settings.center is not None:
            return settings
        return replace(settings, center=given_center(fences[0], name))

    def _prefixes(self, name: str) -> list[Fence]:
        """The fences and alarms whose prefix a name has, the oldest first."""
        prefixes = [fence for fence in self.fences.values() if fence.row.config.kind == "prefix"]
        return sorted((each for each in prefixes if each.row.config.compares(name)), key=lambda each: each.number)

    def dismiss(self, name: str) -> None:
        """Forget the keys of a hull that is deleted, or was not created after all."""
        subjects = self.subjects.pop(name, None)
        if subjects is not None:
            for fence in subjects.fences.values():
                fence.subjects = {each: value for each, value in fence.subjects.items() if each != name}
        for fence in self.alarms.pop(name, ()):
            if fence.watched is not None:
                fence.watched.remove(name)

    def weight(self, name: str) -> int:
        """The number of subjects that a change of a hull may concern beside its own rows."""
        area, measured = self.areas.get(name), 0
        for fence in self.alarms.get(name, ()):
            if fence.watched is not None:
                measured += MEASURED * fence.watched.weight(name)
        if area is None:
            return measured
        return sum(fence.subject_count for fence in area.fences.values()) + (PEELED if area.layered else 0) + measured

    def comparing(self, name: str) -> list[Fence]:
        """The fences that compare the keys of a hull, and those that compare it as a whole, alarms among them."""
        subjects = self.subjects.get(name)
        pairs = [fence for fence in self.pairs.get(name, ()) if fence.row.config.subjects == name]
        pairs += [fence for fence in self.alarms.get(name, ()) if fence.row.config.area_hull != name]
        return pairs if subjects is None else [*subjects.fences.values(), *pairs]

    def alone(self, name: str) -> Subjects | None:
        """The keys of a hull, if fences compare them and nothing else of the line depends on it."""
        if (self.areas or self.pairs or self.alarms) and (
            name in self.areas or name in self.pairs or name in self.alarms
        ):
            return None
        return self.subjects.get(name)

    def area_revisions(self) -> dict[str, int]:
        """The revisions of the hulls that are areas of keys, by name."""
        return {name: area.hull.state.counts.revision for name, area in self.areas.items()} if self.areas else {}

    def changed(self, hulls: Iterable[Hull], doubting: dict[Fence, bool]) -> Iterator[tuple[Subjects, PackedCrossings]]:
        """The subjects whose side has changed, now that these hulls have; who has nothing to say costs nothing.

        Fences that may now be certain of others are added to those `doubting`, with whether their area has moved. It
        may not have, and the hull of the others has, of which a point that was inside is now a vertex.
        """
        touched: dict[str, Subjects] = {}
        for hull in hulls:
            name = hull.name
            subjects = self.subjects.get(name)
            if subjects is not None:
                touched[name] = subjects
                of_others = [each for each in subjects.delaying if each.row.config.of_others]
                doubting.update((each, False) for each in of_others if each.row.config.by_accuracy)
            area = self.areas.get(name)
            for fence, vertices in () if area is None else area.moved():
                for each in fence.subjects.values():
                    each.lay(fence.number, fence.row.config, vertices)
                    if fence in each.delaying and fence.row.config.by_accuracy:
                        doubting[fence] = True
                touched |= fence.subjects
        for _, subjects in sorted(touched.items()):
            crossings = subjects.take()
            if crossings is not None:
                yield subjects, crossings


def never() -> bool:
    """What is asked of alarms that must look at each change."""
    return False


def _is_restless(fence: Fence) -> bool:
    rule = fence.row.config.rule
    return rule is not None and not rule.of_outline


def _looked_at(fence: Fence) -> list[str]:
    """The names of the hulls after whose changes an alarm is compared."""
    if fence.watched is None:
        return []
    other = fence.watched.other
    return [*fence.watched.of, *([] if other is None else [other.name])]
