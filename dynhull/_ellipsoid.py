"""Measures on the ellipsoid WGS84, in metres: the geodesics are pyproj's (Karney, "Algorithms for geodesics", 2013).

The only part of the library that needs pyproj.

An edge is a great circle of the globe whose latitudes are those of WGS84. Directions on that globe serve to find what
is near or far; what is returned is measured on the ellipsoid.
"""

from __future__ import annotations

from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._globe import sin_cos

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ._predicates import Floats
    from .arrays import Points

# A length on the ellipsoid, divided by its angle on the globe, is between the least and the greatest radius of
# curvature: in the meridian at the equator, and at a pole.
LEAST_RADIUS, GREATEST_RADIUS = 6335439.0, 6399594.0
ECCENTRICITY_SQUARED = 0.0066943799901413165
PRECISION = 1e-6  # metres along an edge: the error of a distance is at most that, and far less than that far away
MOST_PAIRS = 1 << 18  # of a place and an edge, examined together
EDGES_OF_A_CAP = 128
CAP_SLACK = 1e-6  # radians, far above the errors of angles


@cache
def geod() -> Any:
    """The ellipsoid.

    Raises:
        ImportError: pyproj is not installed.
    """
    try:
        from pyproj import Geod
    except ImportError:
        raise ImportError("measures on the globe need pyproj: pip install 'dynhull[geo]'") from None
    return Geod(ellps="WGS84")


def area(vertices: Points) -> float:
    """The area in square metres of the polygon whose edges are the geodesics between (h, 2) vertices. O(h).

    Within 0.1 m² a vertex (Karney 2013). 0.0 for fewer than three.
    """
    if len(vertices) < 3:
        return 0.0
    square_metres, _ = geod().polygon_area_perimeter(*vertices.T)
    return float(square_metres)


def perimeter(vertices: Points) -> float:
    """The length in metres of the same polygon; two vertices count twice. O(h).

    Within 15 nanometres an edge (Karney 2013).
    """
    if len(vertices) < 2:
        return 0.0
    return float(_lengths(vertices, np.roll(vertices, -1, axis=0)).sum())


