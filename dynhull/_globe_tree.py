"""GlobeTree: a multiset of places on the globe and its convex hull.

A tree holds the places in the gnomonic projection about a centre, where great circles are straight lines and the hull
of the projected places is the hull on the globe. `Given` has, for each projected place, the pairs of numbers that were
given for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
import numpy.typing as npt

from ._given import Given
from ._globe import REACH, Gnomonic, as_lonlat, as_place
from ._implementation import kernel
from ._tree import HullTree

if TYPE_CHECKING:
    from . import _kernel
    from ._predicates import Point
    from .arrays import Points


class GlobeTree:
    """A multiset of pairs (longitude, latitude) in degrees, and its hull; edges are great circles.

    Single coordinates are checked, and so are arrays. O(log² n) an update, O(log n) a query, O(n) space.

    Args:
        center: checked by `as_center`; None to choose it when the first points come.
    """

    _tree_type: ClassVar[type[HullTree | _kernel.HullTree]] = HullTree if kernel is None else kernel.HullTree
    _given_type: ClassVar[type[Given | _kernel.Given]] = Given if kernel is None else kernel.Given

    def __init__(self, center: Point | None) -> None:
        self._frame = None if center is None else Gnomonic(center)
        self._tree: HullTree | _kernel.HullTree = self._tree_type()
        self._given: Given | _kernel.Given = self._given_type()

    @property
    def center(self) -> Point | None:
        """The centre of the projection; None before the first points."""
        return None if self._frame is None else self._frame.center

    @property
    def changes(self) -> int:
        """The number of updates that changed the vertices."""
        return self._tree.changes

    @changes.setter
    def changes(self, changes: int) -> None:
        self._tree.changes = changes

    def __len__(self) -> int:
        return len(self._tree)

    @property
    def distinct(self) -> int:
        """The number of different pairs."""
        return self._given.distinct

    def count(self, lon: float, lat: float) -> int:
        """The number of copies of the pair. O(1)."""
        return int(self.count_many(as_place(lon, lat))[0])

    def count_many(self, lonlat: Points) -> npt.NDArray[np.int64]:
        """The number of copies of each row. O(1) a row."""
        places, _ = self._project(lonlat)
        return self._given.counts(lonlat, places)

    def _project(self, lonlat: Points) -> tuple[Points, npt.NDArray[np.bool_]]:
        """The projections, NaN beyond REACH, and which rows have one: without a centre, none."""
        if self._frame is None:
            return np.full(lonlat.shape, np.nan), np.zeros(len(lonlat), dtype=bool)
        return self._frame.project(lonlat)

    # Updates

    def insert(self, lon: float, lat: float) -> bool:
        """Add a pair. True if the hull changed. O(log² n)."""
        changes = self.changes
        self._apply(np.array([1], np.int8), as_place(lon, lat), "the point", ignore_missing=False)
        return self.changes > changes

    def delete(self, lon: float, lat: float) -> bool:
        """Remove one copy of a pair. True if the hull changed; KeyError if the pair is missing. O(log² n)."""
        changes = self.changes
        self._apply(np.array([-1], np.int8), as_place(lon, lat), "the point", ignore_missing=False)
        return self.changes > changes

    def apply(self, ops: int | npt.NDArray[np.int8], lonlat: npt.ArrayLike, ignore_missing: bool) -> int:
        """Insert the rows with +1 and delete those with -1, as a set: the order of rows does not matter.

        Returns:
            The number of rows applied.

        Raises:
            KeyError: longitude, latitude and row of the first delete of a missing pair; nothing has been applied.
            ValueError: a row to insert is beyond REACH.
        """
        pairs = as_lonlat(lonlat)
        return self._apply(np.full(len(pairs), ops, np.int8), pairs, "points row {}", ignore_missing=ignore_missing)

    def clear(self) -> None:
        """Remove every pair. The centre stays."""
        self._tree.clear()
        self._given.clear()

    def recenter(self, center: Point | None) -> None:
        """Build the tree anew about another centre, by default the mean direction of the pairs. O(n log n)."""
        pairs = self.points()
        if center is None and not len(pairs):
            raise ValueError("center is None, and there are no points to choose it from")
        new = type(self)(center)
        new.apply(+1, pairs, ignore_missing=False)
        new.changes = self.changes + (not np.array_equal(new.vertices(), self.vertices()))
        vars(self).update(vars(new))

    def _apply(self, ops: npt.NDArray[np.int8], pairs: Points, name: str, *, ignore_missing: bool) -> int:
        added = ops > 0
        frame, chosen = self._frame, ""
        if frame is None and added.any():
            frame, chosen = (
                Gnomonic.about(pairs[added]),
                ", the mean direction of the first points (`center` gives another)",
            )
        if frame is None:
            places, near = self._project(pairs)
        else:
            places, near = frame.project(pairs)
            far = np.flatnonzero(added & ~near)
            if far.size:
                _refuse_far(frame, pairs, int(far[0]), name, chosen)
        kept, renamed = self._given.apply(ops, pairs, places, ignore_missing)
        if not kept.all():
            ops, pairs, places = ops[kept], pairs[kept], places[kept]
        before = self._tree.changes
        try:
            self._tree.apply(ops, places, False)
        except BaseException:  # no memory, say
            self._given.apply(-ops, pairs, places, False)
            raise
        self._frame = frame
        if len(renamed) and before == self._tree.changes:
            self._tree.changes += bool((self._tree.vertices()[:, None] == renamed).all(axis=-1).any())
        return len(ops)

    # The hull

    def points(self) -> Points:
        """All pairs in lexicographic order, with multiplicity. O(n log n)."""
        return self._given.points()

    def vertices(self) -> Points:
        """The hull's vertices, counter-clockwise from the lexicographically smallest pair. O(h log n)."""
        pairs = self._given.at(self._tree.vertices())
        start = int(np.lexsort(pairs.T[::-1])[0]) if len(pairs) else 0
        return np.concatenate([pairs[start:], pairs[:start]])

    def locate(self, lonlat: Points) -> npt.NDArray[np.int8]:
        """+1 inside, 0 on the boundary, -1 outside, for each row. O(log n) a row."""
        places, near = self._project(lonlat)
        signs = np.full(len(places), -1, dtype=np.int8)
        signs[near] = self._tree.locate(places[near])
        return signs

    def tangents(self, lonlat: Points) -> npt.NDArray[np.float64]:
        """The left and the right tangent point seen from each row, NaN unless the row is outside. O(log n) a row."""
        places, near = self._project(lonlat)
        if self._frame is not None and not near.all():
            _refuse_far(self._frame, lonlat, int(np.flatnonzero(~near)[0]), "points row {}", "")
        result = np.full((len(places), 2, 2), np.nan)
        result[near] = self._tree.tangents(places[near])
        outside = np.flatnonzero(~np.isnan(result[:, 0, 0]))
        result[outside] = self._given.at(result[outside].reshape(-1, 2)).reshape(-1, 2, 2)
        return result

    # As a value

    def copy(self) -> Self:
        """An independent tree of the same pairs. O(n)."""
        new = type(self)(None)
        new._frame, new._tree, new._given = self._frame, self._tree.copy(), self._given.copy()
        return new

    def check(self) -> None:
        """Raise AssertionError if an invariant is broken. O(n log n)."""
        self._tree.check()
        pairs = self._given.points()
        places, near = self._project(pairs)
        assert near.all()
        assert np.array_equal(places[np.lexsort(places.T[::-1])], self._tree.points())
        distinct, copies = np.unique(pairs, axis=0, return_counts=True)
        assert len(distinct) == self.distinct
        assert np.array_equal(self.count_many(distinct), copies)


def _refuse_far(frame: Gnomonic, pairs: Points, row: int, name: str, chosen: str) -> None:
    pair = (pairs[row, 0].item(), pairs[row, 1].item())
    raise ValueError(
        f"{name.format(row)} is {pair}: {frame.angle(pair):.6f} degrees from the centre {frame.center}{chosen}; "
        f"a hull reaches {REACH:g} degrees"
    )
