"""Measures of a convex polygon given by its (h, 2) vertices, counter-clockwise. O(h) each."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import fsum, hypot, inf, isqrt, nan
from typing import Self

import numpy as np
import numpy.typing as npt

from .arrays import Points
from .predicates import Point, cross_sign, dot_sign, orientation

Exact = tuple[Fraction, Fraction]


def area(vertices: Points) -> float:
    """The exact area, rounded once; inf where that is beyond every double."""
    return _rounded(_doubled_area(_exact(vertices)) / 2)


def perimeter(vertices: Points) -> float:
    """Length of the boundary, within one unit in the last place an edge; two vertices count there and back.

    inf where that is beyond every double.
    """
    rows = vertices.tolist()
    lengths = [hypot(x - px, y - py) for (x, y), (px, py) in zip(rows, rows[-1:] + rows[:-1], strict=True)]
    try:
        return fsum(lengths)
    except OverflowError:
        return inf


def centroid(vertices: Points) -> tuple[float, float]:
    """The exact centre of area, rounded once; the middle of a segment; NaN for no vertices."""
    corners = _exact(vertices)
    if not corners:
        return nan, nan
    doubled = _doubled_area(corners)
    if doubled == 0:
        weights = [Fraction(1, len(corners))] * len(corners)
    else:
        weights = [Fraction(0)] * len(corners)
        for i in range(len(corners)):
            share = _cross(corners[i - 1], corners[i]) / (3 * doubled)
            weights[i - 1] += share
            weights[i] += share
    x, y = (sum((w * c[axis] for w, c in zip(weights, corners, strict=True)), Fraction(0)) for axis in (0, 1))
    return _rounded(x), _rounded(y)


def bounds(vertices: Points) -> tuple[float, float, float, float]:
    """Least x, least y, greatest x, greatest y. Exact; NaN for no vertices."""
    if not len(vertices):
        return nan, nan, nan, nan
    (x0, y0), (x1, y1) = vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()
    return x0, y0, x1, y1


def diameter(vertices: Points) -> float:
    """The greatest distance of two vertices, the exact value rounded; 0.0 for fewer than two. Rotating calipers, O(h).

    Shamos, "Computational geometry" (1978).
    """
    corners = _corners(vertices)
    pairs = [(corners[0], corners[1])] if len(corners) == 2 else _antipodes(corners)
    return _root(max((_squared_length(a, b) for a, b in pairs), default=Fraction(0)))


def width(vertices: Points) -> float:
    """The least distance of two parallel lines with all points between them, the exact value rounded; 0.0 when flat.

    Houle and Toussaint, "Computing the width of a set" (1988): one of the lines passes through an edge. O(h).
    """
    corners = _corners(vertices)
    squares = (
        _doubled_triangle(a, b, corners[far]) ** 2 / _squared_length(a, b) for a, b, _, far, _ in _calipers(corners)
    )
    return _root(min(squares, default=Fraction(0)))


def min_box(vertices: Points) -> Points:
    """(4, 2) corners of the smallest box in any direction around the points, counter-clockwise, each rounded once.

    Freeman and Shapira, "Determining the minimum-area encasing rectangle for an arbitrary closed curve" (1975): one of
    its sides lies on an edge. O(h). A flat hull's box is flat; NaN for no vertices.
    """
    corners = _corners(vertices)
    if len(corners) < 3:
        ends = np.array(corners or [(nan, nan)])
        return np.asarray(ends[[0, -1, -1, 0]], dtype=np.float64)
    boxes = (
        _Box.on_edge(a, b, corners[front], corners[far], corners[back]) for a, b, front, far, back in _calipers(corners)
    )
    return np.array(min(boxes, key=lambda box: box.area).corners())


def distance(vertices: Points, tangents: npt.NDArray[np.float64], xy: Points) -> npt.NDArray[np.float64]:
    """The distance of each of (k, 2) points to the hull, the exact value rounded; 0.0 inside, inf without vertices.

    Args:
        vertices: (h, 2), counter-clockwise.
        tangents: (k, 2, 2), for each point the left and the right tangent point, NaN where it is not outside.
        xy: (k, 2) points.

    Along the chain that a point sees the distance falls, then rises: O(h + k log h).
    """
    corners = _corners(vertices)
    if not corners:
        return np.full(len(xy), inf)
    numbers = {corner: i for i, corner in enumerate(corners)}
    result = np.zeros(len(xy))
    for row in np.flatnonzero(~np.isnan(tangents[:, 0, 0])).tolist():
        first, last = (numbers[x, y] for x, y in tangents[row].tolist())
        if len(corners) < 3:
            first, last = 0, len(corners) - 1
        x, y = xy[row].tolist()
        result[row] = _root(_squared_distance(corners, first, (last - first) % len(corners), (x, y)))
    return result


def _squared_distance(corners: Sequence[Point], first: int, edges: int, p: Point) -> Fraction:
    """From p to the chain of so many edges that begins at a corner: its distance falls, then rises."""
    low, high = 0, edges
    while low < high:
        middle = (low + high) // 2
        a, b = corners[(first + middle) % len(corners)], corners[(first + middle + 1) % len(corners)]
        if dot_sign(b, p, a, b) >= 0:  # the nearest point is b, or comes after it
            low = middle + 1
        else:
            high = middle
    a = corners[(first + low) % len(corners)]
    if low == edges:
        return _squared_length(a, p)
    b = corners[(first + low + 1) % len(corners)]
    if dot_sign(a, p, a, b) <= 0:
        return _squared_length(a, p)
    return _doubled_triangle(a, b, p) ** 2 / _squared_length(a, b)


def intersect_lines(vertices: Points, p: Points, q: Points) -> npt.NDArray[np.float64]:
    """(k, 2, 2) where the line through each p and q enters and leaves the hull, in the order from p to q.

        _Box.on_edge(a, b, corners[front], corners[far], corners[back])
        for a, b, front, far, back in _calipers(corners)
    ends; NaN for a line that misses. O(h + k log h).
    """
    corners = _corners(vertices)
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
    """Where the line from p to q, p < q, crosses the two chains: on the left, on the right."""
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
    """Where the line through p and q crosses the segment from a to b: their sides differ, or b is on the line."""
    at_a, at_b = _doubled_triangle(p, q, a), _doubled_triangle(p, q, b)
    share = at_a / (at_a - at_b)
    ax, ay = Fraction(a[0]), Fraction(a[1])
    return _rounded(ax + share * (Fraction(b[0]) - ax)), _rounded(ay + share * (Fraction(b[1]) - ay))


def _corners(vertices: Points) -> list[Point]:
    return [(x, y) for x, y in vertices.tolist()]


def _calipers(corners: Sequence[Point]) -> Iterator[tuple[Point, Point, int, int, int]]:
    """For each edge (a, b): the numbers of the last corner along it, the farthest from its line, the first along it.

    Each only moves on from edge to edge: O(h) in all. Nothing for fewer than three corners.
    """
    count = len(corners)
    front = far = back = 1
    for i in range(count if count > 2 else 0):
        a, b = corners[i], corners[(i + 1) % count]
        front = max(front, i + 1)
        while dot_sign(a, b, corners[front % count], corners[(front + 1) % count]) > 0:
            front += 1
        far = max(far, front)
        while cross_sign(a, b, corners[far % count], corners[(far + 1) % count]) > 0:
            far += 1
        back = max(back, far)
        while dot_sign(a, b, corners[back % count], corners[(back + 1) % count]) < 0:
            back += 1
        yield a, b, front % count, far % count, back % count


def _antipodes(corners: Sequence[Point]) -> Iterator[tuple[Point, Point]]:
    """All pairs of corners that have parallel lines through them with all points in between."""
    for a, b, _, far, _ in _calipers(corners):
        yield a, corners[far]
        yield b, corners[far]
        after = corners[(far + 1) % len(corners)]
        if cross_sign(a, b, corners[far], after) == 0:  # a parallel edge
            yield a, after
            yield b, after


@dataclass
class _Box:
    """A box along an edge, in multiples of the edge's vector: where it begins and ends along it, its height."""

    corner: Exact
    vector: Exact
    begin: Fraction
    end: Fraction
    height: Fraction

    @classmethod
    def on_edge(cls, a: Point, b: Point, front: Point, far: Point, back: Point) -> Self:
        (ax, ay), (bx, by) = _exact_point(a), _exact_point(b)
        ux, uy = bx - ax, by - ay
        squared = ux * ux + uy * uy
        begin, end = (((x - ax) * ux + (y - ay) * uy) / squared for x, y in map(_exact_point, (back, front)))
        return cls((ax, ay), (ux, uy), begin, end, _doubled_triangle(a, b, far) / squared)

    @property
    def area(self) -> Fraction:
        return (self.end - self.begin) * self.height * (self.vector[0] ** 2 + self.vector[1] ** 2)

    def corners(self) -> list[Point]:
        (x, y), (ux, uy) = self.corner, self.vector
        places = (self.begin, 0), (self.end, 0), (self.end, self.height), (self.begin, self.height)
        return [(_rounded(x + s * ux - t * uy), _rounded(y + s * uy + t * ux)) for s, t in places]


