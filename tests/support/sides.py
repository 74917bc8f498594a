"""The sides of points in whole numbers: what a fence must say, written down as plainly as possible.

Coordinates and lengths are whole numbers of a unit that the caller chooses.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf, isqrt

Point = tuple[int, int]
Ring = Sequence[Point]


def turn(a: Point, b: Point, c: Point) -> int:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def hull(points: Iterable[Point]) -> list[Point]:
    """The corners of the convex hull, by monotone chains."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    corners: list[Point] = []
    for chain in (ordered, ordered[::-1]):
        start = len(corners)
        for point in chain:
            while len(corners) >= start + 2 and turn(corners[-2], corners[-1], point) <= 0:
                corners.pop()
            corners.append(point)
        corners.pop()
    return corners if len(corners) > 2 else [ordered[0], ordered[-1]]


def edges(ring: Ring) -> list[tuple[Point, Point]]:
    return [(ring[i - 1], ring[i]) for i in range(len(ring))]


def on_segment(p: Point, a: Point, b: Point) -> bool:
    return (
        turn(a, b, p) == 0 and min(a[0], b[0]) <= p[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= p[1] <= max(a[1], b[1])
    )


def within(p: Point, ring: Ring) -> bool:
    """Whether a point is strictly inside of a ring, by the number of edges to its right."""
    inside = False
    for a, b in edges(ring):
        if (a[1] > p[1]) != (b[1] > p[1]):
            side = turn(a, b, p)
            inside ^= (side > 0) == (b[1] > a[1])
    return inside


def squared(p: Point, q: Point) -> int:
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2


def near(p: Point, a: Point, b: Point, limit: int) -> bool:
    """Whether a point is at most that far from a segment."""
    if min(squared(p, a), squared(p, b)) <= limit**2:
        return True
    along = (p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])
    return 0 < along < squared(a, b) and turn(a, b, p) ** 2 <= limit**2 * squared(a, b)


def meet(p: Point, q: Point, a: Point, b: Point) -> bool:
    """Whether two segments have a point in common."""
    if any(on_segment(point, *segment) for point, segment in ((p, (a, b)), (q, (a, b)), (a, (p, q)), (b, (p, q)))):
        return True
    return turn(p, q, a) * turn(p, q, b) < 0 and turn(a, b, p) * turn(a, b, q) < 0


def apart(one: Sequence[Point], other: Sequence[Point], limit: int) -> bool:
    """Whether two convex polygons, points or segments, given by their corners, are farther apart than that."""
    if not one or not other:
        return True
    a, b = Rings(((tuple(one),),)), Rings(((tuple(other),),))
    if a.holds(other[0], closed=True) or b.holds(one[0], closed=True):
        return False
    pairs = [(edge, beside) for edge in edges(one) for beside in edges(other)]
    if any(meet(*edge, *beside) for edge, beside in pairs):
        return False
    return not any(near(p, *beside, limit) for edge, beside in pairs for p in edge) and not any(
        near(p, *edge, limit) for edge, beside in pairs for p in beside
    )


def segment_distance(p: Point, a: Point, b: Point) -> Fraction:
    """The square of the distance of a point from a segment."""
    along = (p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])
    if 0 < along < squared(a, b):
        return Fraction(turn(a, b, p) ** 2, squared(a, b))
    return Fraction(min(squared(p, a), squared(p, b)))


def root_less(square: Fraction, less: int) -> float:
    """The square root of a number, less another one, in wholes instead of halves, rounded once."""
    scale = 2**200  # the integer part of the root has 200 more bits than it needs, and so decides the rounding
    root = Fraction(isqrt(square.numerator * scale**2 // square.denominator), scale)
    return float((root - less) / 2)


@dataclass(frozen=True)
class Rings:
    """Polygons joined by "or", each an exterior and holes; a point or a segment as a ring of one or two corners."""

    polygons: tuple[tuple[tuple[Point, ...], ...], ...]

    def boundary(self) -> list[tuple[Point, Point]]:
        return [edge for polygon in self.polygons for ring in polygon for edge in edges(ring)]

    def holds(self, p: Point, *, closed: bool) -> bool:
        for exterior, *holes in self.polygons:
            if any(on_segment(p, a, b) for ring in (exterior, *holes) for a, b in edges(ring)):
                if closed:
                    return True
            elif within(p, exterior) and not any(within(p, hole) for hole in holes):
                return True
        return False

    def farther(self, p: Point, margin: int, *, closed: bool) -> bool:
        """Whether a point is outside, and farther away than the margin."""
        if self.holds(p, closed=closed):
            return False
        degenerate = all(len(exterior) < 3 for exterior, *_ in self.polygons)
        if margin == 0 or (degenerate and not closed):  # an open point or segment is empty
            return True
        return not any(near(p, a, b, margin) for a, b in self.boundary())

    def clear(self, p: Point, error: int, *, closed: bool) -> bool:
        """Whether a point is inside or outside by more than an error above 0."""
        if all(len(exterior) < 3 for exterior, *_ in self.polygons) and not closed:
            return True
        inside = [polygon for polygon in self.polygons if Rings((polygon,)).holds(p, closed=False)]
        around = [[edge for ring in polygon for edge in edges(ring)] for polygon in inside or self.polygons]
        clear = [not any(near(p, a, b, error) for a, b in sides) for sides in around]
        return any(clear) if inside else all(clear)

    def distance(self, p: Point, *, closed: bool) -> float:
        """The distance of a point, rounded once."""
        degenerate = all(len(exterior) < 3 for exterior, *_ in self.polygons)
        if degenerate and not closed:
            return inf
        if self.holds(p, closed=True):
            return 0.0
        return root_less(min(segment_distance(p, a, b) for a, b in self.boundary()), 0) if self.polygons else inf

    def passed(self, p: Point, q: Point) -> bool:
        """Whether the way between two points outside meets the closed area."""
        return any(meet(p, q, a, b) for a, b in self.boundary())


@dataclass(frozen=True)
class Disk:
    """A disk."""

    center: Point
    radius: int

    def holds(self, p: Point, *, closed: bool) -> bool:
        distance = squared(p, self.center)
        return distance <= self.radius**2 if closed else distance < self.radius**2

    def farther(self, p: Point, margin: int, *, closed: bool) -> bool:
        if self.holds(p, closed=closed):
            return False
        if margin == 0 or (self.radius == 0 and not closed):  # an open disk of this radius is empty
            return True
        return squared(p, self.center) > (self.radius + margin) ** 2

    def clear(self, p: Point, error: int, *, closed: bool) -> bool:
        if not self.radius and not closed:
            return True
        square = squared(p, self.center)
        return (error < self.radius and square < (self.radius - error) ** 2) or square > (self.radius + error) ** 2

    def distance(self, p: Point, *, closed: bool) -> float:
        if not self.radius and not closed:
            return inf
        if self.holds(p, closed=True):
            return 0.0
        return root_less(Fraction(squared(p, self.center)), self.radius)

    def passed(self, p: Point, q: Point) -> bool:
        return near(self.center, p, q, self.radius)


Shape = Rings | Disk


def shape_of_hull(points: Iterable[Point]) -> Rings:
    corners = tuple(hull(points))
    return Rings(((corners,),) if corners else ())
