"""The right answers, by definition and in rational arithmetic: slow, and without code of the library."""

from collections.abc import Iterable
from fractions import Fraction
from functools import lru_cache
from itertools import product
from math import inf, isqrt, nextafter

Point = tuple[float, float]


@lru_cache(2**14)
def _whole(x: float) -> int | Fraction:
    """A double as a multiple of the smallest one: an integer, which makes exact arithmetic several times as fast."""
    multiple = Fraction(x) * 2**1074
    return multiple.numerator if multiple.denominator == 1 else multiple


def turn(a: Point, b: Point, c: Point) -> int:
    (ax, ay), (bx, by), (cx, cy) = [(_whole(x), _whole(y)) for x, y in (a, b, c)]
    det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (det > 0) - (det < 0)


def distinct(points: Iterable[Point]) -> list[Point]:
    return sorted({(x + 0.0, y + 0.0) for x, y in points})


def hull(points: Iterable[Point]) -> list[Point]:
    """Strict vertices, counter-clockwise from the least: from each, the one that has no point on its right."""
    candidates = distinct(points)
    if len(candidates) < 2:
        return candidates
    vertices = [candidates[0]]
    while True:
        p = vertices[-1]
        best = None
        for q in candidates:
            if q == p:
                continue
            side = -1 if best is None else turn(p, best, q)
            if side < 0 or (side == 0 and (p < best < q or p > best > q)):
                best = q
        if best == vertices[0]:
            return vertices
        vertices.append(best)


def boundary(points: Iterable[Point]) -> list[Point]:
    """Every distinct point on the hull's boundary, counter-clockwise from the least; a flat hull's in order."""
    candidates = distinct(points)
    corners = hull(candidates)
    if len(corners) < 3:
        return candidates
    result = []
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        low, high = min(a, b), max(a, b)
        edge = [p for p in candidates if low <= p <= high and turn(a, b, p) == 0]
        result += (edge if a < b else edge[::-1])[:-1]
    return result


def locate(corners: list[Point], p: Point) -> int:
    """+1 inside, 0 on the boundary, -1 outside of a hull given by its vertices."""
    if not corners:
        return -1
    if len(corners) < 3:
        low, high = min(corners), max(corners)
        return 0 if turn(low, high, p) == 0 and low <= p <= high else -1
    return min(turn(a, b, p) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))


def dot(d: Point, p: Point) -> Fraction:
    return Fraction(d[0]) * Fraction(p[0]) + Fraction(d[1]) * Fraction(p[1])


def exact(p):
    return Fraction(p[0]), Fraction(p[1])


def root(value):
    """The root of a rational number, to 100 bits more than a double has."""
    scale = Fraction(2) ** (2 * (2200 + 160))
    scaled = isqrt(int(value * scale))
    return Fraction(scaled) / Fraction(2) ** (2200 + 160)


def nearest(value):
    """The double nearest to a rational value >= 0; inf where it is too large."""
    try:
        return float(value)
    except OverflowError:
        return inf


def assert_rounded(measured, value):
    """The double next to a rational value, or one beside that; inf where it is too large."""
    double = nearest(value)
    assert measured in (double, nextafter(double, inf), nextafter(double, 0))


def segment_distance(p: Point, a: Point, b: Point) -> Fraction:
    """Squared, from a point to a segment."""
    (px, py), (ax, ay), (bx, by) = exact(p), exact(a), exact(b)
    ux, uy = bx - ax, by - ay
    share = ((px - ax) * ux + (py - ay) * uy) / (ux * ux + uy * uy) if (ux, uy) != (0, 0) else 0
    share = max(min(share, Fraction(1)), Fraction(0))
    return (px - ax - share * ux) ** 2 + (py - ay - share * uy) ** 2


def polygons(p: Iterable[Point], q: Iterable[Point]) -> Fraction:
    """The squared distance of two hulls: 0 where a vertex of one is in the other or two edges cross."""
    a, b = hull(p), hull(q)
    if any(locate(b, v) >= 0 for v in a) or any(locate(a, v) >= 0 for v in b):
        return Fraction(0)
    edges, others = ([(c[i - 1], c[i]) for i in range(len(c))] for c in (a, b))
    for (s, t), (u, v) in product(edges, others):
        if turn(s, t, u) * turn(s, t, v) < 0 and turn(u, v, s) * turn(u, v, t) < 0:
            return Fraction(0)
    pairs = [(v, edge) for v in a for edge in others] + [(v, edge) for v in b for edge in edges]
    return min(segment_distance(v, *edge) for v, edge in pairs)
