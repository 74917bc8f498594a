"""The points nearest to the centre of all."""

from fractions import Fraction
from math import floor, lcm
from typing import Literal

import numpy as np

from .._exact import Exact, Integers, as_integers, exact_sum
from ..arrays import Points

ROUNDING = 2.0**-48  # relative to the sizes of the coordinates: a safe bound on a dozen roundings
UNDERFLOW = 1e-300

Center = Literal["mean", "median"]


def nearest_points(points: Points, percent: float, center: Center) -> Points:
    """The points whose distance from the centre is at most the percentile of all distances. Exact. O(n).

    As the minimum convex polygon of adehabitatHR (Calenge 2006) chooses them: with n distances in order, those up to
    the one with index (n - 1) percent / 100, rounded down; equal distances stay or go together.

    Args:
        points: (n, 2), n at least 1.
        percent: at least 0, at most 100.
        center: the mean, or the median of each coordinate.
    """
    rank = floor((len(points) - 1) * Fraction(percent) / 100)
    middle = _mean(points) if center == "mean" else _median(points)
    value, error = _squared_distances(points, middle)
    low, high = value - error, value + error
    least, greatest = np.partition(low, rank)[rank], np.partition(high, rank)[rank]  # the percentile is between them
    near = high < least
    unclear = np.flatnonzero(~near & (low <= greatest))
    exact = _exact_squared_distances(points[unclear], middle)
    near[unclear] = exact <= sorted(exact)[rank - int(near.sum())]
    chosen: Points = points[near]
    return chosen


def _mean(points: Points) -> Exact:
    return exact_sum(points[:, 0]) / len(points), exact_sum(points[:, 1]) / len(points)


def _median(points: Points) -> Exact:
    ranks = [(len(points) - 1) // 2, len(points) // 2]
    (x, y), (next_x, next_y) = np.partition(points, ranks, axis=0)[ranks].tolist()
    return (Fraction(x) + Fraction(next_x)) / 2, (Fraction(y) + Fraction(next_y)) / 2


def _squared_distances(points: Points, middle: Exact) -> tuple[Points, Points]:
    """Squared distances times a power of two, and bounds on their errors."""
    scale = -int(np.frexp(np.abs(points).max())[1])
    factor = Fraction(2) ** scale
    center = np.array([float(middle[0] * factor), float(middle[1] * factor)])
    offsets = np.ldexp(points, scale) - center
    sizes = np.abs(offsets).sum(axis=1)
    blur = ROUNDING * (sizes + np.abs(center).sum()) + UNDERFLOW
    value: Points = (offsets**2).sum(axis=1)
    return value, 4 * blur * (sizes + blur) + UNDERFLOW


def _exact_squared_distances(points: Points, middle: Exact) -> Integers:
    """Squared distances in a common unit, as Python integers."""
    integers, unit = as_integers(points)
    x, y = middle[0] / unit, middle[1] / unit
    parts = lcm(x.denominator, y.denominator)
    squares: Integers = (integers[:, 0] * parts - int(x * parts)) ** 2 + (integers[:, 1] * parts - int(y * parts)) ** 2
    return squares
