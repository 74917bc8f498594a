"""Two hulls as wholes: whether they intersect, or are nearer than a distance."""

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np

from dynhull.arrays import Points
from dynhull.convex import Cloud
from dynhull.gjk import contact, intersect

from ...hull import Hull
from ...records import Center
from .globe import compared

# Distances whose rounded value differs from the limit by less, of the size of the hulls, are compared exactly: a
# hundred million times what rounding errors amount to.
DOUBTFUL = 1e-6

Corner = tuple[Fraction, Fraction]


class Pair:
    """The area and the other hull of a fence.

    Args:
        area: the hull that is the area.
        other: the other hull.
        limit: the distance up to which they are near; 0 for the intersection.

    Attributes:
        area, other: the hulls.
        near: whether they were near when they were last looked at.
        distance: their distance then, rounded; infinite if one of them is empty.
    """

    def __init__(self, area: Hull, other: Hull, limit: float) -> None:
        self.area = area
        self.other = other
        self._limit = limit
        self.near = False
        self.distance = math.inf
        self._as_of = (-1, -1)

    def moved(self) -> tuple[bool, bool]:
        """Whether the area and the other hull have changed since they were last looked at."""
        area, other = self._changes()
        return area != self._as_of[0], other != self._as_of[1]

    def look(self) -> None:
        """Look at the hulls: O(log² h) for h vertices, or O(h²) where rounding errors could decide about a limit."""
        a, b = self.area.state.vertices(), self.other.state.vertices()
        self.near, self.distance = nearness(a, b, self._limit, self.area.state.center)
        self._as_of = self._changes()

    def _changes(self) -> tuple[int, int]:
        return self.area.state.hull.changes, self.other.state.hull.changes


def nearness(a: Points, b: Points, limit: float, center: Center | None) -> tuple[bool, float]:
    """Whether two hulls intersect or are at most `limit` apart, and their distance, infinite if one is empty.

    Running time as of `Pair.look`.

    Args:
        a: the vertices of one,
        b: and of the other.
        limit: the distance up to which they are near; 0 for the intersection.
        center: the centre of both if they are geographic; None for planes.
    """
    if not (len(a) and len(b)):
        return False, math.inf
    if center is not None:
        return compared(a, b, limit, center)
    distance = contact(Cloud(a), Cloud(b)).distance
    near = intersect(Cloud(a), Cloud(b)) or (limit > 0 and _within(a, b, limit, distance))
    return near, 0.0 if near and not limit else distance


def _within(a: Points, b: Points, limit: float, distance: float) -> bool:
    """Whether two hulls that do not intersect are at most the limit apart, given their distance, rounded."""
    size = max(float(np.abs(a).max()), float(np.abs(b).max()), limit)
    if abs(distance - limit) > DOUBTFUL * size:
        return distance < limit
    square = Fraction(limit) ** 2
    one, other = ([(Fraction(x), Fraction(y)) for x, y in each.tolist()] for each in (a, b))
    return _some_nearer(one, other, square) or _some_nearer(other, one, square)


def _some_nearer(corners: list[Corner], ring: list[Corner], limit: Fraction) -> bool:
    """Whether a corner is within the distance, whose square is `limit`, of an edge of a ring. Exact."""
    edges = list(pairwise([*ring, ring[0]]))
    return any(_squared(corner, a, b) <= limit for corner in corners for a, b in edges)


def _squared(p: Corner, a: Corner, b: Corner) -> Fraction:
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = dx * dx + dy * dy
    along = (p[0] - a[0]) * dx + (p[1] - a[1]) * dy
    share = Fraction(0) if not length else min(max(along / length, Fraction(0)), Fraction(1))
    x, y = a[0] + share * dx - p[0], a[1] + share * dy - p[1]
    return x * x + y * y
