"""Areas laid over subjects, and the errors of those that are invalid: they name the field."""

import re

from dynhull import FenceIndex, KeyedHull
from dynhull.globe import Gnomonic

from ...errors import InvalidFenceError
from ...hull import Hull
from ...records import Center
from ..model.config import CircleArea, FenceConfig, PolygonArea
from .checked import CheckedArea
from .globe import middle
from .subjects import Subjects, area_vertices, lay

POINT_BYTES = 16
# How the library names a ring.
RING = re.compile(r"polygon (\d+)(?: ring (\d+):?)? (.*)", re.DOTALL)


def check(config: FenceConfig, area: Hull | None, checked: CheckedArea | None) -> None:
    """Raise InvalidFenceError if the area of a fence without subjects is invalid."""
    try:
        lay(FenceIndex(KeyedHull("str")), 0, config, area_vertices(config, area), checked=checked)
    except ValueError as error:
        raise _invalid(config, str(error)) from None


def center_for(config: FenceConfig, area: Hull | None, checked: CheckedArea | None) -> Center:
    """The centre that the area of a fence gives to subjects without one, or raise InvalidFenceError."""
    try:
        center = middle(config.area, area)
        index, vertices = FenceIndex(KeyedHull("str")), area_vertices(config, area)
        lay(index, 0, config, vertices, frame=Gnomonic(center), checked=checked)
    except ValueError as error:
        raise _invalid(config, str(error)) from None
    return center


def lay_area(
    subjects: Subjects, number: int, config: FenceConfig, area: Hull | None, checked: CheckedArea | None
) -> None:
    """Add the area of a fence, or replace it, or raise InvalidFenceError."""
    try:
        subjects.lay(number, config, area_vertices(config, area), checked)
    except ValueError as error:
        raise _invalid(config, str(error)) from None


def _invalid(config: FenceConfig, message: str) -> InvalidFenceError:
    """The error of an area that the library refuses."""
    named = RING.match(message)
    if isinstance(config.area, CircleArea):
        circle = f"center ({config.area.x}, {config.area.y}), radius {config.area.radius}"
        problem = message if named is None else f"the polygon that stands for it {named.group(3)}"
        return InvalidFenceError("circle_area", circle, problem)
    if named is None or not isinstance(config.area, PolygonArea):
        return InvalidFenceError("area", "", message)
    polygon, ring, problem = named.groups()
    field = f"polygon_area.polygons[{polygon}]"
    rings = config.area.polygons[int(polygon)]
    if ring is None:
        return InvalidFenceError(field, f"{len(rings)} rings", problem)
    part = "exterior" if ring == "0" else f"holes[{int(ring) - 1}]"
    return InvalidFenceError(f"{field}.{part}", f"{len(rings[int(ring)]) // POINT_BYTES} corners", problem)
