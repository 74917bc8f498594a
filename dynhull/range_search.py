"""Which points are in an area: computed from scratch, and exact. The reference for what `FenceIndex` keeps up to date.

>>> from dynhull.range_search import RangeSearch
>>> search = RangeSearch([[1, 1], [5, 1], [4, 2]])
>>> search.polygons([[[[0, 0], [4, 0], [4, 4], [0, 4]]]]).tolist()
[0, 2]
>>> search.disk(0, 1, 4, margin=1).tolist()
[0, 1, 2]
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.ma  # np.unique needs it, and two threads cannot import it at its first call: python/cpython#149728

from ._areas import on_segment, squared_distance
from ._exact import squared_length
from ._fence_index import as_length, require_convex
from ._rings import as_polygons, at_one_height, ring_signs
from .arrays import as_coordinate, as_points, as_tuples

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from .arrays import Points

    Rows = npt.NDArray[np.intp]
    Flags = npt.NDArray[np.bool_]

__all__ = ["RangeSearch"]

# Of the size of the numbers: distances whose rounded value is nearer to the limit are compared in rational numbers. A
# million times what rounding errors amount to.
DOUBTFUL = 1e-9
# Beyond these, squares may overflow or underflow.
SMALLEST, LARGEST = 1e-140, 1e140
CORNERS_OF_A_POLYGON = 3


class RangeSearch:
    """Points, sorted once, of which areas select some. O(n log n).

    The methods return the rows of the points in an area, ascending: (m,) integers. Areas and their settings are those
    of `FenceIndex`: an area is closed (its boundary belongs to it) or open; with a `margin`, all points are in it that
    are nearer than that to it, or as near.

    Args:
        points: (n, 2) array-like.
    """

    __slots__ = ("_order", "_points", "_x")

    def __init__(self, points: npt.ArrayLike) -> None:
        self._points = as_points(points)
        self._order = np.argsort(self._points[:, 0], kind="stable")
        self._x = self._points[self._order, 0]

    def polygons(self, polygons: Any, *, closed: bool = True, margin: float = 0.0) -> Rows:
        """The points in polygons with holes, joined by "or", given as to `FenceIndex.set_polygons`.

        O(log n) and O(1) for each point between the least and the greatest x of a polygon, each edge, and each pair of
        them that overlaps in y.

        Raises:
            ValueError: a ring is not valid, or the margin is bad.
        """
        reach = as_length(margin, "margin")
        found: Rows = np.empty(0, np.intp)
        for rings in as_polygons(polygons):
            found = np.union1d(found, self._in_polygon(rings, closed, reach))
        return found

    def disk(self, x: float, y: float, radius: float, *, closed: bool = True, margin: float = 0.0) -> Rows:
        """The points whose distance from (x, y) is at most, if open below, the radius. O(log n), and O(1) as above.

        Raises:
            ValueError: a coordinate is not finite, or the radius or the margin is negative.
        """
        center = as_coordinate(x, "x"), as_coordinate(y, "y")
        lengths = as_length(radius, "radius"), as_length(margin, "margin")
        most, strict = sum(map(Fraction, lengths)), not closed and not lengths[1]
        if not closed and not lengths[0]:
            return np.empty(0, np.intp)
        at = np.array([center])
        rows = self._between(at, at, sum(lengths))
        near = self._points[rows]
        with np.errstate(all="ignore"):
            distances = np.hypot(*(near - at).T)
            size = np.abs(near).max(axis=1, initial=max(map(abs, center))) + sum(lengths)

        def holds(row: int) -> bool:
            square = squared_length(center, as_tuples(near[row : row + 1])[0])
            return square < most**2 if strict else square <= most**2

        return np.sort(rows[_at_most(distances, sum(lengths), size, holds)])

    def hull(self, vertices: npt.ArrayLike, *, closed: bool = True, margin: float = 0.0) -> Rows:
        """The points in a convex hull, given as to `FenceIndex.set_hull`. Running time as of `polygons`.

        Raises:
            ValueError: the vertices are not those of a convex polygon, or the margin is bad.
        """
        corners, reach = as_points(vertices, "vertices"), as_length(margin, "margin")
        require_convex(corners)
        if len(corners) >= CORNERS_OF_A_POLYGON:
            return np.sort(self._in_polygon([corners], closed, reach))
        if not len(corners) or not closed:
            return np.empty(0, np.intp)
        rows = self._between(corners.min(axis=0), corners.max(axis=0), reach)
        near, (a, *_, b) = self._points[rows], as_tuples(corners[[0, -1]])
        held = np.array([on_segment(p, a, b) for p in as_tuples(near)], np.bool_)
        if reach:
            held |= _near_edges(near, corners[:1], corners[-1:], reach)
        return np.sort(rows[held])

    def _in_polygon(self, rings: list[Points], closed: bool, margin: float) -> Rows:
        exterior, *holes = rings
        rows = self._between(exterior.min(axis=0), exterior.max(axis=0), margin)
        near = self._points[rows]
        signs = ring_signs(exterior, near)
        for hole in holes:
            within = np.flatnonzero(signs > 0)
            signs[within] = -ring_signs(hole, near[within])
        held = signs >= (0 if closed or margin else 1)
        if margin:
            out = np.flatnonzero(~held)
            a = np.concatenate(rings)
            b = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
            held[out] = _near_edges(near[out], a, b, margin)
        return rows[held]

    def _between(self, least: Points, greatest: Points, margin: float) -> Rows:
        """The rows of the points in a box, and at most a margin outside; perhaps some more."""
        with np.errstate(over="ignore"):
            low, high = _below(least - margin).ravel(), _above(greatest + margin).ravel()
        first, end = np.searchsorted(self._x, low[0], "left"), np.searchsorted(self._x, high[0], "right")
        rows = self._order[first:end]
        y = self._points[rows, 1]
        selected: Rows = rows[(low[1] <= y) & (y <= high[1])]
        return selected


def _near_edges(points: Points, a: Points, b: Points, margin: float) -> Flags:
    """(n,) whether points are at most the margin from one of the edges from a to b. Exact."""
    found = np.zeros(len(points), np.bool_)
    with np.errstate(over="ignore"):
        low, high = _below(np.minimum(a, b) - margin), _above(np.maximum(a, b) + margin)
    for rows, edges in at_one_height(points, low[:, 1], high[:, 1]):
        x, y = points[rows, 0, None], points[rows, 1, None]
        meets = (low[edges, 1] <= y) & (y <= high[edges, 1]) & (low[edges, 0] <= x) & (x <= high[edges, 0])
        which, e = np.nonzero(meets)
        _decide_near(points, a, b, margin, rows[which], edges[e], found)
    return found


def _decide_near(points: Points, a: Points, b: Points, margin: float, p: Rows, e: Rows, found: Flags) -> None:
    """Note the points p, of pairs of a point and an edge, that are near enough."""
    at, start, end = points[p], a[e], b[e]
    with np.errstate(all="ignore"):
        way, from_start = end - start, at - start
        share = (from_start * way).sum(axis=1) / (way * way).sum(axis=1)
        away = from_start - np.clip(np.nan_to_num(share), 0, 1)[:, None] * way
        distances = np.hypot(*away.T)
        size = np.abs(np.hstack([at, start, end])).max(axis=1, initial=0) + margin
    limit = Fraction(margin) ** 2

    def holds(row: int) -> bool:
        if found[p[row]]:
            return True
        one, two, three = (as_tuples(ends[row : row + 1])[0] for ends in (at, start, end))
        return squared_distance(one, two, three) <= limit

    found[p[_at_most(distances, margin, size, holds)]] = True


def _at_most(
    distances: npt.NDArray[np.float64], limit: float, size: npt.NDArray[np.float64], holds: Callable[[int], bool]
) -> Flags:
    """(n,) whether distances, rounded, are at most a limit; `holds` decides about a row in rational numbers."""
    with np.errstate(all="ignore"):
        certain = (np.abs(distances - limit) > DOUBTFUL * size) & (size > SMALLEST) & (size < LARGEST)
    nearer: Flags = certain & (distances < limit)
    for row in np.flatnonzero(~certain).tolist():
        nearer[row] = holds(row)
    return nearer


def _below(values: Points) -> Points:
    return np.nextafter(values, -np.inf)


def _above(values: Points) -> Points:
    return np.nextafter(values, np.inf)
