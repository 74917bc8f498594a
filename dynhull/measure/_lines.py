"""Distances of points to a convex polygon, and its intersections with lines."""

from bisect import bisect_left
from collections.abc import Callable, Sequence
from fractions import Fraction
from math import inf, nan

import numpy as np
import numpy.typing as npt

from .._exact import doubled_triangle, exact, root, rounded, squared_length
from .._predicates import Point, cross_sign, dot_sign, orientation
from ..arrays import Points, as_tuples


def distance(vertices: Points, tangents: npt.NDArray[np.float64], xy: Points) -> npt.NDArray[np.float64]:
    """The distance of each of (k, 2) points to the hull, the exact value rounded; 0.0 inside, inf without vertices.

    Args:
        vertices: (h, 2), counter-clockwise.
        tangents: (k, 2, 2) the left and right tangent point of each point; NaN if the point is not outside.
        xy: (k, 2) points.

    The distance falls, then rises along the chain that a point sees: O(h + k log h).
    """
    corners = as_tuples(vertices)
    if not corners:
        return np.full(len(xy), inf)
    numbers = {corner: i for i, corner in enumerate(corners)}
    result = np.zeros(len(xy))
    for row in np.flatnonzero(~np.isnan(tangents[:, 0, 0])).tolist():
        first, last = (numbers[x, y] for x, y in tangents[row].tolist())
        if len(corners) < 3:
            first, last = 0, len(corners) - 1
        x, y = xy[row].tolist()
        result[row] = root(_squared_distance(corners, first, (last - first) % len(corners), (x, y)))
    return result


def _squared_distance(corners: Sequence[Point], first: int, edges: int, p: Point) -> Fraction:
    """The squared distance of p to a chain, given by its first corner and number of edges; it falls, then rises."""
    low, high = 0, edges
    while low < high:
        middle = (low + high) // 2
        a, b = corners[(first + middle) % len(corners)], corners[(first + middle + 1) % len(corners)]
        if dot_sign(b, p, a, b) >= 0:  # the nearest point is b or beyond it
            low = middle + 1
        else:
            high = middle
    a = corners[(first + low) % len(corners)]
    if low == edges:
        return squared_length(a, p)
    b = corners[(first + low + 1) % len(corners)]
    if dot_sign(a, p, a, b) <= 0:
        return squared_length(a, p)
    return doubled_triangle(a, b, p) ** 2 / squared_length(a, b)


def intersect_lines(vertices: Points, p: Points, q: Points) -> npt.NDArray[np.float64]:
    """(k, 2, 2) points where the line through each p and q enters and leaves the hull, in the order from p to q.

    Each coordinate is the exact value rounded once. A line that touches a vertex gives it twice, a line along an edge
    gives the edge's ends; NaN for a line that misses. O(h + k log h).
    """
    corners = as_tuples(vertices)
    result = np.full((len(p), 2, 2), nan)
    if not corners:
        return result
    turning = corners.index(max(corners))
    lower, upper = corners[: turning + 1], [corners[0], *reversed(corners[turning:])]
    if turning == 0:
        upper = lower
    for row, (a, b) in enumerate(zip(p.tolist(), q.tolist(), strict=True)):
        ends = (a[0], a[1]), (b[0], b[1])
        crossing = _chord(lower, upper, min(ends), max(ends))
        if crossing is not None:
            result[row] = crossing if ends[0] < ends[1] else crossing[::-1]
    return result


def _chord(lower: Sequence[Point], upper: Sequence[Point], p: Point, q: Point) -> tuple[Point, Point] | None:
    """The points where the line from p to q, p < q, crosses the two chains: left, right."""
    lowest = bisect_left(range(len(lower) - 1), 1, key=lambda i: cross_sign(p, q, lower[i], lower[i + 1]))
    highest = bisect_left(range(len(upper) - 1), 1, key=lambda i: -cross_sign(p, q, upper[i], upper[i + 1]))
    for chain, i, outward in ((lower, lowest, 1), (upper, highest, -1)):
        turn = outward * orientation(p, q, chain[i])
        if turn > 0:
            return None
        if turn == 0:
            on_edge = i > 0 and orientation(p, q, chain[i - 1]) == 0
            return chain[i - 1] if on_edge else chain[i], chain[i]

    def cross(before: int, after: int, vertex: Callable[[int], Point]) -> Point:
        i = bisect_left(range(before + after + 1), 0, key=lambda i: orientation(p, q, vertex(i)))
        return _meet(p, q, vertex(i - 1), vertex(i))

    steps = len(lower) - 1 - lowest
    left = cross(lowest, highest, lambda i: lower[lowest - i] if i <= lowest else upper[i - lowest])
    right = cross(
        steps,
        len(upper) - 1 - highest,
        lambda i: lower[lowest + i] if i <= steps else upper[len(upper) - 1 - (i - steps)],
    )
    return left, right


def _meet(p: Point, q: Point, a: Point, b: Point) -> Point:
    """The point where the line through p and q crosses the segment from a to b, which it certainly does."""
    at_a, at_b = doubled_triangle(p, q, a), doubled_triangle(p, q, b)
    share = at_a / (at_a - at_b)
    (ax, ay), (bx, by) = exact(a), exact(b)
    return rounded(ax + share * (bx - ax)), rounded(ay + share * (by - ay))
