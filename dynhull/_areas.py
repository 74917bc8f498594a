"""Areas of fences: polygons with holes, disks and convex hulls. Where a point is, and how far away, exactly."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import inf, isqrt
from typing import TYPE_CHECKING, Protocol

from ._exact import doubled_triangle, exact, root, rounded, squared_length
from ._predicates import Point, dot_sign, orientation

if TYPE_CHECKING:
    from ._exact import Exact

Ring = tuple[Point, ...]
Polygon = tuple[Ring, ...]


class Area(Protocol):
    """A set of points, closed or open as the fence says. Two are equal if they are described in the same way."""

    def holds(self, p: Point, closed: bool) -> bool:
        """Whether p is inside, or on the boundary of a closed area. Exact."""

    def within(self, p: Point, margin: float) -> bool:
        """Whether p is inside, on the boundary, or at most `margin` from it. Exact."""

    def is_clear(self, p: Point, margin: float, error: float) -> bool:
        """Whether p is inside by more than an error above 0, or outside by more than `margin` and it. Exact."""

    def distance(self, p: Point) -> float:
        """The distance of p, rounded once: 0 inside and on the boundary, inf from an area without points."""

    def meets(self, p: Point, q: Point, closed: bool) -> bool:
        """Whether the segment from p to q has a point of the area. Exact."""

    def edges(self) -> list[tuple[Point, Point]]:
        """The edges of the boundary; none of a disk."""

    def around(self, p: Point) -> list[list[tuple[Point, Point]]]:
        """The edges of each polygon that p is inside of, and not on a ring of; none of a disk."""


@dataclass(frozen=True, slots=True)
class Polygons:
    """Polygons that are joined by "or", each an exterior and holes. Every ring is boundary. None: the empty area."""

    polygons: tuple[Polygon, ...]

    def holds(self, p: Point, closed: bool) -> bool:
        """Whether p is inside, or on a ring of a closed area. O(k) for k corners."""
        return any(_where(polygon, p) >= (0 if closed else 1) for polygon in self.polygons)

    def within(self, p: Point, margin: float) -> bool:
        """Whether p is inside, on a ring, or at most `margin` from one. O(k)."""
        if self.holds(p, closed=True):
            return True
        most = Fraction(margin) ** 2
        return any(
            squared_distance(p, a, b) <= most for a, b in self.edges() if not _certainly_farther(p, a, b, margin)
        )

    def is_clear(self, p: Point, margin: float, error: float) -> bool:
        """Whether p is farther than the error from the rings of a polygon that it is in, or with the margin of all."""
        if around := self.around(p):
            return any(_is_farther(p, edges, Fraction(error)) for edges in around)
        return _is_farther(p, self.edges(), Fraction(margin) + Fraction(error))

    def distance(self, p: Point) -> float:
        """The distance of p, rounded once. O(k)."""
        if not self.polygons:
            return inf
        return 0.0 if self.holds(p, closed=True) else root(min(squared_distance(p, a, b) for a, b in self.edges()))

    def meets(self, p: Point, q: Point, closed: bool) -> bool:
        """Whether the segment from p to q has a point of the area. O(k²) where it meets many edges."""
        if self.holds(p, closed) or self.holds(q, closed):
            return True
        if closed:
            return any(_segments_meet(p, q, a, b) for a, b in self.edges())
        return any(_passes_inside(polygon, p, q) for polygon in self.polygons)

    def edges(self) -> list[tuple[Point, Point]]:
        """The edges of all rings. O(k)."""
        return [edge for polygon in self.polygons for ring in polygon for edge in _edges(ring)]

    def around(self, p: Point) -> list[list[tuple[Point, Point]]]:
        """The edges of each polygon that p is inside of. O(k)."""
        inside = [polygon for polygon in self.polygons if _where(polygon, p) > 0]
        return [[edge for ring in polygon for edge in _edges(ring)] for polygon in inside]


@dataclass(frozen=True, slots=True)
class DiskArea:
    """All points at most `radius` from `center`; of an open one, those that are nearer."""

    center: Point
    radius: float

    def holds(self, p: Point, closed: bool) -> bool:
        """Whether p is inside, or on the circle of a closed disk. O(1)."""
        square, most = squared_length(self.center, p), Fraction(self.radius) ** 2
        return square <= most if closed else square < most

    def within(self, p: Point, margin: float) -> bool:
        """Whether p is at most radius + margin from the centre. O(1)."""
        return squared_length(self.center, p) <= (Fraction(self.radius) + Fraction(margin)) ** 2

    def is_clear(self, p: Point, margin: float, error: float) -> bool:
        """Whether p is nearer to the centre than radius - error, or farther than radius + margin + error. O(1)."""
        square, inner = squared_length(self.center, p), Fraction(self.radius) - Fraction(error)
        outer = Fraction(self.radius) + Fraction(margin) + Fraction(error)
        return (inner > 0 and square < inner**2) or square > outer**2

    def distance(self, p: Point) -> float:
        """The distance of p, rounded once. O(1)."""
        return root_minus(squared_length(self.center, p), Fraction(self.radius))

    def meets(self, p: Point, q: Point, closed: bool) -> bool:
        """Whether the segment from p to q has a point of the disk. O(1)."""
        square, most = squared_distance(self.center, p, q), Fraction(self.radius) ** 2
        return square <= most if closed else square < most

    def edges(self) -> list[tuple[Point, Point]]:
        """None."""
        return []

    def around(self, p: Point) -> list[list[tuple[Point, Point]]]:  # noqa: ARG002
        """None."""
        return []


@dataclass(frozen=True, slots=True)
class Segment:
    """A closed segment, or a point if both ends are the same: a hull of two vertices, or of one."""

    a: Point
    b: Point

    def holds(self, p: Point, closed: bool) -> bool:  # noqa: ARG002  # an open one is empty: see `hull_area`
        """Whether p is on the segment. O(1)."""
        return on_segment(p, self.a, self.b)

    def within(self, p: Point, margin: float) -> bool:
        """Whether p is at most `margin` from the segment. O(1)."""
        return squared_distance(p, self.a, self.b) <= Fraction(margin) ** 2

    def is_clear(self, p: Point, margin: float, error: float) -> bool:
        """Whether p is farther than margin + error from the segment, which has no inside. O(1)."""
        return squared_distance(p, self.a, self.b) > (Fraction(margin) + Fraction(error)) ** 2

    def distance(self, p: Point) -> float:
        """The distance of p, rounded once. O(1)."""
        return 0.0 if self.holds(p, closed=True) else root(squared_distance(p, self.a, self.b))

    def meets(self, p: Point, q: Point, closed: bool) -> bool:  # noqa: ARG002
        """Whether the segment from p to q has a point of this one. O(1)."""
        return _segments_meet(p, q, self.a, self.b)

    def edges(self) -> list[tuple[Point, Point]]:
        """The segment."""
        return [(self.a, self.b)]

    def around(self, p: Point) -> list[list[tuple[Point, Point]]]:  # noqa: ARG002
        """None: it has no inside."""
        return []


NOTHING = Polygons(())


def hull_area(vertices: list[Point], closed: bool) -> Area:
    """The convex polygon of these vertices, or a segment or a point, of which nothing is left if it is open."""
    if len(vertices) < 3:
        return Segment(vertices[0], vertices[-1]) if vertices and closed else NOTHING
    return Polygons(((tuple(vertices),),))


def disk_area(center: Point, radius: float, closed: bool) -> Area:
    """A disk; nothing if it is open and has no radius."""
    return DiskArea(center, radius) if closed or radius > 0 else NOTHING


def squared_distance(p: Point, a: Point, b: Point) -> Fraction:
    """The squared distance of p and the segment from a to b."""
    if dot_sign(a, p, a, b) <= 0:
        return squared_length(a, p)
    if dot_sign(b, p, a, b) >= 0:
        return squared_length(b, p)
    return doubled_triangle(a, b, p) ** 2 / squared_length(a, b)


def root_minus(square: Fraction, less: Fraction) -> float:
    """The double nearest to the square root of a rational number minus another; 0.0 if that is negative."""
    if square <= less * less:
        return 0.0
    bits = 64
    while True:
        whole = isqrt((square.numerator << 2 * bits) // square.denominator)
        least, most = Fraction(whole, 1 << bits) - less, Fraction(whole + 1, 1 << bits) - less
        if Fraction(whole, 1 << bits) ** 2 == square:
            return rounded(least)
        if least > 0 and rounded(least) == rounded(most):
            return rounded(least)
        bits *= 2


def _is_farther(p: Point, edges: list[tuple[Point, Point]], length: Fraction) -> bool:
    """Whether p is farther than a length from each edge."""
    return all(squared_distance(p, a, b) > length**2 for a, b in edges)


def _edges(ring: Ring) -> list[tuple[Point, Point]]:
    return list(pairwise((*ring, ring[0])))


def _where(polygon: Polygon, p: Point) -> int:
    """+1 inside, 0 on a ring, -1 outside."""
    exterior, *holes = polygon
    sign = _where_in_ring(exterior, p)
    for hole in holes:
        if sign > 0:
            sign = -_where_in_ring(hole, p)
    return sign


def _where_in_ring(ring: Ring, p: Point) -> int:
    x, y = p
    inside = False
    for a, b in _edges(ring):
        if (a[1] < y and b[1] < y) or (a[1] > y and b[1] > y) or (a[0] < x and b[0] < x):
            continue
        turn = orientation(a, b, p)
        if turn == 0 and min(a, b) <= p <= max(a, b):
            return 0
        inside ^= (a[1] > y) != (b[1] > y) and (turn > 0) == (b[1] > a[1])
    return 1 if inside else -1


def on_segment(p: Point, a: Point, b: Point) -> bool:
    return min(a, b) <= p <= max(a, b) and orientation(a, b, p) == 0


def _certainly_farther(p: Point, a: Point, b: Point, margin: float) -> bool:
    """Whether p is farther than the margin from the edge's box, by exact differences."""
    for axis in (0, 1):
        low, high, at = min(a[axis], b[axis]), max(a[axis], b[axis]), p[axis]
        gap = low - at if at < low else at - high
        if gap > margin and max(Fraction(low) - Fraction(at), Fraction(at) - Fraction(high)) > margin:
            return True
    return False


