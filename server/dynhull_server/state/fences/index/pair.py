"""Two hulls as wholes: whether they intersect, or are nearer than a distance."""

import math

import numpy as np

from dynhull.arrays import Points
from dynhull.convex import Cloud
from dynhull.gjk import Contact, contact, intersect
from dynhull.range_search import RangeSearch

from ...hull import Hull
from ...records import Center
from .globe import compared

# Distances whose rounded value differs from the limit by less, of the size of the hulls, are compared exactly: a
# hundred million times what rounding errors amount to.
DOUBTFUL = 1e-6
ROUNDED = 1e-14  # of the size: far more than what rounding makes of a place along a direction


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
        """Look at the hulls: O(log² h) for h vertices, or O(h) where rounding errors could decide about a limit."""
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
        center: the centre of b if they are geographic; None for planes.
    """
    if not (len(a) and len(b)):
        return False, math.inf
    if center is not None:
        return compared(a, b, limit, center)
    found = contact(Cloud(a), Cloud(b))
    near = intersect(Cloud(a), Cloud(b)) or (limit > 0 and _within(a, b, limit, found))
    return near, 0.0 if near and not limit else found.distance


def _within(a: Points, b: Points, limit: float, found: Contact) -> bool:
    """Whether two hulls that do not intersect are at most the limit apart, given their distance, rounded."""
    size = max(float(np.abs(a).max()), float(np.abs(b).max()), limit)
    if abs(found.distance - limit) > DOUBTFUL * size:
        return found.distance < limit
    # Of the closest points one is a corner, and along the normal nobody is nearer than the other hull begins.
    x, y = found.normal.tolist()
    with np.errstate(all="ignore"):
        ends, starts = a[:, 0] * x + a[:, 1] * y, b[:, 0] * x + b[:, 1] * y
        reach = limit + ROUNDED * size
        last, first = a[~(starts.min() - ends > reach)], b[~(starts - ends.max() > reach)]  # and what is no number
    return len(RangeSearch(last).hull(b, margin=limit)) + len(RangeSearch(first).hull(a, margin=limit)) > 0
