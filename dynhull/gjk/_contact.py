"""GJK on two convex sets, with EPA where they overlap, and exact decisions between polygons.

Gilbert, Johnson, Keerthi, "A fast procedure for computing the distance between complex objects in three-dimensional
space" (1988); van den Bergen, "Proximity queries and penetration depth computation on 3D game objects" (2001).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf
from typing import TypeVar

import numpy as np

from .._hull import DynamicHull
from ..arrays import Points
from ..convex import Cloud, Convex
from ..static import convex_hull
from ._core import core
from ._difference import Difference, Numbers, NumbersError, Walk, walk
from ._expand import expand
from ._polygons import certainly_apart, certainly_touching, distance_of_polygons, polygons_intersect
from ._vectors import scale, unit

T = TypeVar("T")


@dataclass(frozen=True)
class Contact:
    """How two convex sets lie to each other.

    Attributes:
        intersect: whether they have a point in common; touching counts.
        distance: 0.0 where they intersect.
        depth: how far one must move to part them; 0.0 where they do not overlap.
        normal: unit vector, from the first set to the second. Where they overlap, moving the second so by `depth` parts
            them. Where they merely touch, zero or the direction in which they part.
        points: (2, d), one of each set: the closest ones, or where they overlap the deepest of each in the other.
        iterations: of GJK and EPA, each of them one support point of each set.
    """

    intersect: bool
    distance: float
    depth: float
    normal: Points
    points: Points
    iterations: int


Shape = Convex | Sequence[Convex]


def intersect(a: Shape, b: Shape) -> bool:
    """Whether two sets have a point in common; touching counts.

    Exact for a `Cloud` in the plane (point, segment, box, polygon) or a `DynamicHull` against another; otherwise sets
    closer than about 1e-14 of their size may count as touching. Typically three to five iterations; on two live hulls
    each takes O(log n). Only hulls that are closer than rounding errors can tell are read in full, O(h log h).

    Args:
        a: a convex set, or several whose union is meant: see `dynhull.decompose` for concave polygons.
        b: the same.

    Raises:
        ValueError: the dimensions differ, are not 2 or 3, or a union or a hull is empty.

    >>> from dynhull.convex import ball, box
    >>> intersect(box([0, 0], [1, 1]), box([1, 1], [2, 2])), intersect(box([0, 0], [1, 1]), ball([3, 0.5], 1))
    (True, False)
    """
    return any(_intersect(p, q) for p, q in product(_pieces(a), _pieces(b)))


def contact(a: Shape, b: Shape) -> Contact:
    """How two sets lie to each other: distance and closest points, or depth of the overlap and the way out of it.

    Whether they intersect is decided as by `intersect`. Distance and depth, at every size from the smallest doubles to
    the largest: for points, segments, polygons, polyhedra and live hulls within 1e-12 of the extent of the two sets
    together, wherever they lie; moved, turned, scaled, rounded and added up, within 1e-12 of their largest coordinate;
    with other curves (a ball scaled unevenly) within 1e-6 of it. Below 1e-300, also within the smallest double; inf
    beyond the largest. Where floats cannot keep that, the same steps are done in fractions, some thirty times slower.
    Between unions, all pairs of pieces are looked at: the closest two are told, or the two that overlap most, whose
    depth is a lower bound of the unions'.

    Args:
        a: a convex set, or several whose union is meant.
        b: the same.

    Raises:
        ValueError: the dimensions differ, are not 2 or 3, or a union or a hull is empty.

    >>> from dynhull.convex import box
    >>> found = contact(box([0, 0, 0], [1, 1, 1]), box([4, 5, 0], [5, 6, 1]))
    >>> found.distance, found.points[:, :2].tolist()
    (5.0, [[1.0, 1.0], [4.0, 5.0]])
    >>> found = contact(box([0, 0], [4, 4]), box([3, 1], [9, 2]))
    >>> found.depth, found.normal.tolist()
    (1.0, [1.0, 0.0])
    """
    found = [_contact(p, q) for p, q in product(_pieces(a), _pieces(b))]
    best = min(found, key=lambda c: (c.distance, -c.depth))
    return replace(best, iterations=sum(c.iterations for c in found))


def _pieces(shape: Shape) -> Sequence[Convex]:
    if isinstance(shape, Convex):
        return [shape]
    if not shape:
        raise ValueError("a union of no pieces is empty: it is nowhere")
    return shape


def _intersect(a: Convex, b: Convex) -> bool:
    return _in_numbers_that_do(a, b, _are_touching)


def _contact(a: Convex, b: Convex) -> Contact:
    return _in_numbers_that_do(a, b, _in_contact)


def _in_numbers_that_do(a: Convex, b: Convex, find: Callable[[Convex, Convex, Difference, float, float], T]) -> T:
    """What is found from the difference of the sets' cores and the radius around each, in numbers that do."""
    if a.dimension != b.dimension or a.dimension not in (2, 3):
        raise ValueError(f"shapes must both be of dimension 2 or 3, got {a.dimension} and {b.dimension}")
    (inner_a, radius_a), (inner_b, radius_b) = core(a), core(b)
    numbers = Numbers()
    while True:
        try:
            return find(a, b, Difference(inner_a, inner_b, numbers), radius_a, radius_b)
        except NumbersError as error:
            numbers = error.numbers


def _are_touching(a: Convex, b: Convex, difference: Difference, radius_a: float, radius_b: float) -> bool:
    radius = radius_a + radius_b
    seen = walk(difference, enough=radius)
    if not (seen.sure or _are_polygons(a, b)):
        difference.doubt()
    return _meet(a, b, seen, radius / difference.scale)


def _in_contact(a: Convex, b: Convex, difference: Difference, radius_a: float, radius_b: float) -> Contact:
    seen = walk(difference, enough=inf)
    if not seen.sure:
        difference.doubt()
    iterations, points = seen.iterations, seen.points
    radius = (radius_a + radius_b) / difference.scale
    if seen.distance > 0:
        gap, outwards = seen.distance - radius, unit(scale(-1.0, seen.nearest))
    else:
        overlap = expand(difference, seen.simplex)
        iterations, points = iterations + overlap.iterations, overlap.points
        gap, outwards = -overlap.depth - radius, overlap.normal
    gap *= difference.scale
    d = a.dimension
    normal = np.array(outwards[:d]) + 0.0  # no negative zeros
    ends = np.array([p[:d] for p in points]) + np.outer([radius_a, -radius_b], normal)
    if _meet(a, b, seen, radius):
        return Contact(True, 0.0, max(-gap, 0.0), normal, ends, iterations)
    if gap <= 0:  # only exact arithmetic sees it
        gap = distance_of_polygons(_corners(a), _corners(b))
    return Contact(False, gap, 0.0, normal, ends, iterations)


def _meet(a: Convex, b: Convex, seen: Walk, radius: float) -> bool:
    """Whether the sets intersect, from the walk through their cores and the radius to scale: exact for polygons."""
    if not _are_polygons(a, b):
        return seen.distance <= radius
    if certainly_apart(seen):
        return False
    return certainly_touching(seen) or polygons_intersect(_corners(a), _corners(b))


def _are_polygons(a: Convex, b: Convex) -> bool:
    return all(isinstance(shape, Cloud | DynamicHull) and shape.dimension == 2 for shape in (a, b))


def _corners(shape: Convex) -> Points:
    if isinstance(shape, DynamicHull):
        return shape.vertices()
    assert isinstance(shape, Cloud)
    return convex_hull(shape.points)
