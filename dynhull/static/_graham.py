"""The Graham scan: sort by angle around one vertex, then one pass."""

from __future__ import annotations

from functools import cmp_to_key
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._predicates import Point, orientation
from ..arrays import Points, as_points
from ._boundary import check_collinear, farther_first_on_last_ray
from .trace import Collinear, Pop, Push, Scan, Trace, Turn

if TYPE_CHECKING:
    from collections.abc import Sequence


def graham_scan(xy: npt.ArrayLike, collinear: Collinear = "drop", trace: Trace | None = None) -> Points:
    """Convex hull by Graham's scan. O(n log n).

    Graham, "An efficient algorithm for determining the convex hull of a finite planar set" (1972). The pivot is the
    lexicographically smallest point; of points at equal angles the nearer comes first.

    Args:
        xy: (n, 2) array-like of finite numbers.
        collinear: "drop" returns true vertices only, "keep" every distinct point on the boundary.
        trace: a list to fill with one `Scan`, which has the order by angle, then `Turn`, `Push` and `Pop` events. The
            orientations that the sort evaluates are not in it.

    Returns:
        (h, 2) points, counter-clockwise from the lexicographically smallest. All points on one line: two under "drop",
        all distinct points in order under "keep".

    Raises:
        ValueError, TypeError: bad input; the message names the first bad row.

    >>> from dynhull.static import graham_scan
    >>> trace = []
    >>> graham_scan([[0, 0], [4, 0], [1, 1], [0, 4]], trace=trace).tolist()
    [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]
    >>> from dynhull.static.trace import Turn
    >>> [(event.c, int(event.cross)) for event in trace if isinstance(event, Turn)]
    [((1.0, 1.0), 4), ((0.0, 4.0), -8), ((0.0, 4.0), 16)]
    """
    check_collinear(collinear)
    points = list(dict.fromkeys(map(tuple, as_points(xy).tolist())))
    order = by_angle(points)
    if collinear == "keep":
        farther_first_on_last_ray(order)
    if trace is not None:
        trace.append(Scan("hull", tuple(order)))
    hull = _scan(order, collinear, trace)
    return np.array(hull, dtype=np.float64).reshape(len(hull), 2)


def by_angle(points: Sequence[Point]) -> list[Point]:
    """Distinct points: the least, then the others counter-clockwise around it, the nearer first. O(n log n)."""
    if not points:
        return []
    pivot = min(points)

    def compare(p: Point, q: Point) -> int:
        # On one ray from the least point, lexicographic order is the order of distance.
        return -orientation(pivot, p, q) or (p > q) - (p < q)

    return [pivot, *sorted((p for p in points if p != pivot), key=cmp_to_key(compare))]


def _scan(order: Sequence[Point], collinear: Collinear, trace: Trace | None) -> list[Point]:
    kept_from = 1 if collinear == "drop" else 0
    hull: list[Point] = []
    for p in order:
        while len(hull) > 1:
            turn = orientation(hull[-2], hull[-1], p)
            if trace is not None:
                trace.append(Turn(hull[-2], hull[-1], p, turn))
            if turn >= kept_from:
                break
            popped = hull.pop()
            if trace is not None:
                trace.append(Pop(popped))
        hull.append(p)
        if trace is not None:
            trace.append(Push(p))
    return hull
