"""A few vertices of a hull that show its shape."""

from heapq import heappop, heappush
from itertools import count, pairwise
from math import frexp, ldexp, sqrt

from ._nodes import LOWER, SIDES, SIGNS, UPPER, Cursor, Edge, Tree, first_point, last_point
from ._predicates import Point, cross_sign


def sketch(tree: Tree, ends: tuple[Point, Point], most: int) -> tuple[list[Point], list[Point]]:
    """At most that many vertices, at least 4; and, for each edge beyond which are others, its ends and the farthest.

    Begins with the extreme vertices along the axes, and adds the vertex farthest from its edge, after the adaptive
    sampling of Hershberger and Suri (2008). Between two extreme vertices a chain turns by a right angle at most, so a
    vertex beyond an edge is nearest to a point between the edge's ends. O(most log n).

    Args:
        tree: has points.
        ends: an uppermost vertex and a lowermost one.
        most: the greatest number of vertices.
    """
    first, last = first_point(tree), last_point(tree)
    chains = [sorted({first, end, last}) for end in ends]
    scale = -frexp(max(abs(c) for chain in chains for p in chain for c in p))[1]
    beyond: list[tuple[float, int, int, Edge, Point]] = []  # the highest first; among equals, the earliest
    numbers = count()

    def consider(side: int, a: Point, b: Point) -> None:
        apex = farthest(Cursor(tree, side, a, b), side, a, b)
        if apex not in (a, b):
            heappush(beyond, (-_height(a, b, apex, scale), next(numbers), side, (a, b), apex))

    for side in SIDES:
        for a, b in pairwise(chains[side]):
            consider(side, a, b)
    while beyond and len(chains[UPPER]) + len(chains[LOWER]) - 2 < most:
        _, _, side, (a, b), apex = heappop(beyond)
        chains[side].append(apex)
        consider(side, a, apex)
        consider(side, apex, b)
    upper, lower = sorted(chains[UPPER]), sorted(chains[LOWER])
    return lower + upper[-2:0:-1], [row for *_, edge, apex in sorted(beyond) for row in (*edge, apex)]


def farthest(cursor: Cursor, side: int, p: Point, q: Point) -> Point:
    """The vertex of a side farthest from the line through p and q (p < q) beyond it, the first of two."""
    while cursor.a is not cursor.b:
        turn = SIGNS[side] * cross_sign(p, q, cursor.a, cursor.b)
        if turn == 0:
            break
        if turn > 0:
            cursor.go_right()
        else:
            cursor.go_left()
    return cursor.a


def _height(a: Point, b: Point, apex: Point, scale: int) -> float:
    """About how far a point is from the line through a and b, times 2**scale: products do not overflow.

    It only says which vertex to add next.
    """
    (ax, ay), (bx, by), (px, py) = ((ldexp(x, scale), ldexp(y, scale)) for x, y in (a, b, apex))
    dx, dy = bx - ax, by - ay
    length = sqrt(dx * dx + dy * dy)
    return abs(dx * (py - ay) - dy * (px - ax)) / length if length > 0 else 0.0
