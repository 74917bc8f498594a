"""Exact decisions between convex polygons, live or not."""

import numpy as np

from .._hull import DynamicHull
from .._predicates import Point, cross_sign, direction_sign, dot_sign, orient2d
from ..arrays import Points
from ..measure._calipers import LEFT, edges, extremes
from ._difference import Corner, Walk


def certainly_apart(seen: Walk) -> bool:
    """Whether the last direction of a walk separates the two sets. Exact."""
    if not any(seen.nearest):
        return False
    x, y, _ = seen.nearest
    p, q = _ends(seen.last)
    return direction_sign((x, y), q, p) > 0


def certainly_touching(seen: Walk) -> bool:
    """Whether the simplex of a walk contains the origin. Exact: each sign is that of two differences of points."""
    corners = [_ends(corner) for corner in seen.simplex]
    if len(corners) == 1:
        return corners[0][0] == corners[0][1]
    if len(corners) == 2:
        (p, q), (r, s) = corners
        return cross_sign(q, p, s, r) == 0 and dot_sign(q, p, s, r) <= 0
    turns = {cross_sign(*reversed(corners[i - 1]), *reversed(corners[i])) for i in range(3)}
    return turns in ({1}, {-1})


def _ends(corner: Corner) -> tuple[Point, Point]:
    return corner.p[:2], corner.q[:2]


def polygons_intersect(a: Points, b: Points) -> bool:
    """Whether two hulls, given by their vertices, have a common point. Exact. O(h log h).

    If they have none, and do not both lie on one line, an edge of one of them separates the two.
    """
    if _edge_separates(a, b) or _edge_separates(b, a):
        return False
    together = np.concatenate([a, b])
    if len(a) > 2 or len(b) > 2 or np.any(orient2d(together[0], together[-1], together)):
        return True
    (a_low, a_high), (b_low, b_high) = sorted(a[[0, -1]].tolist()), sorted(b[[0, -1]].tolist())
    return bool(max(a_low, b_low) <= min(a_high, b_high))


def _edge_separates(a: Points, b: Points) -> bool:
    """Whether all of b lies strictly on the outer side of an edge of a."""
    if len(a) < 2:
        return False
    start, end = edges(a)
    return bool(np.any(np.asarray(orient2d(start, end, b[extremes(start, end, LEFT, b)])) < 0))


def distance_of_polygons(a: Points, b: Points) -> float:
    """The distance of two hulls without a common point, the exact value rounded. O(h log h)."""
    return float(min(DynamicHull(a).distance(b).min(), DynamicHull(b).distance(a).min()))
