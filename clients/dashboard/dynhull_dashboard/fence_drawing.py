"""The area of a fence, as sent to the pages: serialized once for all of them."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from dynhull_client import Circle, Fence, Points, Prefix

from .degrees import Center, Flat, circle, shown
from .outline import MOST_DRAWN, Box, box_around

LEAST_CORNERS = 3
# Of more polygons the first ones are drawn.
MOST_POLYGONS = MOST_DRAWN // LEAST_CORNERS

Rings = list[Points]  # of one polygon: the exterior, then the holes


@dataclass(frozen=True, slots=True)
class Area:
    """The area of a fence on the page.

    Attributes:
        message: the rings of the area and of its margin, and the hulls whose outlines belong to it, as JSON.
        bounds: the smallest box around the area and its margin; None for a hull, whose feed knows it.
        corners: the number of corners of the area's polygons.
        drawn: the number of those that are drawn.
    """

    message: str
    bounds: Box | None = None
    corners: int = 0
    drawn: int = 0


def area_of(name: str, fence: Fence | None, center: Center | None = None) -> Area:
    """The area of the fence with this name, an empty one where there is none. Time linear in the corners.

    With `center` it is on the globe, and drawn around this centre.
    """
    if fence is None:
        return Area(_area_message(name))
    margin = fence.margin if fence.other_hull is None else fence.near
    polygons = [[shown(ring, center) for ring in rings] for rings in _polygons(fence, on_globe=center is not None)]
    around = _around(polygons, margin) if center is None else _around_on_globe(polygons, margin, center)
    message = _area_message(name, area_hulls(fence), margin, polygons, around, globe=center is not None)
    if not polygons:
        return Area(message)
    bounds = box_around(np.concatenate([rings[0] for rings in (*polygons, *around)]))
    drawn = 0 if isinstance(fence.area, Circle) else sum(len(ring) for rings in polygons for ring in rings)
    return Area(message, bounds, corner_count(fence), drawn)


def _area_message(
    name: str,
    hulls: Sequence[str] = (),
    margin: float = 0.0,
    polygons: Sequence[Rings] = (),
    around: Sequence[Rings] = (),
    *,
    globe: bool = False,
) -> str:
    """All of it as JSON. Each polygon is a list of rings, for overlaps of polygons are no holes."""
    drawn, wider = ([[ring.tolist() for ring in rings] for rings in each] for each in (polygons, around))
    named = {"kind": "area", "fence": name, "hulls": hulls, "margin": margin, "globe": globe}
    return json.dumps({**named, "polygons": drawn, "around": wider})


def area_hulls(fence: Fence) -> list[str]:
    """The hulls whose outlines are the area; in a fence around another hull, both."""
    area = [fence.area] if isinstance(fence.area, str) else []
    return [*area, fence.other_hull] if fence.other_hull is not None else area


def hulls_of(fence: Fence, known: Iterable[str]) -> list[str]:
    """The hulls that show what the fence does: those of its area, and of its subjects among the `known` hulls."""
    subjects = fence.subjects
    if isinstance(subjects, Prefix):
        found = sorted(name for name in known if name.startswith(subjects.text))
    else:
        found = [] if subjects is None else [subjects]
    return list(dict.fromkeys([*area_hulls(fence), *found]))


def corner_count(fence: Fence) -> int:
    """The number of corners of the area's polygons."""
    polygons = fence.area if isinstance(fence.area, tuple) else ()
    return sum(len(ring) for each in polygons for ring in (each.exterior, *each.holes))


def _polygons(fence: Fence, *, on_globe: bool) -> list[Rings]:
    """The rings of the polygons to draw: the exterior, then the holes."""
    if isinstance(fence.area, Circle):
        return [[circle(fence.area, on_globe=on_globe)]]
    if isinstance(fence.area, str):
        return []
    step = -(-corner_count(fence) // MOST_DRAWN)
    return [
        [ring[:: max(1, min(step, len(ring) // LEAST_CORNERS))] for ring in (each.exterior, *each.holes)]
        for each in fence.area[:MOST_POLYGONS]
    ]


def _around(polygons: list[Rings], margin: float) -> list[Rings]:
    """The rings at the distance of the margin outside of the polygons. For the eye: the server decides who has left."""
    if not polygons or not margin:
        return []
    area = shapely.union_all([shapely.Polygon(rings[0], rings[1:]) for rings in polygons])
    wider = shapely.buffer(area, margin)
    return [
        [np.asarray(ring.coords)[:-1] for ring in (part.exterior, *part.interiors)]
        for part in shapely.get_parts(wider)
        if not part.is_empty
    ]


def _around_on_globe(polygons: list[Rings], margin: float, center: Center) -> list[Rings]:
    """The same in degrees, for a margin in metres; none where an area is nearly a hemisphere."""
    if not polygons or not margin:
        return []
    plane = Flat(np.concatenate([rings[0] for rings in polygons]))
    flat = [[plane.flat(ring) for ring in rings] for rings in polygons]
    if any(ring is None for rings in flat for ring in rings):
        return []
    wider = _around([[ring for ring in rings if ring is not None] for rings in flat], margin)
    return [[shown(plane.places(ring), center) for ring in rings] for rings in wider]
