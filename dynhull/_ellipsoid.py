"""Measures on the ellipsoid WGS84, in metres: the geodesics are pyproj's (Karney, "Algorithms for geodesics", 2013).

The only part of the library that needs pyproj.

An edge is a great circle of the globe whose latitudes are those of WGS84. Directions on that globe serve to find what
is near or far; what is returned is measured on the ellipsoid.
"""

from __future__ import annotations

from functools import cache
from math import ceil, inf, log2
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._globe import sin_cos

if TYPE_CHECKING:
    from ._predicates import Floats
    from .arrays import Points

# A length on the ellipsoid, divided by its angle on the globe, is between the least and the greatest radius of
# curvature: in the meridian at the equator, and at a pole.
LEAST_RADIUS, GREATEST_RADIUS = 6335439.0, 6399594.0
ECCENTRICITY_SQUARED = 0.0066943799901413165
PRECISION = 1e-6  # metres along an edge: the error of a distance is at most that, and far less than that far away
MOST_PAIRS = 1 << 18  # of a place and an edge, examined together


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
    result = np.full(len(lonlat), inf)
    if not len(vertices):
        return result
    edges = vertices, np.roll(vertices, -1, axis=0)
    rows = max(1, MOST_PAIRS // len(vertices))
    for i in range(0, len(lonlat), rows):
        result[i : i + rows] = _distances(lonlat[i : i + rows], *edges)
    return result


def along(start: Points, end: Points, share: Floats) -> Points:
    """(k, 2) places at these shares of the way along great circles."""
    a, b = unit_vectors(start), unit_vectors(end)
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


def _distances(places: Points, start: Points, end: Points) -> Floats:
    """The least distance of each place to an edge."""
    angles = _angles_to_edges(unit_vectors(places), unit_vectors(start), unit_vectors(end))
    nearest = angles.min(axis=1, keepdims=True)
    row, edge = np.nonzero(angles * LEAST_RADIUS <= nearest * GREATEST_RADIUS + PRECISION)
    best = np.full(len(places), inf)
    at_start, at_end = _lengths(places[row], start[edge]), _lengths(places[row], end[edge])
    np.minimum.at(best, row, np.minimum(at_start, at_end))
    # No point of an edge is nearer than the triangle inequality allows.
    length = GREATEST_RADIUS * edge_angles(start, end)[edge]
    open_ = (at_start + at_end - length) / 2 < best[row]
    row, edge = row[open_], edge[open_]
    if row.size:
        np.minimum.at(best, row, _distances_inside(places[row], start[edge], end[edge], float(length[open_].max())))
    return best


def _distances_inside(places: Points, start: Points, end: Points, longest: float) -> Floats:
    """The distance of each place to its edge: bisection for the point where the distance stops falling."""
    low, high = np.zeros(len(places)), np.ones(len(places))
    for _ in range(max(1, ceil(log2(max(longest, PRECISION) / PRECISION)))):
        middle = (low + high) / 2
        falls = _falls(places, start, end, middle)
        low, high = np.where(falls, middle, low), np.where(falls, high, middle)
    return _lengths(places, along(start, end, (low + high) / 2))


def _falls(places: Points, start: Points, end: Points, share: Floats) -> npt.NDArray[np.bool_]:
    """Whether the distance to a place falls on the way along its edge, at this share of it."""
    here = along(start, end, share)
    a, b, p = unit_vectors(start), unit_vectors(end), unit_vectors(here)
    way = np.cross(np.cross(a, b), p)
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
