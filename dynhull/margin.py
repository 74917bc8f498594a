"""The widest gap between two sets of points, which a hard-margin support vector machine finds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._value import Value
from .arrays import Points, as_rows
from .convex import Cloud, Convex
from .gjk import contact


@dataclass(frozen=True, eq=False, repr=False)
class Margin(Value):
    """The line, or in space the plane, that separates two sets with the widest margin.

    Attributes:
        separable: whether there is a gap; touching sets have none.
        margin: the width of the gap; 0.0 without one.
        depth: the length of the shortest move that separates the sets; 0.0 if they do not overlap.
        normal: unit vector across the gap, from the first set to the second.
        offset: the line normal @ x = offset is halfway between the sets; the value is less on the first set's side.
        points: (2, d) the closest point of each hull; if they overlap, the deepest point of each.
        iterations: the number of iterations of GJK and, if the sets overlap, EPA.
    """

    separable: bool
    margin: float
    depth: float
    normal: Points
    offset: float
    points: Points
    iterations: int


def max_margin(a: npt.ArrayLike | Convex, b: npt.ArrayLike | Convex) -> Margin:
    """The maximum margin between two sets of points, or the depth of their hulls' overlap.

    The closest points of the hulls are those of the hard-margin support vector machine (Bennett and Bredensteiner,
    "Duality and geometry in SVM classifiers", 2000). Its weights are 2 normal / margin. Each step of GJK takes O(n), or
    O(log n) for live hulls, which are not read in full. There are a few steps, in practice at most O(log n).

    Whether there is a gap is exact in the plane; errors are those of `dynhull.gjk.contact`.

    Args:
        a: (n, d) points, d 2 or 3, or a `DynamicHull`, or any shape of `dynhull.convex`.
        b: the same.

    Raises:
        ValueError, TypeError: there are no points, a point is bad, or the dimensions differ.

    >>> from dynhull.margin import max_margin
    >>> gap = max_margin([[0, 0], [1, 0], [0, 1]], [[3, 0], [4, 4]])
    >>> gap.margin, gap.normal.tolist(), gap.offset
    (2.0, [1.0, 0.0], 2.0)
    >>> max_margin([[0, 0], [4, 0], [0, 4]], [[1, 1], [9, 9]]).separable
    False
    """
    found = contact(_shape(a), _shape(b))
    with np.errstate(over="ignore", invalid="ignore"):  # coordinates near the largest double
        offset = float(found.normal @ found.points.mean(axis=0))
    separable = not found.intersect
    return Margin(separable, found.distance, found.depth, found.normal, offset, found.points, found.iterations)


def _shape(points: npt.ArrayLike | Convex) -> Convex:
    return points if isinstance(points, Convex) else Cloud(as_rows(points))