def diameter(vertices: Points) -> float:
    """The greatest distance in metres of two of (h, 2) vertices, within 15 nanometres; 0.0 for fewer. O(h²)."""
    if len(vertices) < 2:
        return 0.0
    directions = unit_vectors(vertices)
    rows = max(1, MOST_PAIRS // len(vertices))
    starts = range(0, len(vertices), rows)
    widest = max(float(_angles(directions[i : i + rows, None], directions).max()) for i in starts)
    best = 0.0
    for i in starts:
        angles = _angles(directions[i : i + rows, None], directions)
        a, b = np.nonzero(angles * GREATEST_RADIUS >= widest * LEAST_RADIUS)
        if a.size:
            best = max(best, float(_lengths(vertices[a + i], vertices[b]).max()))
    return best


def distance(vertices: Points, lonlat: Points) -> Floats:
    """(k,) distances in metres of (k, 2) places, none of them inside, to the boundary of great circles.

    Within a micrometre; inf without vertices. O(h) a place, and about thirty geodesics.

    Args:
        vertices: (h, 2) vertices.
        lonlat: (k, 2) places anywhere on the globe.
    """
    return Boundary([vertices]).distance(lonlat)


class Boundary:
    """Rings of great circles, of which `distance` looks at the edges near a place: neighbours share a cap of the globe.

    Args:
        rings: rings of (h, 2) vertices.

    O(n log n) for n edges.
    """

    def __init__(self, rings: Iterable[Points]) -> None:
        known = [ring for ring in rings if len(ring)] or [np.empty((0, 2))]
        self._start = np.concatenate(known)
        self._end = np.concatenate([np.roll(ring, -1, axis=0) for ring in known])
        self._middles = self._radii = np.empty(0)
        count = len(self._start)
        if count <= EDGES_OF_A_CAP:
            return
        a, b = unit_vectors(self._start), unit_vectors(self._end)
        order = _by_neighbourhood(a + b)
        self._start, self._end, a, b = (each[order] for each in (self._start, self._end, a, b))
        firsts = np.arange(0, count, EDGES_OF_A_CAP)
        sums = np.add.reduceat(a + b, firsts)
        lengths = np.sqrt((sums * sums).sum(axis=1, keepdims=True))
        self._middles = sums / np.where(lengths > 0, lengths, 1)
        middles = np.repeat(self._middles, EDGES_OF_A_CAP, axis=0)[:count]
        farthest = np.maximum.reduceat(np.maximum(_angles(a, middles), _angles(b, middles)), firsts)
        # A cap of less than half the globe has the whole edge if it has both ends.
        self._radii = np.where(farthest + CAP_SLACK < np.pi / 2, farthest + CAP_SLACK, np.pi)

    def distance(self, lonlat: Points) -> Floats:
        """(k,) distances in metres of (k, 2) places anywhere on the globe, none of them inside.

        Within a micrometre; inf without vertices. Of many edges only those of caps that are about as near as the
        nearest one are looked at.
        """
        result = np.full(len(lonlat), inf)
        if not len(self._start):
            return result
        rows = max(1, MOST_PAIRS // len(self._start))
        pairs: list[tuple[npt.NDArray[np.intp], Points, Points]] = []
        first = 0
        for i in range(0, len(lonlat), rows):
            near = self._near(lonlat[i : i + rows])
            start, end = self._start[near], self._end[near]
            row, edge = _candidates(lonlat[i : i + rows], start, end)
            pairs.append((row + i - first, start[edge], end[edge]))
            last = min(i + rows, len(lonlat))
            if last == len(lonlat) or sum(len(each) for each, _, _ in pairs) > MOST_PAIRS:
                together = (np.concatenate(column) for column in zip(*pairs, strict=True))
                result[first:last] = _distances(lonlat[first:last], *together)
                first, pairs = last, []
        return result

    def _near(self, places: Points) -> slice | npt.NDArray[np.bool_]:
        """The edges among which is every one that may be the nearest to one of some places."""
        if not len(self._radii):
            return slice(None)
        angles = _angles(unit_vectors(places)[:, None], self._middles)
        most = (angles + self._radii).min(axis=1, keepdims=True)
        caps = ((angles - self._radii) * LEAST_RADIUS <= most * GREATEST_RADIUS + PRECISION).any(axis=0)
        return np.repeat(caps, EDGES_OF_A_CAP)[: len(self._start)]


def along(start: Points, end: Points, share: Floats) -> Points:
    """(k, 2) places at these shares of the way along great circles."""
    return _between(unit_vectors(start), unit_vectors(end), share)


def _between(a: Floats, b: Floats, share: Floats) -> Points:
    """The same, given the directions of the ends."""
    angle = _angles(a, b)[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = np.where(angle > 0, np.sin(share[:, None] * angle) / np.sin(angle), 0.0)
        rest = np.where(angle > 0, np.sin((1 - share[:, None]) * angle) / np.sin(angle), 1.0)
    return _degrees(rest * a + weight * b)


def unit_vectors(lonlat: Points) -> Floats:
    """(k, 3) directions of (k, 2) places."""
    ((sin_lon, _), (cos_lon, _)), ((sin_lat, _), (cos_lat, _)) = sin_cos(lonlat[:, 0] / 2), sin_cos(lonlat[:, 1])
    return np.column_stack([cos_lat * (1 - 2 * sin_lon * sin_lon), cos_lat * (2 * sin_lon * cos_lon), sin_lat])


def edge_angles(start: Points, end: Points) -> Floats:
    """(k,) angles of edges on the globe, in radians."""
    return _angles(unit_vectors(start), unit_vectors(end))


def _by_neighbourhood(directions: Floats) -> npt.NDArray[np.intp]:
    """The order of directions in which neighbours are close: by strips along one axis, then along another one."""
    across, along = np.argsort(-np.ptp(directions, axis=0))[:2]
    count = len(directions)
    strip = EDGES_OF_A_CAP * max(1, round((count / EDGES_OF_A_CAP) ** 0.5))
    order = np.argsort(directions[:, across], kind="stable")
    within = np.lexsort((directions[order, along], np.arange(count) // strip))
    return order[within]


def _candidates(places: Points, start: Points, end: Points) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Pairs of a place and an edge, among which is one with the nearest edge of each place."""
    angles = _angles_to_edges(unit_vectors(places), unit_vectors(start), unit_vectors(end))
    nearest = angles.min(axis=1, keepdims=True)
    row, edge = np.nonzero(angles * LEAST_RADIUS <= nearest * GREATEST_RADIUS + PRECISION)
    return row, edge


def _distances(places: Points, row: npt.NDArray[np.intp], start: Points, end: Points) -> Floats:
    """The least distance of each place to an edge, of pairs of a row of the places and an edge."""
    best = np.full(len(places), inf)
    at_start, at_end = _lengths(places[row], start), _lengths(places[row], end)
    np.minimum.at(best, row, np.minimum(at_start, at_end))
    # No point of an edge is nearer than the triangle inequality allows.
    length = GREATEST_RADIUS * edge_angles(start, end)
    open_ = (at_start + at_end - length) / 2 < best[row]
    row = row[open_]
    if row.size:
        np.minimum.at(best, row, _distances_inside(places[row], start[open_], end[open_], length[open_]))
    return best


def _distances_inside(places: Points, start: Points, end: Points, lengths: Floats) -> Floats:
    """The distance of each place to its edge: bisection for the point where the distance stops falling."""
    low, high = np.zeros(len(places)), np.ones(len(places))
    a, b = unit_vectors(start), unit_vectors(end)
    halvings = np.maximum(1, np.ceil(np.log2(np.maximum(lengths, PRECISION) / PRECISION)))
    for halving in range(int(halvings.max())):
        middle = (low + high) / 2
        falls, goes_on = _falls(places, a, b, middle), halving < halvings
        low, high = np.where(goes_on & falls, middle, low), np.where(goes_on & ~falls, middle, high)
    return _lengths(places, _between(a, b, (low + high) / 2))


def _falls(places: Points, a: Floats, b: Floats, share: Floats) -> npt.NDArray[np.bool_]:
    """Whether the distance to a place falls on the way from a to b, at this share of it."""
    here = _between(a, b, share)
    way = np.cross(np.cross(a, b), unit_vectors(here))
    ((sin_lon, _), (cos_lon, _)), ((sin_lat, _), (cos_lat, _)) = sin_cos(here[:, 0]), sin_cos(here[:, 1])
    east = way[:, 1] * cos_lon - way[:, 0] * sin_lon
    north = way[:, 2] * cos_lat - (way[:, 0] * cos_lon + way[:, 1] * sin_lon) * sin_lat
    # From the globe to the ellipsoid, the ratio of the radii of curvature in the meridian and across.
    north *= (1 - ECCENTRICITY_SQUARED) / (1 - ECCENTRICITY_SQUARED * sin_lat * sin_lat)
    towards, _, _ = geod().inv(*here.T, *places.T)
    towards = np.radians(towards)
    falls: npt.NDArray[np.bool_] = east * np.sin(towards) + north * np.cos(towards) > 0
    return falls


def _angles_to_edges(places: Floats, start: Floats, end: Floats) -> Floats:
    """(k, h) angles on the globe between places and edges."""
    normals = np.cross(start, end)
    lengths = np.sqrt((normals * normals).sum(axis=1))
    units = normals / np.where(lengths > 0, lengths, 1)[:, None]
    beside = (places @ np.cross(units, start).T > 0) & (places @ np.cross(end, units).T > 0)
    across = np.arcsin(np.clip(np.abs(places @ units.T), 0, 1))
    at_ends = np.minimum(_angles(places[:, None], start), _angles(places[:, None], end))
    return np.where(beside, across, at_ends)


def _angles(a: Floats, b: Floats) -> Floats:
    """Angles between unit vectors, from their chords."""
    chords = np.sqrt(((a - b) ** 2).sum(axis=-1))
    angles: Floats = 2 * np.arcsin(np.clip(chords / 2, 0, 1))
    return angles


def _lengths(a: Points, b: Points) -> Floats:
    _, _, metres = geod().inv(*a.T, *b.T)
    lengths: Floats = metres
    return lengths


def _degrees(vectors: Floats) -> Points:
    x, y, z = vectors.T
    places: Points = np.degrees(np.column_stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))]))
    return places
