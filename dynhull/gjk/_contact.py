"""GJK on two convex sets, EPA if they overlap, and exact decisions between polygons.

Gilbert, Johnson, Keerthi, "A fast procedure for computing the distance between complex objects in three-dimensional
space" (1988); van den Bergen, "Proximity queries and penetration depth computation on 3D game objects" (2001).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf
from typing import Any, TypeVar

import numpy as np

from .._base import Hull
from .._sources import is_geometry
from .._value import Value
from ..arrays import Points
from ..convex import Cloud, Convex, Set, as_convex
from ..static import convex_hull
from ._core import core
from ._difference import Difference, Numbers, NumbersError, Walk, walk
from ._expand import expand
from ._polygons import certainly_apart, certainly_touching, distance_of_polygons, polygons_intersect
from ._vectors import scale, unit

T = TypeVar("T")


@dataclass(frozen=True, eq=False, repr=False)
class Contact(Value):
    """The distance or overlap of two convex sets.

    Attributes:
        intersect: whether they have a common point; touching counts.
        distance: 0.0 if they intersect.
        depth: the length of the shortest move that separates them; 0.0 if they do not overlap.
        normal: unit vector from the first set to the second. If they overlap, moving the second set along it by `depth`
            separates them. If they only touch, it is zero or the direction in which they separate.
        points: (2, d) one point of each set: the closest points, or, if they overlap, the deepest point of each in the
            other.
        iterations: the number of iterations of GJK and EPA; each takes one support point of each set.
    """

    intersect: bool
    distance: float
    depth: float
    normal: Points
    points: Points
    iterations: int


Shape = Set | Sequence[Set]


def intersect(a: Shape, b: Shape) -> bool:
    """Whether two sets have a common point; touching counts.

    Exact between two sets that are each a `Cloud` in the plane (point, segment, box, polygon) or a live hull.
    Otherwise sets closer than about 1e-14 of their size may count as touching. Typically three to five iterations; with
    two live hulls each takes O(log n). Hulls are read in full, O(h log h), only if they are so close that rounding
    errors could decide.

    Args:
        a: a convex set, or a sequence of convex sets for their union; `dynhull.decompose` makes one of a concave
            polygon. Points, a frame or a convex geometry stand for their hull.
        b: the same.

    Raises:
        ValueError: the dimensions differ, are not 2 or 3, a union or a hull is empty, or a geometry is not convex.

    >>> from dynhull.convex import ball, box
    >>> from dynhull.gjk import intersect
    >>> intersect(box([0, 0], [1, 1]), box([1, 1], [2, 2])), intersect(box([0, 0], [1, 1]), ball([3, 0.5], 1))
    (True, False)
    """
    return any(_intersect(p, q) for p, q in product(_pieces(a, "a"), _pieces(b, "b")))


def contact(a: Shape, b: Shape) -> Contact:
    """The distance and closest points of two sets, or the depth of their overlap and the shortest way out of it.

    Whether they intersect is decided as in `intersect`. Distance and depth have these errors, at every size from the
    smallest doubles to the largest:

    * points, segments, polygons, polyhedra and live hulls: within 1e-12 of the extent of the two sets together,
      wherever they are
    * moved, turned, scaled, rounded or added shapes: within 1e-12 of their largest coordinate
    * other curves, such as a cylinder, a cone or a ball scaled unevenly: within 1e-6 of it

    Results below 1e-300 may also be off by the smallest double; results beyond the largest double are inf. If floats
    cannot achieve this, the same steps run in fractions, about thirty times slower. Between unions, all pairs of pieces
    are examined; the result is that of the closest pair, or of the pair that overlaps most, whose depth is a lower
    bound for the unions.

    Args:
        a: a convex set, or a sequence of convex sets for their union, as in `intersect`.
        b: the same.

    Raises:
        ValueError: the dimensions differ, are not 2 or 3, a union or a hull is empty, or a geometry is not convex.

    >>> from dynhull.convex import box
    >>> from dynhull.gjk import contact
    >>> found = contact(box([0, 0, 0], [1, 1, 1]), box([4, 5, 0], [5, 6, 1]))
    >>> found.distance, found.points[:, :2].tolist()
    (5.0, [[1.0, 1.0], [4.0, 5.0]])
    >>> found = contact(box([0, 0], [4, 4]), box([3, 1], [9, 2]))
    >>> found.depth, found.normal.tolist()
    (1.0, [1.0, 0.0])
    """
    found = [_contact(p, q) for p, q in product(_pieces(a, "a"), _pieces(b, "b"))]
    best = min(found, key=lambda c: (c.distance, -c.depth))
    return replace(best, iterations=sum(c.iterations for c in found))


def _pieces(shape: Shape, name: str) -> list[Convex]:
    """The sets whose union an argument is. A list of points is one set, a list of anything else a union."""
    if isinstance(shape, Convex) or not isinstance(shape, Sequence) or (len(shape) and _is_row(shape[0])):
        return [as_convex(shape, name)]
    if not shape:
        raise ValueError("a union needs at least one piece")
    return [as_convex(piece, f"{name} piece {number}") for number, piece in enumerate(shape)]


def _is_row(value: Any) -> bool:
    return not is_geometry(value) and np.ndim(value) == 1


def _intersect(a: Convex, b: Convex) -> bool:
    return _in_numbers_that_do(a, b, _are_touching)


def _contact(a: Convex, b: Convex) -> Contact:
    return _in_numbers_that_do(a, b, _in_contact)


def _in_numbers_that_do(a: Convex, b: Convex, find: Callable[[Convex, Convex, Difference, float, float], T]) -> T:
    """Search the difference of the sets' cores, with the radius around each, in floats or, if necessary, fractions."""
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
    if gap <= 0:  # visible only in exact arithmetic
        gap = distance_of_polygons(_corners(a), _corners(b))
    return Contact(False, gap, 0.0, normal, ends, iterations)


def _meet(a: Convex, b: Convex, seen: Walk, radius: float) -> bool:
    """Whether the sets intersect, from the walk through their cores and the scaled radius. Exact for polygons."""
    if not _are_polygons(a, b):
        return seen.distance <= radius
    if certainly_apart(seen):
        return False
    return certainly_touching(seen) or polygons_intersect(_corners(a), _corners(b))


def _are_polygons(a: Convex, b: Convex) -> bool:
    return all(isinstance(shape, Cloud | Hull) and shape.dimension == 2 for shape in (a, b))


def _corners(shape: Convex) -> Points:
    if isinstance(shape, Hull):
        return shape.vertices()
    assert isinstance(shape, Cloud)
    return convex_hull(shape.points)
