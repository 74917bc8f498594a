"""A binary phase diagram under inserts and deletes of entries, which are a composition and an energy."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from fractions import Fraction
from math import nan
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._exact import rounded
from .._hull import DynamicHull
from .._value import Value
from ..arrays import Points, as_array, as_points, as_tuples

if TYPE_CHECKING:
    from .._predicates import Point


@dataclass(frozen=True, eq=False, repr=False)
class Decomposition(Value):
    """The decomposition of entries of given compositions into mixtures of two stable neighbours.

    Attributes:
        phases: (k, 2, 2) the two stable entries, left and right; at a stable composition that entry twice.
        shares: (k, 2) the share of each: not negative, with sum 1. NaN, as the phases, beyond the outermost entries.
    """

    phases: Points
    shares: Points


class PhaseDiagram:
    """Which entries of a binary system are stable: those on the lower hull of (composition, energy).

    Args:
        entries: (n, 2) array-like: composition, which is the share of the second element from 0 to 1, and energy per
            atom. Energies may be raw or of formation: a linear term changes no answer. For the usual meaning there
            must be entries at 0 and at 1.

    Which entries are stable is exact. Methods that take entries raise ValueError or TypeError for bad ones; the message
    names the first bad row, and nothing is changed. O(log² n) an update; the first query after a change reads the lower
    hull, O(h log n).

    >>> from dynhull.envelope import PhaseDiagram
    >>> diagram = PhaseDiagram([[0, 0], [1, 0], [0.5, -1]])
    >>> diagram.add(0.25, -0.75).tolist()  # nothing became unstable
    []
    >>> diagram.add(0.75, -2).tolist()
    [[0.5, -1.0]]
    >>> diagram.energy_above_hull([[0.5, -1]]).tolist()
    [0.375]
    >>> diagram.remove(0.75, -2).tolist()  # stable again
    [[0.5, -1.0]]
    """

    __slots__ = ("_hull", "_stable")

    def __init__(self, entries: npt.ArrayLike | None = None) -> None:
        self._hull = DynamicHull(None if entries is None else _as_entries(entries))
        self._stable: tuple[int, list[Point]] = (-1, [])

    def __len__(self) -> int:
        """The number of entries, with multiplicity."""
        return len(self._hull)

    def __repr__(self) -> str:
        return f"<PhaseDiagram of {len(self)} entries, {len(self._chain())} of them stable>"

    def add(self, composition: float, energy: float) -> Points:
        """Add an entry. Returns the (k, 2) entries that became unstable."""
        return self.add_many([[composition, energy]])

    def add_many(self, entries: npt.ArrayLike) -> Points:
        """Add (k, 2) entries. Returns the entries that became unstable, left to right."""
        added = _as_entries(entries)
        before = self._chain()
        self._hull.insert_many(added)
        return self._lost(before, self._chain())

    def remove(self, composition: float, energy: float) -> Points:
        """Remove an entry once. Returns the (k, 2) entries that became stable.

        Raises:
            KeyError: there is no such entry.
        """
        before = self._chain()
        self._hull.delete(composition, energy)
        return self._lost(self._chain(), before)

    def entries(self) -> Points:
        """(n, 2) entries in order of composition, then energy."""
        return self._hull.points()

    def stable(self) -> Points:
        """(h, 2) stable entries, left to right, without those on a line between two others."""
        return np.array(self._chain(), dtype=np.float64).reshape(-1, 2)

    def energy_above_hull(self, entries: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(k,) energies of (k, 2) entries, which need not be in the diagram, above the lower hull.

        The exact value rounded once: 0.0 exactly for entries on the hull, negative for entries that would change it,
        NaN beyond the outermost entries. O(log h) each.
        """
        rows, chain = _as_entries(entries), self._chain()
        return np.array([_above(chain, x, energy) for x, energy in rows.tolist()], dtype=np.float64)

    def decompose(self, compositions: npt.ArrayLike) -> Decomposition:
        """The decomposition of each of (k,) compositions. Shares are exact values rounded once. O(log h) each.

        >>> from dynhull.envelope import PhaseDiagram
        >>> found = PhaseDiagram([[0, 0], [0.5, -1], [1, 0]]).decompose([0.125])
        >>> found.phases.tolist(), found.shares.tolist()
        ([[[0.0, 0.0], [0.5, -1.0]]], [[0.75, 0.25]])
        """
        xs = as_array(compositions, "compositions").astype(np.float64)
        if xs.ndim != 1:
            raise ValueError(f"compositions must have shape (k,), got {xs.shape}")
        rows = _as_entries(np.column_stack([xs, np.zeros(len(xs))]), "compositions")
        chain = self._chain()
        phases, shares = np.full((len(xs), 2, 2), nan), np.full((len(xs), 2), nan)
        for row, x in enumerate(rows[:, 0].tolist()):
            if chain and chain[0][0] <= x <= chain[-1][0]:
                left, right = _neighbours(chain, x)
                share = _share(left, right, x)
                phases[row], shares[row] = (left, right), (rounded(1 - share), rounded(share))
        return Decomposition(phases, shares)

    def _chain(self) -> list[Point]:
        """The lower hull, read again after a change."""
        changes = self._hull.changes
        if self._stable[0] != changes:
            chain = as_tuples(self._hull.lower())
            if len(chain) > 1 and chain[-2][0] == chain[-1][0]:  # without a vertical edge
                chain.pop()
            self._stable = (changes, chain)
        return self._stable[1]

    def _lost(self, before: list[Point], after: list[Point]) -> Points:
        still = set(after)
        return np.array([p for p in before if p not in still], dtype=np.float64).reshape(-1, 2)


def _as_entries(entries: npt.ArrayLike, name: str = "entries") -> Points:
    rows = as_points(entries, name)
    outside = np.flatnonzero((rows[:, 0] < 0) | (rows[:, 0] > 1))
    if outside.size:
        raise ValueError(f"{name} row {outside[0]} has composition {rows[outside[0], 0]}: must be from 0 to 1")
    return rows


def _neighbours(chain: list[Point], x: float) -> tuple[Point, Point]:
    """The stable entries on both sides of a composition."""
    i = bisect_left(chain, x, key=lambda entry: entry[0])
    return (chain[i], chain[i]) if chain[i][0] == x else (chain[i - 1], chain[i])


def _share(left: Point, right: Point, x: float) -> Fraction:
    """The share of the right neighbour."""
    if left == right:
        return Fraction(0)
    return (Fraction(x) - Fraction(left[0])) / (Fraction(right[0]) - Fraction(left[0]))


def _above(chain: list[Point], x: float, energy: float) -> float:
    if not chain or not chain[0][0] <= x <= chain[-1][0]:
        return nan
    left, right = _neighbours(chain, x)
    floor = Fraction(left[1]) + _share(left, right, x) * (Fraction(right[1]) - Fraction(left[1]))
    return rounded(Fraction(energy) - floor)
