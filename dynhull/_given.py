"""The pairs of numbers that were given for places on the globe: the readable reference.

A place has several pairs if it can be written in several ways: 180 and -180 degrees, any longitude at a pole.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np
import numpy.typing as npt

from .arrays import Points, as_tuples

if TYPE_CHECKING:
    from ._predicates import Point


class Given:
    """A multiset of pairs, each with its place; a pair always has the same place. O(1) a pair, O(n) space."""

    def __init__(self) -> None:
        self._pairs: dict[Point, tuple[Point, ...]] = {}  # the different pairs at each place, in order
        self._copies: dict[Point, int] = {}  # of each pair

    @property
    def distinct(self) -> int:
        """The number of different pairs."""
        return len(self._copies)

    def apply(
        self, ops: npt.NDArray[np.int8], pairs: Points, places: Points, ignore_missing: bool
    ) -> tuple[npt.NDArray[np.bool_], Points]:
        """Add the rows with +1 and take those with -1, as a set.

        Returns:
            kept: which rows have an effect: all, but those that take a missing pair.
            renamed: (m, 2) places that had pairs and have pairs, but another least one.

        Raises:
            KeyError: the pair's two numbers and the first row that takes a missing pair, unless such rows are ignored.
                Nothing has changed.
        """
        rows = list(zip(as_tuples(pairs), as_tuples(places), ops.tolist(), strict=True))
        change: dict[Point, int] = {}
        for pair, _, op in rows:
            if op > 0:
                change[pair] = change.get(pair, 0) + 1
        kept = np.ones(len(rows), dtype=bool)
        for row, (pair, _, op) in enumerate(rows):
            if op < 0 and self._copies.get(pair, 0) + change.get(pair, 0) > 0:
                change[pair] = change.get(pair, 0) - 1
            elif op < 0:
                if not ignore_missing:
                    raise KeyError(*pair, row)
                kept[row] = False
        place_of = {pair: place for pair, place, _ in rows}
        before = {place_of[pair]: self._pairs.get(place_of[pair], ()) for pair in change}
        for pair, added in change.items():
            self._change(pair, place_of[pair], added)
        renamed = [
            place
            for place, names in before.items()
            if names and place in self._pairs and names[0] != self._pairs[place][0]
        ]
        return kept, np.array(renamed, dtype=np.float64).reshape(-1, 2)

    def _change(self, pair: Point, place: Point, added: int) -> None:
        copies = self._copies.pop(pair, 0)
        names = tuple(name for name in self._pairs.pop(place, ()) if name != pair)
        if copies + added:
            self._copies[pair] = copies + added
            names = tuple(sorted((*names, pair)))
        if names:
            self._pairs[place] = names

    def counts(self, pairs: Points, places: Points) -> npt.NDArray[np.int64]:
        """The number of copies of each row."""
        rows = zip(as_tuples(pairs), as_tuples(places), strict=True)
        counts = [self._copies[pair] if pair in self._pairs.get(place, ()) else 0 for pair, place in rows]
        return np.array(counts, dtype=np.int64)

    def at(self, places: Points) -> Points:
        """The least pair at each place; KeyError if there is none."""
        return np.array([self._pairs[place][0] for place in as_tuples(places)]).reshape(-1, 2)

    def points(self) -> Points:
        """All pairs in lexicographic order, with multiplicity. O(n log n)."""
        pairs = [pair for pair in sorted(self._copies) for _ in range(self._copies[pair])]
        return np.array(pairs, dtype=np.float64).reshape(-1, 2)

    def clear(self) -> None:
        """Forget every pair."""
        self._pairs, self._copies = {}, {}

    def copy(self) -> Self:
        """An independent copy. O(n)."""
        new = type(self)()
        new._pairs, new._copies = self._pairs.copy(), self._copies.copy()
        return new
