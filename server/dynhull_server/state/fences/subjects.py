"""The keys of one hull as the subjects of fences."""

from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynhull import Crossings, FenceIndex, KeyedHull
from dynhull.arrays import Points
from dynhull.globe import Gnomonic
from dynhull.keys import KeyType, PackedKeys, key_list

from ..contents.keyed import Keyed, stored_times
from ..contents.live import AnyKeyedHull
from ..hull import Hull
from ..hull_state import HullState
from ..records import Keys, Times
from .config import CircleArea, FenceConfig, HullArea
from .on_globe import metres, outline, projected, require_circle, rings_of
from .records import Key

if TYPE_CHECKING:
    from .fence import Fence


# The number of no fence, and the least distance.
SPARE, LEAST = -1, 5e-324


class Subjects:
    """The keys of a hull, and the fences that compare them.

    Args:
        hull: a keyed hull.

    Attributes:
        hull: the hull.
        index: the side of each key, for each fence by its number.
        fences: the fences by number.
        delaying: those of them in which some of the keys have delays.
    """

    def __init__(self, hull: Hull) -> None:
        self.hull = hull
        self.index = FenceIndex(indexed(hull.state))
        self.fences: dict[int, Fence] = {}
        self.delaying: set[Fence] = set()
        self.follow_state()

    def follow_state(self) -> None:
        """Let keys that leave a geographic hull by themselves say where they were."""
        contents = self.hull.state.contents
        if isinstance(contents, Keyed) and contents.mirror is not None:
            contents.mirror.inside = lambda: [self.index.inside(number) for number in self.fences]

    def dropped(self, fence: "Fence") -> None:
        """Forget a fence, which the index has dropped; without any, nothing is compared any more."""
        del self.fences[fence.number]
        self.delaying.discard(fence)
        if not self.fences:
            self.detach()

    def detach(self) -> None:
        """Compare nothing any more."""
        self.index.detach()
        contents = self.hull.state.contents
        assert isinstance(contents, Keyed)
        contents.mirror = None

    def lay(self, number: int, config: FenceConfig, vertices: Points | None) -> None:
        """Add the area of a fence, or replace it; ValueError if it is invalid."""
        lay(self.index, number, config, vertices, frame=frame_of(self.hull.state))

    def take(self, replaced: FenceConfig | None = None, area: Hull | None = None) -> Crossings:
        """The crossings since they were last taken: in degrees and metres if the hull is geographic.

        Args:
            replaced: the settings of the only fence that may have been crossed, if it has new ones.
            area: the hull that is its area, None for other areas.
        """
        crossings = self.index.take()
        contents = self.hull.state.contents
        assert isinstance(contents, Keyed)
        if contents.mirror is None:
            return crossings
        previous = contents.mirror.take_previous()
        if not len(crossings):
            return crossings
        points = contents.hull.positions(crossings.keys)
        before = np.where(np.isnan(crossings.previous), np.nan, points)
        for row, key in enumerate(key_list(crossings.keys)):
            if key in previous:
                before[row] = previous[key]
        distances = crossings.distances.copy()
        for number in np.unique(crossings.fences).tolist():
            fence = self.fences[number]
            config = fence.row.config if replaced is None else replaced
            hull = fence.area if replaced is None else area
            away = (crossings.fences == number) & (distances > 0) & (distances < np.inf)
            if away.any():
                rings = rings_of(config.area, area_vertices(config, hull))
                distances[away] = metres(rings, points[away])
        return replace(crossings, points=points, previous=before, distances=distances)

    def note_delays(self, fence: "Fence") -> None:
        """Take note whether some of the keys have delays in a fence."""
        if fence.delays is not None and fence.delays.of(self.hull.name):
            self.delaying.add(fence)
        else:
            self.delaying.discard(fence)

    def times(self, keys: Keys) -> Times | None:
        """The event times of the positions of keys, NO_TIME for a key without one; None for a hull without times."""
        contents = self.hull.state.contents
        assert isinstance(contents, Keyed)
        return stored_times(contents.hull.times(keys)) if contents.timed else None

    def distances(
        self, config: FenceConfig, area: Hull | None, keys: Keys, points: Points, outside: npt.NDArray[np.bool_]
    ) -> list[float]:
        """The distances from keys that are there to the area of a fence.

        Args:
            config: the settings of the fence.
            area: the hull that is its area, None for other areas.
            keys: n keys.
            points: (n, 2) their positions.
            outside: (n,) which of them are on the outer side; others may be outside by less than the margin.
        """
        if not config.margin and not outside.any():
            return [0.0] * len(keys)
        own = isinstance(config.area, HullArea) and config.area.without_self
        vertices = area_vertices(config, area)
        if self.hull.state.center is not None:  # there are no margins
            found = np.zeros(len(keys))
            empty = vertices is not None and not len(vertices)
            found[outside] = np.inf if empty else metres(rings_of(config.area, vertices), points[outside])
            distances: list[float] = found.tolist()
            return distances
        if own:  # each is compared with all others: so they are asked, between two changes
            index, number, bare = self.index, SPARE, replace(config, margin=LEAST, crosses=False)
        else:
            kind: KeyType = "str" if isinstance(keys, PackedKeys) else "int"
            index, number = FenceIndex(KeyedHull.from_entities(keys, points, None, kind)), 0
            bare = replace(config, margin=0.0, crosses=False)
        lay(index, number, bare, vertices, keys)  # as if all were inside: those leave that are outside
        try:
            left = index.take()
        finally:
            index.drop(number)
        far = dict(zip(key_list(left.keys), left.distances.tolist(), strict=True))
        return [far.get(key, 0.0) for key in key_list(keys)]

    def keys(self, keys: Collection[Key]) -> Keys:
        """Keys of the hull's kind, ascending."""
        if self.hull.row.settings.identity == "str":
            return PackedKeys.pack(sorted(map(str, keys), key=str.encode))
        return np.array(sorted(map(int, keys)), np.uint64)


