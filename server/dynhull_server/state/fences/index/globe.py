"""Fences about geographic hulls: their areas in the plane of the projection, in which great circles are straight."""

from collections.abc import Collection, Sequence
from functools import lru_cache

import numpy as np

from dynhull.arrays import Points
from dynhull.convex import Cloud
from dynhull.gjk import intersect
from dynhull.globe import MOST_METRES, REACH, Gnomonic, distance, project_far, project_hull

from ...errors import HullUnsuitableError, InvalidFenceError
from ...frames import off_globe, out_of_reach
from ...hull import Hull
from ...records import Center
from ..model.config import Area, CircleArea, FenceConfig, PolygonArea, Ring

# A circle is a polygon with this many corners, every half degree of azimuth, each at the radius on WGS 84: its edges
# are at most 1e-5 of the radius inside of the circle.
CIRCLE_CORNERS = 720
# Metres between places that are as far from each other as possible; and for each radian, at least.
HALF_ROUND, LEAST_RADIUS = 20_003_931.5, 6_335_439

PAIR = 2
POLE, ROUND = 90, 360  # degrees
# Degrees by which an area is beyond reach, far more than the error of an angle.
SURELY = 1e-6

Rings = Sequence[Sequence[Points]]


def require_frames(config: FenceConfig, area: Hull | None, subjects: Hull) -> None:
    """Raise the error that refuses a fence because of the frames of its hulls.

    Args:
        config: its settings.
        area: the hull that is its area, None for other areas.
        subjects: the hull that it compares.
    """
    hulls = [hull for hull in (area, subjects) if hull is not None]
    require_centers(hulls, "hulls of a fence on the globe have the same centre")
    if not subjects.row.settings.geographic:
        return
    centers = {hull.name: hull.state.center for hull in hulls}
    if len(set(centers.values())) > 1:
        raise HullUnsuitableError(
            subjects.name, f"has another centre: hulls of a fence on the globe have the same one, not {centers}"
        )
    require_margin(config)


def require_centers(hulls: Sequence[Hull], rule: str, lacking: Collection[Hull] = ()) -> None:
    """Raise HullUnsuitableError unless all of these hulls are planes, or all have centres: `lacking` ones will."""
    geographic = [hull for hull in hulls if hull.row.settings.geographic]
    for hull in hulls if geographic else ():
        if hull.state.center is None and hull not in lacking:
            if hull in geographic:
                reason = "has no centre so far: put its first points, or recenter it, before its fences are created"
            elif len(hulls) == PAIR:
                reason = "is a plane, and the other hull is geographic"
            else:
                reason = f"is a plane, and {geographic[0].name!r} is geographic"
            raise HullUnsuitableError(hull.name, f"{reason}; {rule}")


def require_margin(config: FenceConfig) -> None:
    """Raise InvalidFenceError if a fence on the globe has too wide a margin, or `without_self`."""
    if config.of_others:
        raise InvalidFenceError("hull_area.without_self", "true", "is for hulls in the plane")
    if config.margin > MOST_METRES:
        raise InvalidFenceError("margin", config.margin, f"at most {MOST_METRES:.0f} metres on the globe")


def lacks_center(config: FenceConfig, area: Hull | None, subjects: Hull) -> bool:
    """Whether the subjects of a fence are geographic and without a centre, which its area can give them."""
    settings = subjects.row.settings
    if not settings.geographic or subjects.state.center is not None:
        return False
    if config.kind == "hull" and settings.identity == "multiset":
        return False
    return area is None or area.state.center is not None


def middle(area: Area, hull: Hull | None) -> Center:
    """The middle of an area: the centre of a hull or of a circle, the mean direction of the corners of polygons.

    Args:
        area: the area.
        hull: the hull that is the area, with a centre; None for other areas.

    Raises:
        ValueError: the centre of a circle, or a corner, is no place.
    """
    if hull is not None:
        assert hull.state.center is not None
        return hull.state.center
    if isinstance(area, CircleArea):
        _require_places(np.array([[area.x, area.y]]), "the centre is")
        return area.x, area.y
    exteriors = [without_border(polygon[0]) for polygon in rings_of(area, None)]
    for number, corners in enumerate(exteriors):
        _require_places(corners, f"polygon {number} ring 0 has the corner")
    return Gnomonic.about(np.unique(np.vstack(exteriors), axis=0)).center  # a ring may be closed by its first corner


def require_circle(frame: Gnomonic, area: CircleArea) -> None:
    """Raise ValueError unless the inside of a circle is that of the polygon that stands for it."""
    center = np.array([[area.x, area.y]])
    misplaced = off_globe(center) or out_of_reach(frame, center)
    if misplaced is not None:
        raise ValueError(f"the centre is {misplaced.place}: {misplaced.problem}")
    if area.radius >= HALF_ROUND:
        raise ValueError(f"the radius is {area.radius} m: no two places are {HALF_ROUND} m apart")


def rings_of(area: Area, vertices: Points | None) -> Rings:
    """The rings of an area in degrees, for each of its polygons; `vertices` are those of the hull that is the area."""
    if isinstance(area, PolygonArea):
        return [[corners_of(ring) for ring in polygon] for polygon in area.polygons]
    if isinstance(area, CircleArea):
        return [[_circle(area)]]
    assert vertices is not None  # those of the area
    return [[vertices]]


