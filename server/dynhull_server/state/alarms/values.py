"""Measures of a hull, and their comparison with a bound: exact in the plane, but for the perimeter."""

from collections.abc import Callable
from typing import cast

from dynhull import globe, measure
from dynhull.arrays import Points

from .conditions import Condition

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


def value_of(vertices: Points, measured: str, *, geographic: bool) -> float:
    """A measure of the hull with these vertices, rounded."""
    if measured == "vertices":
        return float(len(vertices))
    if geographic and not len(vertices):
        return 0.0
    return (ON_THE_GLOBE if geographic else MEASURES)[measured](vertices)


def sign_of(vertices: Points, condition: Condition, *, geographic: bool) -> int:
    """The sign of a measure of the hull with these vertices, less the bound of a condition."""
    if condition.measure in EXACT and not geographic:
        return measure.compare(vertices, cast("measure.Compared", condition.measure), condition.limit)
    value = value_of(vertices, condition.measure, geographic=geographic)
    return (value > condition.limit) - (value < condition.limit)
