"""An efficient frontier that lives: (risk, return) points come and go."""

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from .._exact import rounded
from .._hull import DynamicHull
from .._predicates import Point, orient2d
from ..arrays import Points, as_coordinate, as_points, as_tuples


@dataclass(frozen=True, eq=False)
class Tangencies:
    """The tangency point for every risk-free rate.

    Attributes:
        points: (k, 2) as the rate rises.
        rates: (k - 1,) rising: at rates[i] the tangency moves from points[i] to points[i + 1]. Each is where the line
            through the two meets the axis of zero risk: the exact value rounded once.
    """

    points: Points
    rates: npt.NDArray[np.float64]


class Frontier:
    """The points that offer most return for their risk, and mixtures of them: an upper hull of (risk, return).

    A mixture of two points is taken to lie on the line between them, as it does when the two rise and fall together;
    less than full correlation only lowers the risk. Any risk measure that is positive will do.

    Args:
        points: (n, 2) array-like of risk, positive, and return.

    Which points are efficient is exact. Methods that take points raise ValueError or TypeError for bad ones, naming the
    first bad row, and change nothing.

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
        """How many points, with multiplicity."""
        return len(self._hull)

    def add(self, risk: float, gain: float) -> bool:
        """Add a point. True where the efficient points changed. O(log² n), and O(h log n) to tell."""
        (row,) = _as_risks([[risk, gain]])
        before = self.efficient()
        self._hull.insert(*row.tolist())
        return not np.array_equal(before, self.efficient())

    def remove(self, risk: float, gain: float) -> bool:
        """Remove a point once. True where the efficient points changed. KeyError where it is not there."""
        before = self.efficient()
        self._hull.delete(risk, gain)
        return not np.array_equal(before, self.efficient())

    def points(self) -> Points:
        """(n, 2) points by risk, then return."""
        return self._hull.points()

    def efficient(self) -> Points:
        """(h, 2) corners of the frontier, from least risk to most return. O(h log n)."""
        chain = self._upper()
        return chain[: int(chain[:, 1].argmax()) + 1] if len(chain) else chain

    def dominated(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """(k,) whether the frontier offers more return for the same risk or less, or as much for less risk. Exact.

        Points of less risk than any here are not dominated. O(h + k log h).
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
        """The point of most excess return over a risk-free rate per risk (Sharpe 1966). Exact. O(log n).

        Of several on one line the one of most risk. For rates above every return, which nobody should take, the point
        where the loss per risk is least.

        Raises:
            ValueError: the rate is not finite, or there are no points.
        """
        rate = as_coordinate(rate, "rate")
        if not len(self):
            raise ValueError("a frontier without points has no tangency: add some first")
        # All risks are positive: the hull lies to the right of the risk-free point, below the ray to its left tangent.
        x, y = self._hull.tangents([[0.0, rate]])[0, 0].tolist()
        return x, y

    def sharpe_ratio(self, rate: float) -> float:
        """The excess return per risk of the tangency, the exact value rounded once. O(log n)."""
        risk, gain = self.tangency(rate)
        return rounded((Fraction(gain) - Fraction(rate)) / Fraction(risk))

    def tangencies(self) -> Tangencies:
        """How the tangency moves as the risk-free rate goes from far below to far above. O(h log n)."""
        chain = self._upper()
        return Tangencies(chain, np.array([_at_no_risk(p, q) for p, q in pairwise(as_tuples(chain))]))

    def _upper(self) -> Points:
        chain = self._hull.upper()
        return chain[1:] if len(chain) > 1 and chain[0, 0] == chain[1, 0] else chain  # without its way straight up


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