def _exact_point(p: Point) -> Exact:
    return Fraction(p[0]), Fraction(p[1])


def _squared_length(a: Point, b: Point) -> Fraction:
    (ax, ay), (bx, by) = _exact_point(a), _exact_point(b)
    return (bx - ax) ** 2 + (by - ay) ** 2


def _doubled_triangle(a: Point, b: Point, c: Point) -> Fraction:
    (ax, ay), (bx, by), (cx, cy) = _exact_point(a), _exact_point(b), _exact_point(c)
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _root(value: Fraction) -> float:
    """The square root of a rational number, within one unit in the last place; inf where no double is so large."""
    if value == 0:
        return 0.0
    # A quotient of at least 2 * 64 bits whose power of two is even: its root has 64 bits or more.
    shift = 130 - value.numerator.bit_length() + value.denominator.bit_length()
    shift += shift % 2
    scaled = (value.numerator << shift if shift > 0 else value.numerator) // (
        value.denominator if shift > 0 else value.denominator << -shift
    )
    half = Fraction(2) ** (-shift // 2)
    return _rounded(isqrt(scaled) * half)


def _exact(vertices: Points) -> list[Exact]:
    return [_exact_point(corner) for corner in _corners(vertices)]


def _cross(p: Exact, q: Exact) -> Fraction:
    return p[0] * q[1] - p[1] * q[0]


def _doubled_area(corners: list[Exact]) -> Fraction:
    return sum((_cross(corners[i - 1], corners[i]) for i in range(len(corners))), Fraction(0))


def _rounded(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")
