"""Rotating calipers: the extreme vertices in many directions at once, and the best of what they hold.

Shamos, "Computational geometry" (1978). The angles of the edges are sorted, so a binary search in floating point finds
every extreme vertex but for rounding; exact signs then move the few that are off. O((h + k) log h).
"""

from collections.abc import Callable
from fractions import Fraction
from math import pi

import numpy as np
import numpy.typing as npt

from .._exact import Integers, as_integers
from .._predicates import UNDERFLOW, cross_signs, dot_signs
from ..arrays import Points

Indices = npt.NDArray[np.int64]
Signs = npt.NDArray[np.int8]
# Numerator, denominator and the size of the numerator's terms, for one row of corners each.
Formula = Callable[..., tuple[Integers, Integers, Integers]]

# Where a longer type is none, the second look finds nothing new.
PRECISIONS = (np.float64, np.longdouble)
SMALLEST_DENOMINATOR = 1e-290

AHEAD, LEFT, BEHIND = 0, 1, 2  # quarter turns


def edges(vertices: Points) -> tuple[Points, Points]:
    """The first and the second end of each edge, counter-clockwise."""
    return vertices, np.roll(vertices, -1, axis=0)


def extremes(a: Points, b: Points, turn: int, vertices: Points) -> Indices:
    """For each way from a to b, turned left by so many quarters, the number of the farthest vertex. Exact.

    Where a whole edge is farthest, its first end, counter-clockwise. At least one vertex.
    """
    count = len(vertices)
    if count < 3:
        return np.where(_steps(a, b, turn, vertices[:1], vertices[-1:]) > 0, count - 1, 0)
    first, second = edges(vertices)
    angles = _angles(first, second)
    # Up to the farthest vertex edges lead that way: they make less than a right angle with it.
    wanted = (_angles(a, b) + (turn + 1) * pi / 2 + pi / 2) % (2 * pi) - pi / 2
    found = np.searchsorted(np.maximum.accumulate(angles), wanted) % count
    moving = np.arange(len(found))
    while moving.size:
        here, p, q = found[moving], a[moving], b[moving]
        onwards = _steps(p, q, turn, first[here], second[here]) > 0
        back = ~onwards & (_steps(p, q, turn, first[here - 1], second[here - 1]) <= 0)
        found[moving] = (here + onwards - back) % count
        moving = moving[onwards | back]
    return found


def _steps(a: Points, b: Points, turn: int, c: Points, d: Points) -> Signs:
    """Whether the way from c to d leads along the turned way from a to b, or against it."""
    if turn == LEFT:
        return cross_signs(a, b, c, d)
    return dot_signs(a, b, c, d) if turn == AHEAD else dot_signs(b, a, c, d)


def _angles(a: Points, b: Points) -> npt.NDArray[np.float64]:
    """Of the ways from a to b, in the order of a hull's edges: from straight down, where a lower chain may begin."""
    dx, dy = (np.ldexp(b, -1) - np.ldexp(a, -1)).T
    angles = np.arctan2(dy, dx)
    upper = (dx < 0) | ((dx == 0) & (dy < 0))
    unwrapped: npt.NDArray[np.float64] = np.where(upper & (angles < 0), angles + 2 * pi, angles)
    return unwrapped


def _perhaps_least(formula: Formula, corners: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
    """Which rows the rounding errors do not rule out. What is no number is not ruled out."""
    with np.errstate(all="ignore"):
        numerator, denominator, size = formula(*corners)
        value = np.where(denominator > SMALLEST_DENOMINATOR, numerator / denominator, np.nan)
        error = rounding(corners) * (size / denominator + np.abs(value)) + UNDERFLOW / denominator
        ruled_out: npt.NDArray[np.bool_] = value - error > np.fmin.reduce(value + error)
        return ~ruled_out


def rounding(values: npt.NDArray[np.floating]) -> np.floating:
    """The relative error of at most a dozen roundings in this type, and to spare."""
    return 32 * np.finfo(values.dtype).eps


def least(formula: Formula, *corners: Points) -> tuple[Fraction, int]:
    """The least value of a ratio over rows of corners, and the first row that has it. Exact.

    Args:
        formula: of the corners' coordinates, in floats and in integers alike. Of degree two: areas, squared lengths.
        corners: (k, 2) each, k at least 1.
    """
    stacked = np.stack(corners)
    scaled = np.ldexp(stacked, -int(np.frexp(np.abs(stacked).max())[1]) - 2)
    near = np.arange(stacked.shape[1])
    for precision in PRECISIONS:
        near = near[_perhaps_least(formula, scaled[:, near].astype(precision))]
    integers, unit = as_integers(stacked[:, near])
    numerators, denominators, _ = formula(*integers)
    ratios = list(zip(numerators.tolist(), denominators.tolist(), strict=True))
    best = 0
    for i, (n, d) in enumerate(ratios):
        if n * ratios[best][1] < ratios[best][0] * d:
            best = i
    return Fraction(*ratios[best]) * unit**2, int(near[best])


def squared_height(a: Integers, b: Integers, p: Integers) -> tuple[Integers, Integers, Integers]:
    """A formula: the squared distance of p from the line through a and b."""
    (ux, uy), (vx, vy) = (b - a).T, (p - a).T
    return (ux * vy - uy * vx) ** 2, ux * ux + uy * uy, (abs(ux * vy) + abs(uy * vx)) ** 2
