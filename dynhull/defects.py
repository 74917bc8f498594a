"""Convexity defects: where a contour leaves its hull, and how far."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._exact import Integers, root
from .arrays import as_points
from .measure._calipers import Indices, least, squared_height
from .static import convex_hull


@dataclass(frozen=True, eq=False)
class Defects:
    """One row for each edge of the hull that the contour leaves, in the order of the contour.

    Attributes:
        start: (k,) row of the contour where the defect begins, a corner of the hull.
        end: (k,) row where it ends, the next corner of the hull along the contour.
        farthest: (k,) row between the two that is farthest from the hull's edge; the first of several.
        depth: (k,) its distance from the edge's line: the exact value within one unit in the last place.
    """

    start: Indices
    end: Indices
    farthest: Indices
    depth: npt.NDArray[np.float64]


def convexity_defects(contour: npt.ArrayLike) -> Defects:
    """For each edge of a contour's hull the deepest point of the contour behind it. O(n log n).

    The convention of OpenCV's `convexityDefects`, whose depth is rounded to 1/256, without its restriction to integers
    or floats of single precision. Which point is deepest is decided exactly.

    Args:
        contour: (n, 2) corners of a simple polygon, either way around. Of a repeated corner of the hull, the first row
            counts. Fewer than three corners, or all on one line: no defects.

    Raises:
        ValueError, TypeError: bad points, or the hull's corners do not follow each other along the contour, which
            therefore crosses itself.

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
    """Edges of the hull as rows of the contour, in its order."""
    for around in (corners, corners[::-1]):
        first = around.index(min(around))
        ordered = around[first:] + around[:first]
        if ordered == sorted(around):
            return list(zip(ordered, ordered[1:] + ordered[:1], strict=True))
    raise ValueError("contour crosses itself: the corners of its hull do not follow each other along it")


def _negative_squared_height(a: Integers, b: Integers, p: Integers) -> tuple[Integers, Integers, Integers]:
    numerator, denominator, size = squared_height(a, b, p)
    return -numerator, denominator, size
