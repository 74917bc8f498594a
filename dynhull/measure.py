"""Measures of a convex polygon given by its (h, 2) vertices, counter-clockwise. O(h) each."""

from fractions import Fraction
from math import fsum, hypot, inf, nan

from .arrays import Points

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


def _exact(vertices: Points) -> list[Exact]:
    return [(Fraction(x), Fraction(y)) for x, y in vertices.tolist()]


def _cross(p: Exact, q: Exact) -> Fraction:
    return p[0] * q[1] - p[1] * q[0]


def _doubled_area(corners: list[Exact]) -> Fraction:
    return sum((_cross(corners[i - 1], corners[i]) for i in range(len(corners))), Fraction(0))


def _rounded(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")
