"""The Jarvis march, or gift wrapping: from each vertex to the next, comparing all points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._predicates import Point, orientation
from ..arrays import Points, as_points
from ._boundary import check_collinear, with_boundary_points
from .trace import Collinear, Push, Scan, Trace, Turn

if TYPE_CHECKING:
    from collections.abc import Iterable


def jarvis_march(xy: npt.ArrayLike, collinear: Collinear = "drop", trace: Trace | None = None) -> Points:
    """Convex hull by gift wrapping. O(n h) for h vertices.

    Jarvis, "On the identification of the convex hull of a finite set of points in the plane" (1973).

    Args:
        xy: (n, 2) array-like of finite numbers.
        collinear: "drop" returns true vertices only, "keep" every distinct point on the boundary.
        trace: a list to fill with one `Scan`, a `Push` a vertex, and a `Turn` for each comparison: from vertex a, is c
            to the right of the best point so far, b?

    Returns:
        (h, 2) points, counter-clockwise from the lexicographically smallest. All points on one line: two under "drop",
        all distinct points in order under "keep".

    Raises:
        ValueError, TypeError: bad input; the message names the first bad row.

    >>> from dynhull.static import jarvis_march
    >>> jarvis_march([[0, 0], [4, 0], [1, 1], [0, 4], [2, 0]]).tolist()
    [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]
    """
    check_collinear(collinear)
    points = list(dict.fromkeys(map(tuple, as_points(xy).tolist())))
    if trace is not None:
        trace.append(Scan("hull", tuple(points)))
    hull: list[Point] = []
    vertex = min(points, default=None)
    while vertex is not None:
        hull.append(vertex)
        if trace is not None:
            trace.append(Push(vertex))
        following = rightmost(vertex, points, trace)
        vertex = None if following in (hull[0], vertex) else following
    if collinear == "keep":
        hull = with_boundary_points(hull, points)
    return np.array(hull, dtype=np.float64).reshape(len(hull), 2)


def rightmost(p: Point, candidates: Iterable[Point], trace: Trace | None = None) -> Point:
    """The candidate that has no other to the right of the ray from p to it, the farthest of several. O(candidates).

    p is a vertex of the hull of all candidates and itself. Returns p where there is no other point.
    """
    best = p
    for q in candidates:
        if q == p:
            continue
        if best == p:
            best = q
            continue
        turn = orientation(p, best, q)
        if trace is not None:
            trace.append(Turn(p, best, q, turn))
        if turn < 0 or (turn == 0 and (p < best < q or p > best > q)):
            best = q
    return best
