"""Rotating calipers: the extreme vertices in many directions at once, and the least value of a ratio over them.

Shamos, "Computational geometry" (1978). The angles of the edges are sorted, so a binary search in floating point finds
every extreme vertex up to rounding; exact signs then correct the few that are wrong. O((h + k) log h).
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
# Numerator, denominator and the magnitude of the numerator's terms, for each row of corners.
Formula = Callable[..., tuple[Integers, Integers, Integers]]

# On platforms without a longer type, the second pass finds nothing new.
PRECISIONS = (np.float64, np.longdouble)
SMALLEST_DENOMINATOR = 1e-290

AHEAD, LEFT, BEHIND = 0, 1, 2  # quarter turns


def edges(vertices: Points) -> tuple[Points, Points]:
    """The two ends of each edge, counter-clockwise."""
    return vertices, np.roll(vertices, -1, axis=0)


def extremes(a: Points, b: Points, turn: int, vertices: Points) -> Indices:
    """The index of the farthest vertex in each direction from a to b, turned left by quarter turns. Exact.

    If a whole edge is farthest, its first end, counter-clockwise. There must be a vertex.
    """
    count = len(vertices)
    if count < 3:
        return np.where(_steps(a, b, turn, vertices[:1], vertices[-1:]) > 0, count - 1, 0)
    first, second = edges(vertices)
    angles = _angles(first, second)
    # Edges before the farthest vertex lead that way: they are at less than a right angle to it.
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
    """Whether c to d leads along the turned direction from a to b (1), or against it (-1)."""
    if turn == LEFT:
        return cross_signs(a, b, c, d)
    return dot_signs(a, b, c, d) if turn == AHEAD else dot_signs(b, a, c, d)


def _angles(a: Points, b: Points) -> npt.NDArray[np.float64]:
    """The angles of the directions from a to b in the order of a hull's edges, which may begin straight down."""
    dx, dy = (np.ldexp(b, -1) - np.ldexp(a, -1)).T
    angles = np.arctan2(dy, dx)
    upper = (dx < 0) | ((dx == 0) & (dy < 0))
    unwrapped: npt.NDArray[np.float64] = np.where(upper & (angles < 0), angles + 2 * pi, angles)
    return unwrapped


def _perhaps_least(formula: Formula, corners: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
    """The rows that rounding errors do not rule out; a NaN rules nothing out."""
    with np.errstate(all="ignore"):
        numerator, denominator, size = formula(*corners)
        value = np.where(denominator > SMALLEST_DENOMINATOR, numerator / denominator, np.nan)
        error = rounding(corners) * (size / denominator + np.abs(value)) + UNDERFLOW / denominator
        ruled_out: npt.NDArray[np.bool_] = value - error > np.fmin.reduce(value + error)
        return ~ruled_out


def rounding(values: npt.NDArray[np.floating]) -> np.floating:
    """A safe bound on the relative error of at most a dozen roundings in this type."""
    return 32 * np.finfo(values.dtype).eps


def least(formula: Formula, *corners: Points) -> tuple[Fraction, int]:
    """The least value of a ratio over rows of corners, and the first row that has it. Exact.

    Args:
        formula: of degree two in the corners' coordinates, such as an area or a squared length; called with floats and
            with integers.
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
