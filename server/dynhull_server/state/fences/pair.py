"""Two hulls as wholes: whether they intersect, or are nearer than a distance."""

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np

from dynhull.arrays import Points
from dynhull.convex import Cloud
from dynhull.gjk import contact, intersect

from ..hull import Hull
from .on_globe import compared

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
        self._as_of = self._changes()
        self.distance, self.near = math.inf, False
        if len(a) and len(b) and self.area.state.center is not None:
            self.near, self.distance = compared(self.area, self.other, self._limit)
        elif len(a) and len(b):
            self.distance = contact(Cloud(a), Cloud(b)).distance
            self.near = intersect(Cloud(a), Cloud(b)) or (self._limit > 0 and self._within(a, b))
            if self.near and not self._limit:
                self.distance = 0.0

    def _changes(self) -> tuple[int, int]:
        return self.area.state.hull.changes, self.other.state.hull.changes

    def _within(self, a: Points, b: Points) -> bool:
        """Whether two hulls that do not intersect are at most the limit apart."""
        size = max(float(np.abs(a).max()), float(np.abs(b).max()), self._limit)
        if abs(self.distance - self._limit) > DOUBTFUL * size:
            return self.distance < self._limit
        limit = Fraction(self._limit) ** 2
        one, other = ([(Fraction(x), Fraction(y)) for x, y in each.tolist()] for each in (a, b))
        return _some_nearer(one, other, limit) or _some_nearer(other, one, limit)


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
