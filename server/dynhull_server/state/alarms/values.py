"""What alarms see of a hull, and its comparison with a bound: exact in the plane, but for the perimeter."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from dynhull import globe, measure
from dynhull.arrays import Points
from dynhull.globe import Gnomonic
from dynhull.range_search import RangeSearch

from ..batch import NO_POINTS
from ..fences.index.globe import middle, outline, projected, require_circle, rings_of
from ..fences.index.pair import nearness
from ..fences.model.config import CircleArea, PolygonArea
from ..records import Center
from .conditions import Condition
from .places import Circle, Place, Polygon
from .rule import AlarmRule

MEASURES: dict[str, Callable[[Points], float]] = {
    "area": measure.area,
    "perimeter": measure.perimeter,
    "diameter": measure.diameter,
    "width": measure.width,
}
ON_THE_GLOBE: dict[str, Callable[[Points], float]] = {
    "area": globe.area,
    "perimeter": globe.perimeter,
    "diameter": globe.diameter,
}
EXACT = frozenset({"area", "diameter", "width"})
NO_ROWS = np.empty(0, np.intp)


class Seen(NamedTuple):
    """What an alarm compares of a hull.

    Attributes:
        vertices: the vertices of the hull; of silence, and of counts, none.
        number: of the points; of the vertices in an area; 1 if a key is a vertex, else 0.
        others: the vertices of the other hull that the rule names, if it compares distances.
        center: the centre of that hull if it is geographic.
    """

    vertices: Points = NO_POINTS
    number: int = 0
    others: Points = NO_POINTS
    center: Center | None = None


NOTHING = Seen()


def seen(rule: AlarmRule, state: Any, other: Any, *, geographic: bool) -> Seen:
    """What an alarm compares of a hull, given its state, and that of the other hull that its rule names.

    The vertices are asked of the hull: the state keeps what it gives for watches that resume.
    """
    raises = rule.raises
    if raises.measure == "count":
        return Seen(number=len(state.hull))
    if raises.measure == "vertex":
        return Seen(number=int(is_vertex(state.hull, str(raises.subject), state.hull.vertices())))
    if raises.measure == "vertex in":
        return Seen(number=len(rows_in(raises.subject, state, other, geographic=geographic)))
    if raises.measure == "near":
        return Seen(state.hull.vertices(), 0, other.hull.vertices(), other.center)
    return Seen(state.hull.vertices())


def is_vertex(hull: Any, key: str, vertices: Points) -> bool:
    """Whether a key of a hull is at one of its vertices. O(h)."""
    place = hull.positions([key if hull.key_type == "str" else int(key)])
    return bool((vertices == place).all(axis=1).any())  # NaN where there is no such key


def rows_in(place: Place, state: Any, other: Any, *, geographic: bool) -> npt.NDArray[np.intp]:
    """The rows of the vertices of a hull that are in an area: none if that is invalid where the hull is. O(h log h)."""
    try:
        corners = None if other is None else other.hull.vertices()
        center = None if other is None else other.center
        return rows_of(state.hull.vertices(), place, corners, center, geographic=geographic)
    except ValueError:  # a polygon that crosses itself on the globe, but not in the plane
        return NO_ROWS


def rows_of(
    vertices: Points, place: Place, corners: Points | None, center: Center | None, *, geographic: bool
) -> npt.NDArray[np.intp]:
    """The rows of the places that are in an area, exact in the plane. On the globe edges are great circles.

    Args:
        vertices: the places.
        place: the area.
        corners: the vertices of the other hull, if that is the area.
        center: its centre, if it is geographic.
        geographic: whether places are degrees.

    Raises:
        ValueError: the area is invalid.
    """
    if corners is not None:
        if not len(corners):
            return NO_ROWS
        if center is None:
            return RangeSearch(vertices).hull(corners)
        frame = Gnomonic(center)
        return _within_reach(frame, vertices, lambda search: search.hull(outline(frame, corners)))
    if isinstance(place, Circle):
        disk = CircleArea(place.x, place.y, place.radius)
        if not geographic:
            return RangeSearch(vertices).disk(place.x, place.y, place.radius)
        frame = Gnomonic(middle(disk, None))
        require_circle(frame, disk)
        rings = projected(frame, rings_of(disk, None))
        return _within_reach(frame, vertices, lambda search: search.polygons(rings))
    assert isinstance(place, Polygon)  # the others have corners
    ring = np.array(place.corners)
    if not geographic:
        return RangeSearch(vertices).polygons([[ring]])
    area = PolygonArea(((ring.astype("<f8").tobytes(),),))
    frame = Gnomonic(middle(area, None))
    rings = projected(frame, rings_of(area, None))
    return _within_reach(frame, vertices, lambda search: search.polygons(rings))


def require_area(place: Place, *, geographic: bool) -> None:
    """Raise ValueError if an area is invalid in the plane, or on the globe."""
    if not isinstance(place, str):
        rows_of(NO_POINTS, place, None, None, geographic=geographic)


def _within_reach(
    frame: Gnomonic, vertices: Points, find: Callable[[RangeSearch], npt.NDArray[np.intp]]
) -> npt.NDArray[np.intp]:
    """The rows that are found of the places with a projection: others are a quarter of the globe away."""
    places, near = frame.project(vertices)
    rows = np.flatnonzero(near)
    return rows[find(RangeSearch(places[rows]))]


def value_of(found: Seen, rule: AlarmRule, *, geographic: bool) -> float:
    """The measure of what is seen of a hull, rounded; infinite for the distance from an empty hull."""
    measured = rule.raises.measure
    if rule.counts:
        return float(found.number)
    if measured == "near":
        return _near(found, 0.0)[1]
    if measured == "vertices":
        return float(len(found.vertices))
    if geographic and not len(found.vertices):
        return 0.0
    return (ON_THE_GLOBE if geographic else MEASURES)[measured](found.vertices)


def holds(condition: Condition, found: Seen, rule: AlarmRule, *, geographic: bool) -> bool:
    """Whether a condition of a rule holds for what is seen of a hull."""
    if condition.measure == "near":
        return condition.holds(-1 if _near(found, condition.limit)[0] else 1)
    if condition.measure in EXACT and not geographic:
        return condition.holds(
            measure.compare(found.vertices, cast("measure.Compared", condition.measure), condition.limit)
        )
    value = value_of(found, rule, geographic=geographic)
    return condition.holds((value > condition.limit) - (value < condition.limit))


def _near(found: Seen, limit: float) -> tuple[bool, float]:
    """Whether two hulls are at most that far apart, and their distance."""
    if not (len(found.vertices) and len(found.others)):
        return False, math.inf
    return nearness(found.vertices, found.others, limit, found.center)
