"""Fences: which entities are inside of which areas, and who crossed; the readable reference of the kernel's class.

A fence has the set of keys that were inside when it was last looked at. A journal of the entities has the places of
those that have changed since. `take` decides again for these, and for all keys of a fence whose area has changed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from ._areas import NOTHING, Area, Polygons, disk_area, hull_area
from ._entities import REMOVED, Journal
from .arrays import as_tuples
from .keys import PackedKeys, key_list
from .static import convex_hull

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._entities import Entities, Key
    from ._metres import Metres
    from ._predicates import Point
    from .arrays import Points
    from .keys import Keys

MOVED, AREA, APPEARED = 1, 2, 4  # causes, beside those of `Journal.gone`
ENTERED, LEFT, CROSSED, STAYED = 1, -1, 0, 2
UNDECIDED = object()  # the area of a fence whose keys were given, not decided

Taken = tuple[bytes, bytes | None, bytes]


@dataclass(slots=True)
class _Fence:
    area: Area
    closed: bool
    margin: float
    cross: bool
    own: bool  # whether the area is the subjects' own hull, without the subject
    inside: set[Key] = field(default_factory=set)
    decided: object = None  # the area and its settings by which `inside` was decided
    earlier: dict[Key, Point | None] = field(default_factory=dict)  # of a new fence: the places of the journal's keys

    def settings(self) -> tuple[Area, bool, float, bool]:
        return self.area, self.closed, self.margin, self.own


class Fences:
    """Fences of one set of entities. Brute force: `take` decides for each changed key and each fence."""

    def __init__(self, entities: Entities, metres: Metres | None = None) -> None:
        self._entities = entities
        self._metres = metres
        self._journal = Journal()
        self._fences: dict[int, _Fence] = {}
        self._carried: dict[Key, Point] = {}  # subjects from another index, with their places there
        self._given: set[Key] = set()  # keys that another index has
        entities.attach(self._journal)

    def detach(self) -> None:
        """End the journal of the entities."""
        self._entities.detach(self._journal)

    def __len__(self) -> int:
        return len(self._fences)

    def has(self, fence: int) -> bool:
        """Whether there is a fence of this number."""
        return fence in self._fences

    # Areas

    def set_polygons(
        self, fence: int, polygons: list[list[Points]], closed: bool, margin: float, cross: bool, inside: Keys | None
    ) -> None:
        """Add or replace a fence around polygons, as `as_polygons` returns them."""
        rings = tuple(tuple(tuple(as_tuples(ring)) for ring in polygon) for polygon in polygons)
        self._set(fence, _Fence(Polygons(rings), closed, margin, cross, False), inside)

    def set_circle(
        self,
        fence: int,
        x: float,
        y: float,
        radius: float,
        closed: bool,
        margin: float,
        cross: bool,
        inside: Keys | None,
    ) -> None:
        """Add or replace a fence around a disk."""
        self._set(fence, _Fence(disk_area((x, y), radius, closed), closed, margin, cross, False), inside)

    def set_hull(
        self,
        fence: int,
        vertices: Points,
        closed: bool,
        margin: float,
        cross: bool,
        without_self: bool,
        inside: Keys | None,
    ) -> None:
        """Add or replace a fence around a convex hull; `without_self` around that of the entities."""
        corners = self._entities.vertices() if without_self else vertices
        self._set(fence, _Fence(hull_area(as_tuples(corners), closed), closed, margin, cross, without_self), inside)

    def drop(self, fence: int) -> Keys:
        """Remove a fence. Returns the keys that were inside."""
        keys = self.inside(fence)
        del self._fences[fence]
        return keys

    def inside(self, fence: int) -> Keys:
        """The keys inside, in order."""
        return self._packed(sorted(self._fences[fence].inside))

    def count(self, fence: int) -> int:
        """The number of keys inside."""
        return len(self._fences[fence].inside)

    def margin(self, fence: int) -> float:
        """The margin."""
        return self._fences[fence].margin

    def distances(self, fence: int, places: Points) -> npt.NDArray[np.float64]:
        """The distances of places to the area; of entities, to that of the others."""
        each = self._looked_at(fence)
        return np.array([self._distance(self._area_for(each, p), p) for p in as_tuples(places)], np.float64)

    def clear(self, fence: int, places: Points, errors: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Which places are farther than their errors from the boundary; of entities, from that of the others."""
        each = self._looked_at(fence)
        rows = zip(as_tuples(places), errors.tolist(), strict=True)
        return np.array([not error or self._is_clear(each, p, error) for p, error in rows], np.bool_)

    def _is_clear(self, fence: _Fence, p: Point, error: float) -> bool:
        area = self._area_for(fence, p)
        if self._metres is None:
            return area.is_clear(p, fence.margin, error)
        if around := area.around(p):
            return any(self._nearest(p, edges) > error for edges in around)
        return not area.holds(p, closed=True) and self._nearest(p, area.edges()) > fence.margin + error

    def _looked_at(self, number: int) -> _Fence:
        """A fence, with its area as it is now."""
        fence = self._fences[number]
        if fence.own:
            fence.area = hull_area(as_tuples(self._entities.vertices()), fence.closed)
        return fence

    def _set(self, number: int, fence: _Fence, inside: Keys | None) -> None:
        present = self._fences.get(number)
        if present is not None and inside is None:
            fence.inside, fence.decided, fence.earlier = present.inside, present.decided, present.earlier
        else:
            places = self._entities.places()
            fence.earlier = {key: places.get(key) for key in self._journal.before}
            if inside is None:
                fence.inside = {key for key, p in places.items() if self._holds(fence, p)}
                fence.decided = fence.settings()
            else:
                fence.inside = {key for key in key_list(inside) if key in places}
                fence.decided = UNDECIDED
        self._fences[number] = fence

    # Crossings

    def carry(self, source: Fences, keys: Keys) -> npt.NDArray[np.bool_]:
        """Let keys that were removed there and are new here have moved. Returns which of them have."""
        here, there = self._entities.places(), source._entities.places()
        carried = np.zeros(len(keys), np.bool_)
        for row, key in enumerate(key_list(keys)):
            removed = source._journal.gone.get(key) == REMOVED and key not in there and key not in source._given
            before = source._carried.get(key, source._journal.before.get(key))
            new = key in here and self._journal.before.get(key, key) is None and key not in self._carried
            if not removed or before is None or not new:
                continue
            for number, fence in self._fences.items():
                other = source._fences.get(number)
                if other is not None and not fence.own and not other.own and key in other.inside:
                    other.inside.remove(key)
                    fence.inside.add(key)
            self._carried[key] = before
            source._given.add(key)
            carried[row] = True
        return carried

    def take(self) -> Taken | None:
        """What has crossed since the last call, as in `PackedCrossings`."""
        rows: list[tuple[int, int, int, Key, Point, Point, float]] = []
        nowhere = nan, nan
        places = self._entities.places()
        moved = bool(self._journal.before)
        for number in sorted(self._fences):
            fence = self._looked_at(number)
            changed = fence.settings() != fence.decided
            everyone = changed or (fence.own and moved)
            for key in sorted({*self._journal.before, *(places if everyone else ())}):
                previous = self._journal.before.get(key, places.get(key))
                carried = not fence.own and key in self._carried
                if carried:
                    previous = self._carried[key]
                now = places.get(key)
                was = key in fence.inside
                if now is None:
                    if was:
                        fence.inside.remove(key)
                        cause = self._journal.gone[key] | AREA * changed
                        rows.append((number, LEFT, cause, key, nowhere, previous or nowhere, nan))
                    continue
                area = self._area_for(fence, now)
                stays = was and fence.margin > 0
                inside = self._within(area, now, fence.margin) if stays else area.holds(now, fence.closed)
                start = fence.earlier.get(key, previous)
                if inside != was:
                    change = ENTERED if inside else LEFT
                elif inside and carried and key not in fence.earlier:
                    change = STAYED
                elif not was and fence.cross and start not in (None, now) and area.meets(start, now, fence.closed):
                    change = CROSSED
                else:
                    continue
                fence.inside ^= {key} if change in (ENTERED, LEFT) else set()
                cause = APPEARED if previous is None else MOVED * (carried or previous != now)
                cause |= AREA if changed or cause == 0 else 0
                rows.append((number, change, cause, key, now, previous or nowhere, self._distance(area, now)))
            fence.decided = fence.settings()
            fence.earlier = {}
        self._journal.clear()
        self._carried.clear()
        self._given.clear()
        return self._columns(rows) if rows else None

    def _holds(self, fence: _Fence, p: Point) -> bool:
        return self._area_for(fence, p).holds(p, fence.closed)

    def _within(self, area: Area, p: Point, margin: float) -> bool:
        return area.within(p, margin) if self._metres is None else self._distance(area, p) <= margin

    def _distance(self, area: Area, p: Point) -> float:
        if self._metres is None:
            return area.distance(p)
        return 0.0 if area.holds(p, closed=True) else self._nearest(p, area.edges())

    def _nearest(self, p: Point, edges: list[tuple[Point, Point]]) -> float:
        """The distance in metres from a place to the nearest of some edges."""
        assert self._metres is not None  # there is a frame
        ends = np.array(edges, np.float64).reshape(-1, 2, 2)
        return float(self._metres.to_edges(np.broadcast_to(p, (len(ends), 2)), ends[:, 0], ends[:, 1]).min(initial=inf))

    def _area_for(self, fence: _Fence, p: Point) -> Area:
        """The area that an entity at p is compared with."""
        if not fence.own or self._entities.count(*p) > 1 or p not in as_tuples(self._entities.vertices()):
            return fence.area
        points = self._entities.points()
        others = points[(points != p).any(axis=1)]
        return hull_area(as_tuples(convex_hull(others)), True) if len(others) else NOTHING

    def _columns(self, rows: list[tuple[int, int, int, Key, Point, Point, float]]) -> Taken:
        fences, changes, causes, keys, points, previous, distances = zip(*rows, strict=True)
        columns = [np.array(fences, np.int64).tobytes()]
        columns += [np.array(each, np.float64).tobytes() for each in (points, previous, distances)]
        columns += [np.array(changes, np.int8).tobytes(), np.array(causes, np.uint8).tobytes()]
        packed = self._packed(keys)
        if isinstance(packed, PackedKeys):
            return b"".join(columns), packed.lengths, packed.data
        return b"".join(columns), None, packed.tobytes()

    def _packed(self, keys: Any) -> Keys:
        return PackedKeys.pack(keys) if self._entities.key_type == "str" else np.array(keys, np.uint64)
