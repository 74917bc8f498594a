"""The keys of one hull as the subjects of fences."""

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from dynhull import FenceIndex, KeyedHull
from dynhull.arrays import Points
from dynhull.keys import PackedKeys

from ..contents.keyed import Keyed, stored_times
from ..hull import Hull
from ..hull_state import HullState
from ..records import Keys, Times
from .config import CircleArea, FenceConfig, HullArea, Ring
from .records import Key

if TYPE_CHECKING:
    from .fence import Fence


class Subjects:
    """The keys of a hull, and the fences that compare them.

    Args:
        hull: a keyed hull.

    Attributes:
        hull: the hull.
        index: the side of each key, for each fence by its number.
        fences: the fences by number.
    """

    def __init__(self, hull: Hull) -> None:
        self.hull = hull
        self.index = FenceIndex(keyed(hull.state))
        self.fences: dict[int, Fence] = {}

    def dropped(self, fence: "Fence") -> None:
        """Forget a fence; without any, nothing is compared any more."""
        self.index.drop(fence.number)
        del self.fences[fence.number]
        if not self.fences:
            self.index.detach()

    def times(self, keys: Keys) -> Times | None:
        """The event times of the positions of keys, NO_TIME for a key without one; None for a hull without times."""
        contents = self.hull.state.contents
        assert isinstance(contents, Keyed)
        return stored_times(contents.hull.times(keys)) if contents.timed else None

    def keys(self, keys: Collection[Key]) -> Keys:
        """Keys of the hull's kind, ascending."""
        if self.hull.row.settings.identity == "str":
            return PackedKeys.pack(sorted(map(str, keys), key=str.encode))
        return np.array(sorted(map(int, keys)), np.uint64)


def lay(
    index: FenceIndex, number: int, config: FenceConfig, vertices: Points | None, inside: Keys | None = None
) -> None:
    """Add the area of a fence, or replace it.

    Args:
        index: the sides of the subjects.
        number: the number of the fence.
        config: its settings.
        vertices: the vertices of the hull that is its area, None for other areas.
        inside: the keys that are inside; None if the area decides.

    Raises:
        ValueError: the area is invalid.
    """
    closed, margin, cross = config.closed, config.margin, config.crosses
    area = config.area
    if isinstance(area, HullArea):
        assert vertices is not None  # those of the area
        index.set_hull(
            number,
            vertices,
            closed=closed,
            margin=margin,
            cross=cross,
            without_self=area.without_self,
            inside=inside,
        )
    elif isinstance(area, CircleArea):
        index.set_circle(number, area.x, area.y, area.radius, closed=closed, margin=margin, cross=cross, inside=inside)
    else:
        polygons = [[_corners(ring) for ring in polygon] for polygon in area.polygons]
        index.set_polygons(number, polygons, closed=closed, margin=margin, cross=cross, inside=inside)


def keyed(state: HullState) -> KeyedHull:
    """The points of a keyed hull."""
    assert isinstance(state.hull, KeyedHull)  # checked when the fence was created
    return state.hull


def _corners(ring: Ring) -> Points:
    return np.frombuffer(ring, "<f8").astype(np.float64).reshape(-1, 2)