def area_vertices(config: FenceConfig, area: Hull | None) -> Points | None:
    """The vertices of the hull that is the area of a fence, or of its layer; None for other areas."""
    return None if area is None else area.state.layer(config.area_layer)


def lay(
    index: FenceIndex,
    number: int,
    config: FenceConfig,
    vertices: Points | None,
    inside: Keys | None = None,
    frame: Gnomonic | None = None,
) -> None:
    """Add the area of a fence, or replace it.

    Args:
        index: the sides of the subjects.
        number: the number of the fence.
        config: its settings.
        vertices: the vertices of the hull that is its area, None for other areas.
        inside: the keys that are inside; None if the area decides.
        frame: the projection of the subjects of a geographic hull, None for a plane.

    Raises:
        ValueError: the area is invalid.
    """
    closed, margin, cross = config.closed, config.margin, config.crosses
    area = config.area
    if isinstance(area, HullArea):
        assert vertices is not None  # those of the area
        if frame is not None:
            vertices = outline(frame, vertices)
        index.set_hull(
            number,
            vertices,
            closed=closed,
            margin=margin,
            cross=cross,
            without_self=area.without_self,
            inside=inside,
        )
    elif frame is not None:
        if isinstance(area, CircleArea):
            require_circle(frame, area)
        rings = projected(frame, rings_of(area, None))
        index.set_polygons(number, rings, closed=closed, margin=margin, cross=cross, inside=inside)
    elif isinstance(area, CircleArea):
        index.set_circle(number, area.x, area.y, area.radius, closed=closed, margin=margin, cross=cross, inside=inside)
    else:
        polygons = rings_of(area, None)
        index.set_polygons(number, polygons, closed=closed, margin=margin, cross=cross, inside=inside)


def keyed(state: HullState) -> AnyKeyedHull:
    """The points of a keyed hull."""
    assert isinstance(state.hull, AnyKeyedHull)  # checked when the fence was created
    return state.hull


def indexed(state: HullState) -> KeyedHull:
    """The points of a keyed hull in the plane in which fences compare them."""
    assert isinstance(state.contents, Keyed)  # checked when the fence was created
    return state.contents.in_plane()


def frame_of(state: HullState) -> Gnomonic | None:
    """The projection of the points of a geographic hull that has a centre."""
    globe = state.contents.globe
    return None if globe is None else globe.frame
