"""An efficient frontier under inserts and deletes of (risk, return) points."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from .._exact import rounded
from .._hull import DynamicHull
from .._predicates import Point, orient2d
from .._value import Value
from ..arrays import Points, as_coordinate, as_points, as_tuples


@dataclass(frozen=True, eq=False, repr=False)
class Tangencies(Value):
    """The tangency point for every risk-free rate.

    Attributes:
        points: (k, 2) tangency points in the order of rising rates.
        rates: (k - 1,) ascending: at rates[i] the tangency moves from points[i] to points[i + 1]. Each rate is where
            the line through the two meets the axis of zero risk, the exact value rounded once.
    """

    points: Points
    rates: npt.NDArray[np.float64]


class Frontier:
    """The points with the highest return for their risk, and mixtures of them: an upper hull of (risk, return).

    A mixture of two points is assumed to be on the line between them, which holds if they are fully correlated; less
    correlation only lowers the risk. Any positive risk measure is suitable.

    Args:
        points: (n, 2) array-like of risk, which must be positive, and return.

    Which points are efficient is exact. Methods that take points raise ValueError or TypeError for bad ones; the
    message names the first bad row, and nothing is changed.

    >>> from dynhull.envelope import Frontier
    >>> frontier = Frontier([[1, 2], [2, 5], [4, 6], [3, 3]])
    >>> frontier.efficient().tolist()
    [[1.0, 2.0], [2.0, 5.0], [4.0, 6.0]]
    >>> frontier.tangency(0.5), frontier.tangency(4.5)
    ((2.0, 5.0), (4.0, 6.0))
    >>> frontier.dominated([[3, 3], [2, 5], [3, 5.5]]).tolist()
    [True, False, False]
    """

    __slots__ = ("_hull",)

    def __init__(self, points: npt.ArrayLike | None = None) -> None:
        self._hull = DynamicHull(None if points is None else _as_risks(points))

    def __len__(self) -> int:
        """The number of points, with multiplicity."""
        return len(self._hull)

    def __repr__(self) -> str:
        return f"<Frontier of {len(self)} points, {len(self.efficient())} of them efficient>"

    def add(self, risk: float, gain: float) -> bool:
        """Add a point. Returns whether the efficient points changed. O(log² n + h log n)."""
        (row,) = _as_risks([[risk, gain]])
        before = self.efficient()
        self._hull.insert(*row.tolist())
        return not np.array_equal(before, self.efficient())

    def remove(self, risk: float, gain: float) -> bool:
        """Remove a point once. Returns whether the efficient points changed. KeyError if the point is not there."""
        before = self.efficient()
        self._hull.delete(risk, gain)
        return not np.array_equal(before, self.efficient())

    def points(self) -> Points:
        """(n, 2) points in order of risk, then return."""
        return self._hull.points()

    def efficient(self) -> Points:
        """(h, 2) corners of the frontier, from least risk to most return. O(h log n)."""
        chain = self._upper()
        return chain[: int(chain[:, 1].argmax()) + 1] if len(chain) else chain

    def dominated(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """(k,) whether the frontier offers more return for the same or less risk, or the same return for less. Exact.

        A point with less risk than all points here is not dominated. O(h + k log h).
        """
        rows, frontier = _as_risks(points), self.efficient()
        result = np.zeros(len(rows), dtype=np.bool_)
        if not len(frontier):
            return result
        right = np.searchsorted(frontier[:, 0], rows[:, 0])
        beyond = right == len(frontier)
        result[beyond] = rows[beyond, 1] <= frontier[-1, 1]
        left_end = (right == 0) & (rows[:, 0] == frontier[0, 0])
        result[left_end] = rows[left_end, 1] < frontier[0, 1]
        inner = np.flatnonzero((right > 0) & ~beyond)
        a, b = frontier[right[inner] - 1], frontier[right[inner]]
        result[inner] = np.asarray(orient2d(a, b, rows[inner])) < 0
        return result

    def tangency(self, rate: float) -> Point:
        """The point with the highest excess return over a risk-free rate per risk (Sharpe 1966). Exact. O(log n).

        Of several such points, the one with the highest risk. For a rate above every return, which is of no practical
        use, the point with the least loss per risk.

        Raises:
            ValueError: the rate is not finite, or there are no points.
        """
        rate = as_coordinate(rate, "rate")
        if not len(self):
            raise ValueError("a frontier without points has no tangency: add some first")
        # All risks are positive: the hull is to the right of the risk-free point, below the ray to its left tangent.
        x, y = self._hull.tangents([[0.0, rate]])[0, 0].tolist()
        return x, y

    def sharpe_ratio(self, rate: float) -> float:
        """The excess return per risk at the tangency, the exact value rounded once. O(log n)."""
        risk, gain = self.tangency(rate)
        return rounded((Fraction(gain) - Fraction(rate)) / Fraction(risk))

    def tangencies(self) -> Tangencies:
        """The tangencies for all risk-free rates, from far below the returns to far above. O(h log n)."""
        chain = self._upper()
        return Tangencies(chain, np.array([_at_no_risk(p, q) for p, q in pairwise(as_tuples(chain))]))

    def _upper(self) -> Points:
        chain = self._hull.upper()
        return chain[1:] if len(chain) > 1 and chain[0, 0] == chain[1, 0] else chain  # without a vertical edge


def _at_no_risk(p: Point, q: Point) -> float:
    """The return at which the line through two points meets zero risk."""
    (px, py), (qx, qy) = ((Fraction(x), Fraction(y)) for x, y in (p, q))
    return rounded(py - px * (qy - py) / (qx - px))


def _as_risks(points: npt.ArrayLike) -> Points:
    rows = as_points(points)
    bad = np.flatnonzero(rows[:, 0] <= 0)
    if bad.size:
        raise ValueError(f"points row {bad[0]} has risk {rows[bad[0], 0]}: must be positive; what has none is the rate")
    return rows