def _segments_meet(p: Point, q: Point, a: Point, b: Point) -> bool:
    if any(
        max(p[axis], q[axis]) < min(a[axis], b[axis]) or max(a[axis], b[axis]) < min(p[axis], q[axis])
        for axis in (0, 1)
    ):
        return False
    return (
        orientation(p, q, a) * orientation(p, q, b) <= 0
        and orientation(a, b, p) * orientation(a, b, q) <= 0
        and (p != q or on_segment(p, a, b))
        and (a != b or on_segment(a, p, q))
    )


def _passes_inside(polygon: Polygon, p: Point, q: Point) -> bool:
    """Whether a part of the segment between p and q is inside: of the parts into which the edges divide it."""
    start, end = exact(p), exact(q)
    way = end[0] - start[0], end[1] - start[1]
    shares = {Fraction(0), Fraction(1)}
    for ring in polygon:
        for a, b in _edges(ring):
            if _segments_meet(p, q, a, b):
                shares |= _shares(start, way, exact(a), exact(b))
    for before, after in pairwise(sorted(shares)):
        middle = (before + after) / 2
        if _holds_exact(polygon, (start[0] + middle * way[0], start[1] + middle * way[1])):
            return True
    return False


def _shares(start: Exact, way: Exact, a: Exact, b: Exact) -> set[Fraction]:
    """Where an edge that the segment meets divides it: shares of the way from its start."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    turn = way[0] * uy - way[1] * ux
    if turn != 0:
        return {((a[0] - start[0]) * uy - (a[1] - start[1]) * ux) / turn}
    square = way[0] ** 2 + way[1] ** 2
    if square == 0:
        return set()
    ends = (((end[0] - start[0]) * way[0] + (end[1] - start[1]) * way[1]) / square for end in (a, b))
    return {share for share in ends if 0 < share < 1}


def _holds_exact(polygon: Polygon, p: Exact) -> bool:
    """Whether a rational point is strictly inside."""
    inside = False
    for ring in polygon:
        for a, b in _edges(ring):
            (ax, ay), (bx, by) = exact(a), exact(b)
            turn = (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax)
            between = min(ax, bx) <= p[0] <= max(ax, bx) and min(ay, by) <= p[1] <= max(ay, by)
            if turn == 0 and between:
                return False
            inside ^= (ay > p[1]) != (by > p[1]) and (turn > 0) == (by > ay)
    return inside
