"""Convexity defects: the parts of a contour inside its hull, and their depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._exact import Integers, root
from ._value import Value
from .arrays import as_points
from .measure._calipers import Indices, least, squared_height
from .static import convex_hull


@dataclass(frozen=True, eq=False, repr=False)
class Defects(Value):
    """One row for each edge of the hull that the contour leaves, in the order of the contour.

    Attributes:
        start: (k,) rows of the contour where the defects begin, which are corners of the hull.
        end: (k,) rows where they end, the next corner of the hull along the contour.
        farthest: (k,) rows between the two that are farthest from the hull's edge; the first of several.
        depth: (k,) their distances from the edge's line, within one unit in the last place of the exact values.
    """

    start: Indices
    end: Indices
    farthest: Indices
    depth: npt.NDArray[np.float64]


def convexity_defects(contour: npt.ArrayLike) -> Defects:
    """The deepest point of the contour behind each edge of its hull. O(n log n).

    Follows the convention of OpenCV's `convexityDefects`, whose depth is rounded to 1/256, but is not restricted to
    integers or single precision. Which point is deepest is decided exactly.

    Args:
        contour: (n, 2) corners of a simple polygon, in either direction. For a repeated corner of the hull, the first
            row counts. A contour with fewer than three corners, or all on one line, has no defects.

    Raises:
        ValueError, TypeError: a point is bad, or the contour crosses itself, so that the corners of the hull are not in
            order along it.

    >>> from dynhull.defects import convexity_defects
    >>> found = convexity_defects([[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]])
    >>> found.start, found.end, found.farthest, found.depth
    (array([2]), array([4]), array([3]), array([3.]))
    """
    points = as_points(contour, "contour")
    first_row: dict[tuple[float, float], int] = {}
    for row, (x, y) in enumerate(points.tolist()):
        first_row.setdefault((x, y), row)
    corners = [first_row[x, y] for x, y in convex_hull(points).tolist()]
    found = []
    for start, end in _along_the_contour(corners) if len(corners) > 2 else []:
        between = np.arange(start + 1, end if end > start else end + len(points)) % len(points)
        if not between.size:
            continue
        p = points[between]
        squared, row = least(_negative_squared_height, *(np.broadcast_to(points[i], p.shape) for i in (start, end)), p)
        if squared:
            found.append((start, end, int(between[row]), root(-squared)))
    rows = np.array([defect[:3] for defect in found], dtype=np.int64).reshape(-1, 3)
    return Defects(rows[:, 0], rows[:, 1], rows[:, 2], np.array([depth for *_, depth in found], dtype=np.float64))


def _along_the_contour(corners: list[int]) -> list[tuple[int, int]]:
    """The edges of the hull as pairs of rows, in the order of the contour."""
    for around in (corners, corners[::-1]):
        first = around.index(min(around))
        ordered = around[first:] + around[:first]
        if ordered == sorted(around):
            return list(zip(ordered, ordered[1:] + ordered[:1], strict=True))
    raise ValueError("contour crosses itself: the corners of its hull are not in order along it")


def _negative_squared_height(a: Integers, b: Integers, p: Integers) -> tuple[Integers, Integers, Integers]:
    numerator, denominator, size = squared_height(a, b, p)
    return -numerator, denominator, size
