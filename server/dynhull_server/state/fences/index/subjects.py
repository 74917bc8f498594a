"""The keys of one hull as the subjects of fences."""

from collections.abc import Collection
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynhull import FenceIndex, KeyedHull
from dynhull.arrays import Points
from dynhull.crossings import PackedCrossings, pack
from dynhull.globe import Boundary, Gnomonic, project_hull
from dynhull.keys import PackedKeys, key_list

from ...batch import NO_POINTS
from ...contents.key_rows import stored_times
from ...contents.keyed import Keyed
from ...contents.live import AnyKeyedHull
from ...hull import Hull
from ...hull_state import HullState
from ...records import Keys, Times
from ..model.config import Area, CircleArea, FenceConfig, HullArea
from ..model.records import Key
from .checked import CheckedArea
from .globe import laid_polygons, rings_of
from .keys_changed import some

if TYPE_CHECKING:
    from ..model.fence import Fence
    from ..trip.leg import FenceLeg


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
        self.index = FenceIndex(indexed(hull.state), frame_of(hull.state))
        self.fences: dict[int, Fence] = {}
        self.delaying: set[Fence] = set()
        self._boundaries: dict[int, tuple[Area, Boundary]] = {}  # of areas on the globe, for who is far away
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
        self._boundaries.pop(fence.number, None)
        if not self.fences:
            self.detach()

    def detach(self) -> None:
        """Compare nothing any more."""
        self.index.detach()
        contents = self.hull.state.contents
        assert isinstance(contents, Keyed)
        contents.mirror = None

    def lay(
        self, number: int, config: FenceConfig, vertices: Points | None, checked: CheckedArea | None = None
    ) -> None:
        """Add the area of a fence, or replace it; ValueError if it is invalid."""
        lay(self.index, number, config, vertices, frame=frame_of(self.hull.state), checked=checked)

    def take(self, replaced: FenceConfig | None = None, area: Hull | None = None) -> PackedCrossings | None:
        """The crossings since they were last taken, None for none: in degrees and metres if the hull is geographic.

        Args:
            replaced: the settings of the only fence that may have been crossed, if it has new ones.
            area: the hull that is its area, None for other areas.
        """
        packed = self.index.take_packed()
        contents = self.hull.state.contents
        assert isinstance(contents, Keyed)
        if contents.mirror is None:
            return packed
        previous, strangers = contents.mirror.take_previous()
        if packed is None:
            return None
        crossings = packed.unpack()
        if strangers:
            passed = np.array([key in strangers for key in key_list(crossings.keys)], np.bool_)
            crossings = some(crossings, np.flatnonzero((crossings.changes != 0) | ~passed))
        if not len(crossings):
            return None
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
            away = (crossings.fences == number) & (distances == np.inf)
            if away.any():
                distances[away] = self._metres(number, config, hull, points[away])
        return pack(replace(crossings, points=points, previous=before, distances=distances))

    def bring(self, source: "Subjects", keys: Collection[Key]) -> None:
        """Take over where keys of another hull, which the index has carried, were on the globe."""
        here, there = self.hull.state.contents, source.hull.state.contents
        assert isinstance(here, Keyed)
        assert isinstance(there, Keyed)
        if here.mirror is not None and there.mirror is not None:
            here.mirror.bring(there.mirror, keys)

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

    @property
    def timed(self) -> bool:
        """Whether the positions have times."""
        contents = self.hull.state.contents
        assert isinstance(contents, Keyed)
        return contents.timed

    def clear(self, leg: "FenceLeg", keys: Keys, points: Points) -> npt.NDArray[np.bool_]:
        """Which keys that are there are on their side of a fence, which has been laid, by more than their accuracy.

        Args:
            leg: the fence after the trip, one that asks for it.
            keys: n keys.
            points: (n, 2) their positions.
        """
        contents = self.hull.state.contents
        assert isinstance(contents, Keyed)
        clear = np.ones(len(keys), np.bool_)
        accuracies = contents.accuracies(keys)
        if accuracies is None:
            return clear
        rows, number, config = np.flatnonzero(accuracies), leg.row.number, leg.row.config
        if self.hull.state.center is None:
            clear[rows] = self.index.clear(number, points[rows], accuracies[rows])
        else:
            frame = frame_of(self.hull.state)
            assert frame is not None  # as there is a centre
            away = self._metres(number, config, leg.area, points[rows])
            held = self.index.distances(number, frame.project_all(points[rows])) == 0  # not so within the margin
            clear[rows] = away > accuracies[rows] + np.where(held, 0.0, config.margin)
        return clear

    def distances(self, leg: "FenceLeg", keys: Keys, points: Points, outside: npt.NDArray[np.bool_]) -> list[float]:
        """The distances from keys that are there to the area of a fence, which has been laid.

        Args:
            leg: the fence after the trip.
            keys: n keys.
            points: (n, 2) their positions.
            outside: (n,) which of them are on the outer side; others may be outside by less than the margin.
        """
        config = leg.row.config
        if not config.margin and not outside.any():
            return [0.0] * len(keys)
        distances: list[float]
        frame = frame_of(self.hull.state)
        if frame is not None:
            found = self.index.distances(leg.row.number, frame.project_all(points))
            away = found == np.inf
            if away.any():
                found[away] = self._metres(leg.row.number, config, leg.area, points[away])
            distances = found.tolist()
        else:
            distances = self.index.distances(leg.row.number, points).tolist()
        return distances

    def _metres(self, number: int, config: FenceConfig, area: Hull | None, places: Points) -> npt.NDArray[np.float64]:
        """The distances of places to the boundary of a fence on the globe, also where the index measures none."""
        known, boundary = self._boundaries.get(number, (None, None))
        if boundary is None or known is not config.area or isinstance(known, HullArea):
            boundary = Boundary(chain.from_iterable(rings_of(config.area, area_vertices(config, area))))
            self._boundaries[number] = config.area, boundary
        return boundary.distance(places)

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
    checked: CheckedArea | None = None,
) -> None:
    """Add the area of a fence, or replace it.

    Args:
        index: the sides of the subjects.
        number: the number of the fence.
        config: its settings.
        vertices: the vertices of the hull that is its area, None for other areas.
        inside: the keys that are inside; None if the area decides.
        frame: the projection of the subjects of a geographic hull, None for a plane.
        checked: the polygons of the area, if they have been checked, which counts in the same projection only.

    Raises:
        ValueError: the area is invalid.
    """
    closed, margin, cross = config.closed, config.margin, config.crosses
    area = config.area
    if isinstance(area, HullArea):
        assert vertices is not None  # those of the area
        if frame is not None:
            vertices = project_hull(frame, vertices)
        index.set_hull(
            number,
            vertices,
            closed=closed,
            margin=margin,
            cross=cross,
            without_self=area.without_self,
            inside=inside,
        )
    elif checked is not None and checked.center == (None if frame is None else frame.center):
        polygons = checked.polygons()
        index.set_polygons(number, polygons, closed=closed, margin=margin, cross=cross, inside=inside)
    elif frame is not None:
        rings = laid_polygons(frame, area, margin, anywhere=config.kind == "prefix")
        if rings:
            index.set_polygons(number, rings, closed=closed, margin=margin, cross=cross, inside=inside)
        else:
            index.set_hull(number, NO_POINTS, closed=closed, margin=margin, cross=cross, inside=inside)
    elif isinstance(area, CircleArea):
        index.set_circle(number, area.x, area.y, area.radius, closed=closed, margin=margin, cross=cross, inside=inside)
    else:
        index.set_polygons(number, rings_of(area, None), closed=closed, margin=margin, cross=cross, inside=inside)


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
