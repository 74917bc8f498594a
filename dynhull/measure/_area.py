"""Area, centre of area and length of the boundary."""

from fractions import Fraction
from math import fsum, hypot, inf, nan

import numpy as np
import numpy.typing as npt

from .._exact import as_integers, exact_sum, products, rounded, safe_factors
from ..arrays import Points

BLOCK = 2**16  # vertices at a time: their products stay in the cache


def area(vertices: Points) -> float:
    """The exact area, rounded once; inf if it is beyond every double. O(h)."""
    return rounded(doubled_area(vertices) / 2)


def doubled_area(vertices: Points) -> Fraction:
    """Twice the exact area. O(h)."""
    return _moments(vertices, centre=False)[0]


def perimeter(vertices: Points) -> float:
    """Length of the boundary, within one unit in the last place per edge; a segment counts twice. O(h).

    inf if it is beyond every double.
    """
    rows = vertices.tolist()
    lengths = [hypot(x - px, y - py) for (x, y), (px, py) in zip(rows, rows[-1:] + rows[:-1], strict=True)]
    try:
        return fsum(lengths)
    except OverflowError:
        return inf


def centroid(vertices: Points) -> tuple[float, float]:
    """The exact centre of area, rounded once; the middle of a segment; NaN for no vertices. O(h)."""
    if not len(vertices):
        return nan, nan
    doubled, x, y = _moments(vertices, centre=True)
    if doubled == 0:
        count = len(vertices)
        return rounded(exact_sum(vertices[:, 0]) / count), rounded(exact_sum(vertices[:, 1]) / count)
    return rounded(x / (3 * doubled)), rounded(y / (3 * doubled))


def _moments(vertices: Points, centre: bool) -> tuple[Fraction, Fraction, Fraction]:
    """Twice the area and, on request, six times its moments in x and y: exact sums of cross products."""
    by_products = safe_factors(vertices)
    following = np.roll(vertices, -1, axis=0)
    totals = [Fraction(0)] * 3
    for start in range(0, len(vertices), BLOCK):
        p, q = vertices[start : start + BLOCK], following[start : start + BLOCK]
        sums = _float_sums(p, q, centre) if by_products else _integer_sums(p, q, centre)
        totals = [total + value for total, value in zip(totals, sums, strict=True)]
    return totals[0], totals[1], totals[2]


def _float_sums(p: Points, q: Points, centre: bool) -> list[Fraction]:
    crosses = np.concatenate([products(p[:, 0], q[:, 1]), products(-p[:, 1], q[:, 0])])
    if not centre:
        return [exact_sum(crosses), Fraction(0), Fraction(0)]
    return [exact_sum(crosses), *(_moment(crosses, p[:, axis], q[:, axis]) for axis in (0, 1))]


def _moment(crosses: npt.NDArray[np.float64], p: Points, q: Points) -> Fraction:
    return exact_sum(products(crosses, p)) + exact_sum(products(crosses, q))


def _integer_sums(p: Points, q: Points, centre: bool) -> list[Fraction]:
    both, unit = as_integers(np.stack([p, q]))
    (px, py), (qx, qy) = both[0].T, both[1].T
    crosses = px * qy - py * qx
    sums = [int(crosses.sum()) * unit**2, Fraction(0), Fraction(0)]
    if centre:
        sums[1:] = [int((crosses * (a + b)).sum()) * unit**3 for a, b in ((px, qx), (py, qy))]
    return sums
