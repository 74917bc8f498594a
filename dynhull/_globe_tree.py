"""Trees of places on the globe: the readable reference.

A tree holds the places in the gnomonic projection about a centre, where great circles are straight lines and the hull
of the projected places is the hull on the globe. It is asked and answers in pairs of degrees, those that were given. A
place has several pairs if it can be written in several ways: 180 and -180 degrees, any longitude at a pole.
"""

from __future__ import annotations

from collections import Counter
from contextlib import contextmanager
from typing import TYPE_CHECKING, Self

import numpy as np
import numpy.typing as npt

from ._entities import Entities
from ._expiry import WindowTree
from ._globe import CHOSEN, Gnomonic, as_lonlat, as_place
from ._tree import HullTree
from .arrays import Points, as_tuples

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from ._predicates import Point
    from .keys import KeyType


class GlobeTree(HullTree):
    """A multiset of pairs (longitude, latitude) in degrees, and its hull; edges are great circles.

    O(log² n) an update, O(log n) a query, O(n) space.

    Args:
        center: of the projection; None if the first batch of points is to choose it.
    """

    def __init__(self, center: Point | None = None) -> None:
        super().__init__()
        self._frame = None if center is None else Gnomonic(center)
        self._pairs: dict[Point, tuple[Point, ...]] = {}  # the different pairs at each projected place, in order
        self._copies_of: dict[Point, int] = {}  # the number of copies of each pair

    @property
    def center(self) -> Point | None:
        """The centre of the projection; None before the first points."""
        return None if self._frame is None else self._frame.center

    @property
    def distinct(self) -> int:
        """The number of different pairs."""
        return len(self._copies_of)

    @staticmethod
    def _as_points(xy: npt.ArrayLike) -> Points:
        return as_lonlat(xy)

    @staticmethod
    def _as_point(x: float, y: float) -> Point:
        return as_place(x, y)

    @contextmanager
    def _in_frame(
        self, points: Sequence[Point], name: str = "points row {}", inserted: npt.NDArray[np.bool_] | bool = True
    ) -> Iterator[None]:
        """ValueError if a point is too far from the centre. A centre that the points choose stays if the batch does."""
        before, rows = self._frame, np.array(points, dtype=np.float64).reshape(-1, 2)
        wanted = np.broadcast_to(inserted, len(rows))
        try:
            if before is None and wanted.any():
                self._frame = Gnomonic.about(rows[wanted])
            if self._frame is not None:
                near = self._frame.project(rows)[1]
                self._frame.require(rows, near | ~wanted, name, CHOSEN if before is None else "")
            yield
        except BaseException:
            self._frame = before
            raise

    def _projected(self, pairs: Points) -> tuple[Points, npt.NDArray[np.bool_]]:
        """The projections, NaN beyond REACH, and which rows have one: without a centre, none."""
        if self._frame is None:
            return np.full(pairs.shape, np.nan), np.zeros(len(pairs), dtype=bool)
        return self._frame.project(pairs)

    def _count(self, p: Point) -> int:
        return self._copies_of.get(p, 0)

    def clear(self) -> None:
        """Remove every pair. The centre stays."""
        super().clear()
        self._pairs, self._copies_of = {}, {}

    def copy(self) -> Self:
        """An independent tree of the same pairs. O(n)."""
        new = super().copy()
        new._frame, new._pairs, new._copies_of = self._frame, self._pairs.copy(), self._copies_of.copy()
        return new

    # Updates

    def insert(self, x: float, y: float) -> bool:
        """Add a pair. True if the hull changed. O(log² n)."""
        pair, before = self._as_point(x, y), self.changes
        with self._in_frame([pair], "the point"):
            self._apply_net(Counter([pair]))
        return self.changes > before

    def delete(self, x: float, y: float) -> bool:
        """Remove one copy of a pair. True if the hull changed; KeyError if the pair is missing. O(log² n)."""
        pair, before = self._as_point(x, y), self.changes
        if not self._count(pair):
            raise KeyError(*pair)
        self._apply_net(Counter({pair: -1}))
        return self.changes > before

    def _apply_net(self, net: Counter[Point]) -> None:
        pairs = [pair for pair, change in net.items() if change]
        place_of = dict(zip(pairs, as_tuples(self._projected(np.array(pairs).reshape(-1, 2))[0]), strict=True))
        net_of_places: Counter[Point] = Counter()
        for pair in pairs:
            net_of_places[place_of[pair]] += net[pair]
        before, names = self.changes, {place: self._pairs.get(place) for place in net_of_places}
        super()._apply_net(net_of_places)
        for pair in pairs:
            self._rename(place_of[pair], pair, net[pair])
        if self.changes == before:
            renamed = (p for p, old in names.items() if old and p in self._pairs and old[0] != self._pairs[p][0])
            self.changes += not set(self._vertices()).isdisjoint(renamed)

    def _rename(self, place: Point, pair: Point, change: int) -> None:
        """Change the number of copies of a pair."""
        copies = self._copies_of.pop(pair, 0) + change
        names = tuple(name for name in self._pairs.pop(place, ()) if name != pair)
        if copies:
            self._copies_of[pair] = copies
            names = tuple(sorted((*names, pair)))
        if names:
            self._pairs[place] = names

    def recenter(self, center: Point) -> None:
        """Project all pairs about another centre. ValueError if one is too far; nothing has changed. O(n log n)."""
        frame, pairs, before = Gnomonic(center), self.points(), self.vertices()
        places = as_tuples(frame.project_all(pairs))
        self._frame, self._pairs = frame, {}
        for pair, place in dict(zip(as_tuples(pairs), places, strict=True)).items():
            self._pairs[place] = *self._pairs.get(place, ()), pair
        self._build(Counter(places))
        self.changes += not np.array_equal(self.vertices(), before)

    # The hull

    def points(self) -> Points:
        """All pairs in lexicographic order, with multiplicity. O(n log n)."""
        pairs = [pair for pair in sorted(self._copies_of) for _ in range(self._copies_of[pair])]
        return np.array(pairs, dtype=np.float64).reshape(-1, 2)

    def vertices(self) -> Points:
        """The hull's vertices, counter-clockwise from the least pair; of several pairs at one place, the least."""
        pairs = [self._pairs[place][0] for place in self._vertices()]
        start = pairs.index(min(pairs)) if pairs else 0
        return np.array(pairs[start:] + pairs[:start], dtype=np.float64).reshape(-1, 2)

    def locate(self, xy: npt.ArrayLike) -> npt.NDArray[np.int8]:
        """+1 inside, 0 on the boundary, -1 outside, for each row. O(log n) a row."""
        places, near = self._projected(self._as_points(xy))
        signs = np.full(len(places), -1, dtype=np.int8)
        signs[near] = [self._locate(p)[0] for p in as_tuples(places[near])]
        return signs

    def tangents(self, xy: Points) -> npt.NDArray[np.float64]:
        """The left and the right tangent point seen from each row, NaN unless the row is outside. O(log n) a row."""
        result = np.full((len(xy), 2, 2), np.nan)
        if self._frame is not None:
            found = super().tangents(self._frame.project_all(xy))
            for row in np.flatnonzero(~np.isnan(found[:, 0, 0])):
                result[row] = [self._pairs[place][0] for place in as_tuples(found[row])]
        return result

    def check(self) -> None:
        """Raise AssertionError if an invariant is broken. O(n log n)."""
        super().check()
        pairs = self.points()
        places, near = self._projected(pairs)
        if not near.all() or Counter(as_tuples(places)) != Counter(
            {p: self._copies.get(p, 1) for p in self._all_points()}
        ):
            raise AssertionError("the tree does not hold the places of the pairs")
        names: dict[Point, tuple[Point, ...]] = {}
        for pair, place in sorted(set(zip(as_tuples(pairs), as_tuples(places), strict=True))):
            names[place] = *names.get(place, ()), pair
        if names != self._pairs:
            raise AssertionError("a place with other pairs than its own")


class GlobeEntities(Entities, GlobeTree):
    """Entities on the globe: their points are pairs of degrees."""

    def __init__(self, key_type: KeyType = "str", ordered: bool = False, center: Point | None = None) -> None:
        super().__init__(key_type, ordered)
        self._frame = None if center is None else Gnomonic(center)


class GlobeWindowTree(WindowTree, GlobeTree):
    """A window on the globe: its points are pairs of degrees."""

    def __init__(self, max_age: float | None, max_points: int | None, center: Point | None = None) -> None:
        super().__init__(max_age, max_points)
        self._frame = None if center is None else Gnomonic(center)

    def copy(self) -> Self:
        """An independent tree of the same points and times. O(n log n)."""
        new = type(self)(self._max_age, self._max_points, self.center)
        new.restore(*self.state())
        return new