def projected(frame: Gnomonic, rings: Rings) -> list[list[Points]]:
    """The rings in the plane; ValueError names a ring with a corner that is no place or out of reach."""
    return [
        [_projected(frame, without_border(ring), f"polygon {i} ring {j}") for j, ring in enumerate(p)]
        for i, p in enumerate(rings)
    ]


def laid_polygons(frame: Gnomonic, area: Area, margin: float, *, anywhere: bool) -> Rings:
    """The polygons of a circle or polygons in the plane of a hull; ValueError if they do not fit into it.

    Args:
        frame: the projection of the hull.
        area: the area.
        margin: that of the fence, in metres.
        anywhere: whether the hull has to reach it. Otherwise an area that, with its margin, is surely beyond its reach
            has no polygons, and another one has to end before the plane does.
    """
    rings = rings_of(area, None)
    if not anywhere:
        if isinstance(area, CircleArea):
            require_circle(frame, area)
        return projected(frame, rings)
    polygons = [[without_border(ring) for ring in polygon] for polygon in rings]
    places = [[project_far(frame, ring) for ring in polygon] for polygon in polygons]
    if any(np.isnan(xy).any() for flat in places for xy in flat):
        center, radius = _cap(area)
        if frame.angle(center) - radius > REACH + SURELY + np.degrees(margin / LEAST_RADIUS):
            return []
    for number, (polygon, flat) in enumerate(zip(polygons, places, strict=True)):
        for ring, xy in zip(polygon, flat, strict=True):
            if np.isnan(xy).any():
                lon, lat = ring[np.argmax(np.isnan(xy[:, 0]))].tolist()
                words = f"degrees from the centre {frame.center}, which reaches other parts of the area"
                raise ValueError(
                    f"polygon {number} has the corner ({lon}, {lat}): {frame.angle((lon, lat)):.6f} {words}"
                )
    return places


def without_border(ring: Points) -> Points:
    """The ring without its way along the border of a map, to a pole and back: on the globe that way has no inside.

    A map needs it where a pole is inside, as in `GeoHull.geojson()`: a corner on one border, the pole on both, and the
    corner on the other border.
    """
    at_pole = np.abs(ring[:, 1]) == POLE
    if not at_pole.any() or at_pole.all():
        return ring
    start = int(np.argmin(at_pole))
    ring, at_pole = np.roll(ring, -start, axis=0), np.roll(at_pole, -start)
    if (ring[0] == ring[-1]).all():  # the closing corner
        ring, at_pole = ring[:-1], at_pole[:-1]
    keep = np.ones(len(ring), np.bool_)
    ends = np.flatnonzero(np.diff(at_pole, append=False)) + 1  # of runs of corners, those at a pole are every second
    for first, end in zip(ends[::2], ends[1::2], strict=True):
        (west, south), (east, north) = ring[first - 1], ring[end % len(ring)]
        if abs(east - west) == ROUND and len(set(ring[first:end, 1])) == 1:
            keep[first:end] = False
            keep[end % len(ring)] = south != north  # otherwise one place
    return ring[keep]


def outline(frame: Gnomonic, vertices: Points) -> Points:
    """The vertices of a geographic hull in the plane, from the lexicographically smallest there."""
    places = frame.project_all(vertices)
    return np.roll(places, -int(np.lexsort(places.T[::-1])[0]), axis=0) if len(places) else places


def compared(a: Points, b: Points, limit: float, center: Center) -> tuple[bool, float]:
    """Whether two hulls intersect or are at most `limit` metres apart, and their distance. The centre is that of b."""
    frame = Gnomonic(center)
    within = outline(frame, a) if frame.project(a)[1].all() else project_hull(frame, a)
    if len(within) and intersect(Cloud(within), Cloud(outline(frame, b))):
        return True, 0.0
    apart = min(float(distance(a, b).min()), float(distance(b, a).min()))
    return apart <= limit, apart


def corners_of(ring: Ring) -> Points:
    """The corners of a ring."""
    return np.frombuffer(ring, "<f8").astype(np.float64).reshape(-1, 2)


def _require_places(lonlat: Points, words: str) -> None:
    misplaced = off_globe(lonlat)
    if misplaced is not None:
        raise ValueError(f"{words} {misplaced.place}: {misplaced.problem}")


def _projected(frame: Gnomonic, ring: Points, name: str) -> Points:
    misplaced = off_globe(ring) or out_of_reach(frame, ring)
    if misplaced is not None:
        raise ValueError(f"{name} has the corner {misplaced.place}: {misplaced.problem}")
    return frame.project(ring)[0]


@lru_cache(maxsize=64)  # all hulls of a prefix ask for that of one area
def _cap(area: Area) -> tuple[Center, float]:
    """The middle of a circle or of polygons, and the greatest angle between it and a corner."""
    corners = np.vstack([without_border(polygon[0]) for polygon in rings_of(area, None)])
    frame = Gnomonic.about(np.unique(corners, axis=0))
    return frame.center, float(frame.angles(corners).max())


@lru_cache(maxsize=1024)  # 11 kB each; more are computed again
def _circle(area: CircleArea) -> Points:
    """The corners of a circle, counter-clockwise."""
    from pyproj import Geod  # takes a while to load, and only circles on the globe need it

    azimuths = -np.linspace(0, 360, CIRCLE_CORNERS, endpoint=False)
    same = np.ones(CIRCLE_CORNERS)
    lon, lat, _ = Geod(ellps="WGS84").fwd(area.x * same, area.y * same, azimuths, area.radius * same)
    return np.column_stack([lon, lat])
