"""GlobeTree: a multiset of places on the globe and its convex hull, the readable reference.

A tree holds the places in the gnomonic projection about a centre, where great circles are straight lines and the hull
of the projected places is the hull on the globe. A dictionary has, for each projected place, the pairs of numbers that
were given for it: usually one, but 180 and -180 degrees, and all longitudes at a pole, share a place.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from ._globe import REACH, Gnomonic, as_lonlat, as_place
from ._implementation import kernel
from ._tree import HullTree
from .arrays import Points, as_tuples

if TYPE_CHECKING:
    from . import _kernel
    from ._predicates import Point


class _Change(NamedTuple):
    """A change of the number of copies of a given pair, and the projection of its place."""

    pair: Point
    place: Point
    copies: int


class GlobeTree:
    """A multiset of pairs (longitude, latitude) in degrees, and its hull; edges are great circles.

    Single coordinates are checked, and so are arrays. O(log² n) an update, O(log n) a query, O(n) space.

    Args:
        center: checked by `as_center`; None to choose it when the first points come.
    """

    _tree_type: ClassVar[type[HullTree | _kernel.HullTree]] = HullTree if kernel is None else kernel.HullTree

    def __init__(self, center: Point | None) -> None:
        self._frame = None if center is None else Gnomonic(center)
        self._tree: HullTree | _kernel.HullTree = self._tree_type()
        self._pairs: dict[Point, tuple[Point, ...]] = {}  # the different pairs at each projected place, in order
        self._copies: dict[Point, int] = {}  # numbers of copies, of the pairs with more than one
        self._distinct = 0

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
        return self._distinct

    def count(self, lon: float, lat: float) -> int:
        """The number of copies of the pair. O(1)."""
        return int(self.count_many(as_place(lon, lat))[0])

    def count_many(self, lonlat: Points) -> npt.NDArray[np.int64]:
        """The number of copies of each row. O(1) a row."""
        places, _ = self._project(lonlat)
        counts = [self._count(*row) for row in zip(as_tuples(lonlat), as_tuples(places), strict=True)]
        return np.array(counts, dtype=np.int64)

    def _count(self, pair: Point, place: Point) -> int:
        return self._copies.get(pair, 1) if pair in self._pairs.get(place, ()) else 0

    def _project(self, lonlat: Points) -> tuple[Points, npt.NDArray[np.bool_]]:
        """The projections, NaN beyond REACH, and which rows have one: without a centre, none."""
        if self._frame is None:
            return np.full(lonlat.shape, np.nan), np.zeros(len(lonlat), dtype=bool)
        return self._frame.project(lonlat)

    # Updates

    def insert(self, lon: float, lat: float) -> bool:
        """Add a pair. True if the hull changed. O(log² n)."""
        changes = self.changes
        self._apply(np.array([1]), as_place(lon, lat), "the point", ignore_missing=False)
        return self.changes > changes

    def delete(self, lon: float, lat: float) -> bool:
        """Remove one copy of a pair. True if the hull changed; KeyError if the pair is missing. O(log² n)."""
        changes = self.changes
        self._apply(np.array([-1]), as_place(lon, lat), "the point", ignore_missing=False)
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
        return self._apply(np.broadcast_to(ops, len(pairs)), pairs, "points row {}", ignore_missing=ignore_missing)

    def clear(self) -> None:
        """Remove every pair. The centre stays."""
        self._tree.clear()
        self._pairs, self._copies, self._distinct = {}, {}, 0

    def recenter(self, center: Point | None) -> None:
        """Build the tree anew about another centre, by default the mean direction of the pairs. O(n log n)."""
        pairs = self.points()
        if center is None and not len(pairs):
            raise ValueError("center is None, and there are no points to choose it from")
        new = type(self)(center)
        new.apply(+1, pairs, ignore_missing=False)
        new.changes = self.changes + (not np.array_equal(new.vertices(), self.vertices()))
        vars(self).update(vars(new))

    def _apply(self, ops: npt.NDArray[np.integer], pairs: Points, name: str, *, ignore_missing: bool) -> int:
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
        rows = list(zip(as_tuples(pairs), as_tuples(places), strict=True))
        kept, changes = self._net(ops, rows, ignore_missing=ignore_missing)
        if kept:
            self._tree.apply(np.ascontiguousarray(ops[kept], dtype=np.int8), places[kept], False)
        self._frame = frame
        self._record(changes)
        return len(kept)

    def _net(
        self, ops: npt.NDArray[np.integer], rows: list[tuple[Point, Point]], *, ignore_missing: bool
    ) -> tuple[list[int], list[_Change]]:
        """The rows that apply, and what they do together."""
        signs = ops.tolist()
        net = Counter(pair for (pair, _), sign in zip(rows, signs, strict=True) if sign > 0)
        kept = []
        for row, ((pair, place), sign) in enumerate(zip(rows, signs, strict=True)):
            if sign < 0:
                if net[pair] + self._count(pair, place) == 0:
                    if not ignore_missing:
                        raise KeyError(*pair, row)
                    continue
                net[pair] -= 1
            kept.append(row)
        places = dict(rows)
        return kept, [_Change(pair, places[pair], copies) for pair, copies in net.items() if copies]

    def _record(self, changes: list[_Change]) -> None:
        """Keep the pairs of a batch that the tree has applied."""
        renamed = []
        before = self._tree.changes
        for pair, place, added in changes:
            pairs = self._pairs.get(place, ())
            copies = self._count(pair, place)
            self._distinct += (copies == 0) - (copies + added == 0)
            if copies == 0:
                self._pairs[place] = tuple(sorted((*pairs, pair)))
            elif copies + added == 0:
                self._pairs[place] = tuple(other for other in pairs if other != pair)
            if copies + added > 1:
                self._copies[pair] = copies + added
            else:
                self._copies.pop(pair, None)
            if not self._pairs[place]:
                del self._pairs[place]
            elif pairs and pairs[0] != self._pairs[place][0]:
                renamed.append(place)
        if renamed and before == self._tree.changes:
            self._tree.changes += not set(renamed).isdisjoint(as_tuples(self._tree.vertices()))

    # The hull

    def points(self) -> Points:
        """All pairs in lexicographic order, with multiplicity. O(n log n)."""
        pairs = sorted(pair for pairs in self._pairs.values() for pair in pairs)
        return _array([each for pair in pairs for each in [pair] * self._copies.get(pair, 1)])

    def vertices(self) -> Points:
        """The hull's vertices, counter-clockwise from the lexicographically smallest pair. O(h log n)."""
        pairs = self._given(self._tree.vertices())
        start = pairs.index(min(pairs)) if pairs else 0
        return _array(pairs[start:] + pairs[:start])

    def _given(self, places: Points) -> list[Point]:
        """The least of the pairs given for each projected place."""
        return [self._pairs[place][0] for place in as_tuples(places)]

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
        result[outside] = _array(self._given(result[outside].reshape(-1, 2))).reshape(-1, 2, 2)
        return result

    # As a value

    def copy(self) -> Self:
        """An independent tree of the same pairs. O(n)."""
        new = type(self)(None)
        new._frame, new._tree = self._frame, self._tree.copy()
        new._pairs, new._copies, new._distinct = self._pairs.copy(), self._copies.copy(), self._distinct
        return new

    def check(self) -> None:
        """Raise AssertionError if an invariant is broken. O(n log n)."""
        self._tree.check()
        names = [(pair, place) for place, pairs in self._pairs.items() for pair in pairs]
        assert len(names) == self._distinct
        assert all(pairs and pairs == tuple(sorted(set(pairs))) for pairs in self._pairs.values())
        assert self._copies.keys() <= {pair for pair, _ in names}
        assert all(copies > 1 for copies in self._copies.values())
        copies: Counter[Point] = Counter()
        for pair, place in names:
            copies[place] += self._copies.get(pair, 1)
        assert copies == Counter(as_tuples(self._tree.points()))
        if names:
            places, near = self._project(_array([pair for pair, _ in names]))
            assert near.all()
            assert as_tuples(places) == [place for _, place in names]


def _refuse_far(frame: Gnomonic, pairs: Points, row: int, name: str, chosen: str) -> None:
    pair = (pairs[row, 0].item(), pairs[row, 1].item())
    raise ValueError(
        f"{name.format(row)} is {pair}: {frame.angle(pair):.6f} degrees from the centre {frame.center}{chosen}; "
        f"a hull reaches {REACH:g} degrees"
    )


def _array(pairs: list[Point]) -> Points:
    return np.array(pairs, dtype=np.float64).reshape(-1, 2)
