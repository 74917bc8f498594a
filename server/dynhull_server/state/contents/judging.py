"""How fast keys move, and how much a position would enlarge a hull.

Decisions are exact in the plane: where rounding might matter, rational numbers decide. On the globe they are made in
floating point, on a sphere.
"""

from fractions import Fraction
from typing import Protocol

import numpy as np
import numpy.typing as npt

from dynhull import GeoHull, convex_hull
from dynhull.arrays import Points

from ..records import Center

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.bool_]
Microseconds = npt.NDArray[np.int64]

MICROSECONDS = 1_000_000
EARTH_RADIUS = 6_371_008.8  # metres: the mean radius of the Earth
# Far above the relative rounding errors of a length, and far below what makes exact decisions frequent.
MARGIN = 1e-12
# Below this, products may have lost digits.
TINY = 1e-280
ROUNDING = 2.0**-52
CORNERS = 3  # of the first hull with an area
PAIRS_TOGETHER = 2**16  # of a position and an edge


class Judge(Protocol):
    """Judges in one frame. Vertices are those of a hull with an area."""

    def too_fast(self, before: Points, after: Points, elapsed: Microseconds, limit: float) -> tuple[Rows, Floats]:
        """Which of (n,) moves are faster than the limit, and all speeds; inf for a move in no time."""

    def too_large(self, vertices: Points, points: Points, limit: float) -> tuple[Rows, Floats]:
        """Which of (n,) points would each enlarge the area by more than this factor, and all factors. O(n h)."""

    def with_point(self, vertices: Points, point: tuple[float, float]) -> Points:
        """The vertices of the hull with one more point. O(h log h)."""


class Plane:
    """The plane: exact."""

    def too_fast(self, before: Points, after: Points, elapsed: Microseconds, limit: float) -> tuple[Rows, Floats]:
        """As `Judge.too_fast`."""
        with np.errstate(over="ignore", invalid="ignore"):
            lengths: Floats = np.hypot(*(after - before).T)
            most = limit * (elapsed / MICROSECONDS)
            fast = lengths > most
            greater = np.maximum(lengths, most)
            sure = (np.abs(lengths - most) > MARGIN * greater) & (greater > TINY)
        for row in np.flatnonzero(~sure & (lengths != 0)).tolist():
            (x, y), (to_x, to_y) = before[row].tolist(), after[row].tolist()
            squared = (Fraction(to_x) - Fraction(x)) ** 2 + (Fraction(to_y) - Fraction(y)) ** 2
            fast[row] = squared * MICROSECONDS**2 > (Fraction(limit) * int(elapsed[row])) ** 2
        return fast, _speeds(lengths, elapsed)

    def too_large(self, vertices: Points, points: Points, limit: float) -> tuple[Rows, Floats]:
        """As `Judge.too_large`."""
        following = np.roll(vertices, -1, axis=0)
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            terms, sizes = _doubled(vertices[0], vertices, following)
            area, doubt = float(terms.sum()), float(sizes.sum())
            # Twice the area added: the triangles that a point makes with the edges that it sees.
            added, doubts = np.empty(len(points)), np.empty(len(points))
            step = max(1, PAIRS_TOGETHER // len(vertices))
            for first in range(0, len(points), step):
                rows = slice(first, first + step)
                terms, sizes = _doubled(points[rows, None], vertices, following)
                added[rows], doubts[rows] = np.maximum(-terms, 0.0).sum(axis=1), sizes.sum(axis=1)
            after, most = area + added, limit * area
            errors = ROUNDING * (len(vertices) + 16) * (doubts + (1 + limit) * doubt) + TINY
            large = after > most
            sure = np.abs(after - most) > errors
            factors = after / area
        for row in np.flatnonzero(~sure).tolist():
            before, more = _exact_areas(vertices.tolist(), points[row].tolist())
            large[row] = before + more > Fraction(limit) * before
            factors[row] = _as_double(1 + more / before)
        return large, factors

    def with_point(self, vertices: Points, point: tuple[float, float]) -> Points:
        """As `Judge.with_point`."""
        return convex_hull(np.vstack([vertices, point]))


class Sphere:
    """The globe, in degrees: great circles on a sphere, in floating point."""

    def __init__(self, center: Center | None) -> None:
        self._center = center

    def too_fast(self, before: Points, after: Points, elapsed: Microseconds, limit: float) -> tuple[Rows, Floats]:
        """As `Judge.too_fast`, in metres a second."""
        chords = np.linalg.norm(_vectors(after) - _vectors(before), axis=1)
        lengths: Floats = 2 * EARTH_RADIUS * np.arcsin(np.minimum(chords / 2, 1.0))
        return lengths > limit * (elapsed / MICROSECONDS), _speeds(lengths, elapsed)

    def too_large(self, vertices: Points, points: Points, limit: float) -> tuple[Rows, Floats]:
        """As `Judge.too_large`."""
        corners, places = _vectors(vertices), _vectors(points)
        following = np.roll(corners, -1, axis=0)
        area = float(_excesses(corners[0], corners, following).sum())
        added = np.array([np.maximum(-_excesses(place, corners, following), 0.0).sum() for place in places])
        factors: Floats = (area + added) / area
        return factors > limit, factors

    def with_point(self, vertices: Points, point: tuple[float, float]) -> Points:
        """As `Judge.with_point`."""
        return GeoHull(np.vstack([vertices, point]), center=self._center).vertices()


def _speeds(lengths: Floats, elapsed: Microseconds) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        speeds: Floats = np.where(lengths == 0, 0.0, lengths / (elapsed / MICROSECONDS))
    return speeds


def _doubled(point: Floats, starts: Points, ends: Points) -> tuple[Floats, Floats]:
    """Twice the areas of the triangles of points with edges, positive on their left; the sizes of their terms."""
    along, to = ends - starts, point - starts
    left, right = along[..., 0] * to[..., 1], along[..., 1] * to[..., 0]
    return left - right, np.abs(left) + np.abs(right)


def _exact_areas(vertices: list[list[float]], point: list[float]) -> tuple[Fraction, Fraction]:
    """Twice the area of a polygon, and twice that which a point adds."""
    corners = [(Fraction(x), Fraction(y)) for x, y in vertices]
    x, y = map(Fraction, point)
    area = added = Fraction(0)
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        area += ax * by - ay * bx
        seen = (by - ay) * (x - ax) - (bx - ax) * (y - ay)
        added += max(seen, Fraction(0))
    return area, added


def _as_double(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf")


def _vectors(lonlat: Points) -> Floats:
    lon, lat = np.radians(lonlat).T
    return np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


def _excesses(place: Floats, starts: Floats, ends: Floats) -> Floats:
    """The areas of the triangles of a place with edges on the unit sphere, positive on their left (Eriksson 1990)."""
    volume = np.cross(starts, ends) @ place
    excesses: Floats = 2 * np.arctan2(volume, 1 + (starts * ends).sum(axis=1) + starts @ place + ends @ place)
    return excesses
