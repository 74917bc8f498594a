"""Whether a measure is greater or less than a number: exact."""

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from math import isfinite
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .._implementation import kernel
from ..arrays import Points
from ._area import doubled_area
from ._extent import squared_diameter, squared_width
from ._summary import FEW, extent_of_few

if TYPE_CHECKING:
    from .._base import Live

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


class LastVertices:
    """The vertices that a hull had when they were last taken: of someone who looks at it after each of its changes."""

    __slots__ = ("_last",)

    def __init__(self) -> None:
        self._last: Any = (np.empty((0, 2)), -1) if kernel is None else kernel.LastVertices()

    def __len__(self) -> int:
        """Their number. O(1)."""
        return len(self._last[0] if kernel is None else self._last)

    @property
    def changes(self) -> int:
        """The hull's number of changes when they were taken; -1 if they never were. O(1)."""
        changes: int = self._last[1] if kernel is None else self._last.changes
        return changes

    def points(self) -> Points:
        """(h, 2) vertices, in the order of `DynamicHull.vertices`. O(h)."""
        points: Points = self._last[0] if kernel is None else self._last.points()
        return points

    def take(self, hull: "Live") -> None:
        """Take the vertices of a hull. O(h log n)."""
        tree: Any = hull._tree
        if kernel is None:
            self._last = tree.vertices(), tree.changes
        else:
            tree.take_vertices(self._last)

    def taker(self, hull: "Live", measure: Compared, bound: float, least: int, most: int) -> Callable[[], bool]:
        """What takes them if what `compare` says of them is at least `least` and at most `most`, and says so.

        Where rounding might decide, it says no: then `compare` knows. A call takes O(h log n), O(h²) of few; and what
        is found out once, here, is not found out at each.
        """
        tree: Any = hull._tree
        if kernel is not None:
            take: Callable[[], bool] = tree.vertex_taker(self._last, measure, bound, least, most).take
            return take

        def take_if() -> bool:
            vertices = tree.vertices()
            if not least <= compare(vertices, measure, bound) <= most:
                return False
            self._last = vertices, tree.changes
            return True

        return take_if


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
