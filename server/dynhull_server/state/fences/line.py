"""The fences of hulls that share a queue: what a change of one of these hulls means for them."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from dynhull import Crossings

from ..hull import Hull
from .fence import Fence
from .subjects import Subjects, lay


@dataclass(slots=True)
class AreaHull:
    """A hull that is the area of fences.

    Attributes:
        hull: the hull.
        fences: the fences by number.
        as_of: the hull's count of changes when the fences last got its vertices.
    """

    hull: Hull
    fences: dict[int, Fence] = field(default_factory=dict)
    as_of: int = -1


class Line:
    """The fences of the hulls of one queue.

    Args:
        fences: all fences that depend on one of these hulls.
        names: the names of the hulls, and of the queues of the fences.

    Attributes:
        names: the names that share the queue.
        fences: the fences by name.
        subjects: the hulls whose keys are compared, by name.
        areas: the hulls that are areas, by name.
    """

    def __init__(self, fences: Iterable[Fence], names: list[str]) -> None:
        self.names = names
        self.fences = {fence.name: fence for fence in fences}
        self.subjects: dict[str, Subjects] = {}
        self.areas: dict[str, AreaHull] = {}
        for fence in self.fences.values():
            self.subjects |= fence.subjects
            if fence.area is not None:
                area = self.areas.setdefault(fence.area.name, AreaHull(fence.area))
                area.fences[fence.number] = fence
        for area in self.areas.values():
            area.as_of = area.hull.state.hull.changes

    def weight(self, name: str) -> int:
        """The number of subjects that a change of a hull may concern beside its own rows."""
        area = self.areas.get(name)
        return 0 if area is None else sum(fence.subject_count for fence in area.fences.values())

    def changed(self, hulls: Iterable[Hull]) -> Iterator[tuple[Subjects, Crossings]]:
        """The subjects whose side has changed, now that these hulls have; who has nothing to say costs nothing."""
        touched: dict[str, Subjects] = {}
        for hull in hulls:
            name = hull.name
            subjects = self.subjects.get(name)
            if subjects is not None:
                touched[name] = subjects
            area = self.areas.get(name)
            if area is not None and area.as_of != hull.state.hull.changes:
                vertices = hull.state.vertices()
                for fence in area.fences.values():
                    for each in fence.subjects.values():
                        lay(each.index, fence.number, fence.row.config, vertices)
                    touched |= fence.subjects
                area.as_of = hull.state.hull.changes
        for subjects in touched.values():
            crossings = subjects.index.take()
            if len(crossings):
                yield subjects, crossings
