"""Polygons of areas that are checked before a fence is laid, so that other changes do not wait meanwhile."""

from collections.abc import Sequence
from dataclasses import dataclass

from dynhull.globe import Gnomonic
from dynhull.polygons import CheckedPolygons

from ...frames import Globe
from ...records import Center
from ..model.config import PolygonArea
from .globe import middle, projected, rings_of


@dataclass(frozen=True, slots=True)
class CheckedArea:
    """What a check of polygons has found.

    Attributes:
        center: that of the projection in which they were checked; None for a plane.
        found: the polygons there, or why they are invalid.
    """

    center: Center | None
    found: CheckedPolygons | str

    def polygons(self) -> CheckedPolygons:
        """The polygons; ValueError if they are invalid."""
        if isinstance(self.found, str):
            raise ValueError(self.found)
        return self.found


def check_polygons(area: PolygonArea, frames: Sequence[Globe | None]) -> CheckedArea:
    """Check the polygons of an area, in the first frame in which they are valid.

    Args:
        area: the area.
        frames: those of geographic hulls, and None for the plane. A hull without a centre gets the middle of the area.
    """
    first, *others = frames
    checked = _check(area, first)
    if isinstance(checked.found, str):
        again = (_check(area, globe) for globe in others)
        return next((each for each in again if not isinstance(each.found, str)), checked)
    return checked


def _check(area: PolygonArea, globe: Globe | None) -> CheckedArea:
    frame: Gnomonic | None = None
    found: CheckedPolygons | str
    try:
        if globe is not None:
            frame = globe.frame or Gnomonic(middle(area, None))
        rings = rings_of(area, None)
        found = CheckedPolygons(rings if frame is None else projected(frame, rings))
    except ValueError as error:
        found = str(error)
    return CheckedArea(None if frame is None else frame.center, found)
