"""How fast keys move, and how much a position would enlarge a hull.

Decisions are exact in the plane: where rounding might matter, rational numbers decide. On the globe they are made in
floating point, on a sphere.
"""

from fractions import Fraction
from typing import Protocol

import numpy as np
import numpy.typing as npt

from dynhull import DynamicHull, GeoHull
from dynhull.arrays import Points
from dynhull.globe import Gnomonic

from ..numbers import as_numbers
from ..records import Center
from .live import AnyHull

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


class Judge(Protocol):
    """Judges in one frame."""

    def too_fast(self, before: Points, after: Points, elapsed: Microseconds, limit: float) -> tuple[Rows, Floats]:
        """Which of (n,) moves are faster than the limit, and all speeds; inf for a move in no time."""

    def too_large(self, hull: AnyHull, points: Points, limit: float) -> tuple[Rows, Floats]:
        """Which of (n,) points would each enlarge the area by more than this factor, and all factors.

        A hull without an area has nothing to grow from.
        """

    def with_point(self, hull: AnyHull, point: tuple[float, float]) -> AnyHull | None:
        """A hull of the vertices and one more point; None if there can be none. O(h log h)."""


class Plane:
    """The plane: exact."""

    def too_fast(self, before: Points, after: Points, elapsed: Microseconds, limit: float) -> tuple[Rows, Floats]:
        """As `Judge.too_fast`."""
        with np.errstate(all="ignore"):
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

    def too_large(self, hull: AnyHull, points: Points, limit: float) -> tuple[Rows, Floats]:
        """As `Judge.too_large`. O(h + n log h)."""
        vertices = hull.vertices()
        if len(vertices) < CORNERS:
            return no_growth(points)
        tangents = hull.tangents(points)
        seeing = np.flatnonzero(~np.isnan(tangents[:, 0, 0]))
        left, right = (_rows(tangents[seeing, side], vertices) for side in (0, 1))
        with np.errstate(all="ignore"):
            # Twice the area of the fan from the first vertex to the others, up to each of them.
            terms, sizes = _products(vertices - vertices[0], np.roll(vertices, -1, axis=0) - vertices)
            fans, area, doubt = np.cumsum([0.0, *terms]), float(terms.sum()), float(sizes.sum())
            # Twice the area added: that of the polygon from the point to the vertices that it sees.
            added, doubts = np.zeros(len(points)), np.zeros(len(points))
            to = points[seeing] - vertices[0]
            before, after = (_products(vertices[rows] - vertices[0], to) for rows in (left, right))
            between = fans[right] - fans[left] + np.where(right < left, area, 0.0)
            added[seeing] = before[0] - after[0] - between
            doubts[seeing] = before[1] + after[1]
            grown, most = area + added, limit * area
            errors = ROUNDING * (len(vertices) + 16) * (doubts + (4 + limit) * doubt) + TINY
            large = grown > most
            sure = np.abs(grown - most) > errors
            factors = grown / area
        if limit == 1.0:  # all that is outside adds to the area, however little
            large[seeing] = True
            sure[seeing] = np.isfinite(factors[seeing])
        for row in np.flatnonzero(~sure).tolist():
            exact, more = _exact_areas(vertices.tolist(), points[row].tolist())
            large[row] = exact + more > Fraction(limit) * exact
            factors[row] = _as_double(1 + more / exact)
        return large, factors

    def with_point(self, hull: AnyHull, point: tuple[float, float]) -> AnyHull:
        """As `Judge.with_point`."""
        return DynamicHull(np.vstack([hull.vertices(), point]))


class Sphere:
    """The globe, in degrees: great circles on a sphere, in floating point."""

    def __init__(self, center: Center | None) -> None:
        self._center = center

    def too_fast(self, before: Points, after: Points, elapsed: Microseconds, limit: float) -> tuple[Rows, Floats]:
        """As `Judge.too_fast`, in metres a second."""
        chords = np.linalg.norm(_vectors(after) - _vectors(before), axis=1)
        lengths: Floats = 2 * EARTH_RADIUS * np.arcsin(np.minimum(chords / 2, 1.0))
        return lengths > limit * (elapsed / MICROSECONDS), _speeds(lengths, elapsed)

    def too_large(self, hull: AnyHull, points: Points, limit: float) -> tuple[Rows, Floats]:
        """As `Judge.too_large`. O(n h)."""
        vertices = hull.vertices()
        if len(vertices) < CORNERS:
            return no_growth(points)
        corners, places = _vectors(vertices), _vectors(points)
        following = np.roll(corners, -1, axis=0)
        area = float(_excesses(corners[0], corners, following).sum())
        if area <= 0:  # rounded, of a few nanometres
            return no_growth(points)
        added = np.array([np.maximum(-_excesses(place, corners, following), 0.0).sum() for place in places])
        factors: Floats = (area + added) / area
        return factors > limit, factors

    def with_point(self, hull: AnyHull, point: tuple[float, float]) -> AnyHull | None:
        """As `Judge.with_point`; None for a point out of reach, since the centre may have moved after it was held."""
        if self._center is None or not Gnomonic(self._center).project(np.array([point]))[1][0]:
            return None
        return GeoHull(np.vstack([hull.vertices(), point]), center=self._center)


def no_growth(points: Points) -> tuple[Rows, Floats]:
    """The answer of `Judge.too_large` for a hull without an area."""
    return np.zeros(len(points), np.bool_), np.full(len(points), np.nan)


def _speeds(lengths: Floats, elapsed: Microseconds) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        speeds: Floats = np.where(lengths == 0, 0.0, lengths / (elapsed / MICROSECONDS))
    return speeds


def _products(one: Points, other: Points) -> tuple[Floats, Floats]:
    """The cross products of vectors, and the sizes of their terms."""
    left, right = one[:, 0] * other[:, 1], one[:, 1] * other[:, 0]
    return left - right, np.abs(left) + np.abs(right)


def _rows(points: Points, vertices: Points) -> npt.NDArray[np.intp]:
    """The rows of points among the vertices of a hull, all of which are there. O(h + k log h)."""
    numbers, wanted = as_numbers(vertices), as_numbers(points)
    rightmost = int(np.argmax(numbers))
    rows = np.searchsorted(numbers[: rightmost + 1], wanted)
    above = numbers[np.minimum(rows, rightmost)] != wanted
    rows[above] = len(numbers) - 1 - np.searchsorted(numbers[:rightmost:-1], wanted[above])
    return rows


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
    volume = np.cross(starts - place, ends - place) @ place  # of differences: small hulls have small errors
    excesses: Floats = 2 * np.arctan2(volume, 1 + (starts * ends).sum(axis=1) + starts @ place + ends @ place)
    return excesses
