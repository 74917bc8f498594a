"""The keys of one hull as the subjects of fences."""

from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dynhull import FenceIndex, KeyedHull
from dynhull.arrays import Points
from dynhull.keys import KeyType, PackedKeys, key_list

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

    def distances(self, config: FenceConfig, area: Hull | None, keys: Keys, points: Points) -> list[float]:
        """The distances from keys that are inside of a fence to its area: positive only with a margin.

        Args:
            config: the settings of the fence, not with `without_self`.
            area: the hull that is its area, None for other areas.
            keys: n keys.
            points: (n, 2) their positions.
        """
        if not config.margin:
            return [0.0] * len(keys)
        # Without the margin those leave that are outside of the area.
        kind: KeyType = "str" if isinstance(keys, PackedKeys) else "int"
        index = FenceIndex(KeyedHull.from_entities(keys, points, None, kind))
        bare = replace(config, margin=0.0, crosses=False)
        lay(index, 0, bare, None if area is None else area.state.vertices(), keys)
        left = index.take()
        far = dict(zip(key_list(left.keys), left.distances.tolist(), strict=True))
        return [far.get(key, 0.0) for key in key_list(keys)]

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
