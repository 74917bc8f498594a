"""Whether a measure is greater or less than a number: exact."""

from fractions import Fraction
from itertools import pairwise
from math import isfinite
from typing import Literal

from .._implementation import kernel
from ..arrays import Points
from ._area import doubled_area
from ._extent import squared_diameter, squared_width
from ._summary import FEW, extent_of_few

# The greatest relative error of one operation, and an absolute error that no underflow exceeds.
UNIT, TINY = 2.0**-53, 2.0**-1000

Compared = Literal["area", "diameter", "width"]


def compare(vertices: Points, measure: Compared, bound: float) -> int:
    """The sign of a measure less a bound that is not negative: -1, 0 or 1, exact. O(h log h), O(h) for the area."""
    if kernel is not None and (sign := kernel.sign_of_measure(vertices, measure, bound)) is not None:
        return sign
    if measure == "area":
        return _compare_area(vertices, bound)
    if 2 < len(vertices) <= FEW:
        longest, height, unit = extent_of_few(vertices)
        squared = (longest if measure == "diameter" else height) * unit**2
    else:
        squared = squared_diameter(vertices) if measure == "diameter" else squared_width(vertices)
    return _sign(squared, Fraction(bound) ** 2)


def _compare_area(vertices: Points, bound: float) -> int:
    """A sum in floating point decides if it differs from the bound by more than its error; otherwise the exact one."""
    if 2 < len(vertices) <= FEW:
        (x, y), *rows = vertices.tolist()
        total = sizes = 0.0
        for (ax, ay), (bx, by) in pairwise(rows):
            one, other = (ax - x) * (by - y), (ay - y) * (bx - x)
            total += one - other
            sizes += abs(one) + abs(other)
        # Three roundings of each product, one of its difference, and one of each sum, here and in `sizes`; doubled.
        error = 2 * (len(rows) + 8) * UNIT * sizes + TINY
        difference = total - 2 * bound
        if isfinite(sizes) and abs(difference) > error + 4 * UNIT * bound:
            return 1 if difference > 0 else -1
    return _sign(doubled_area(vertices), 2 * Fraction(bound))


def _sign(value: Fraction, other: Fraction) -> int:
    return (value > other) - (value < other)
