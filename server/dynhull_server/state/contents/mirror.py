"""The keys of a geographic hull in the plane of its projection, for the fences that compare them."""

from typing import TYPE_CHECKING

import numpy as np

from dynhull import GeoKeyedHull, KeyedHull
from dynhull.arrays import Points
from dynhull.globe import Gnomonic
from dynhull.keys import Keys, key_list

from .key_rows import update

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Sequence

    from ..records import KeyRows

Key = str | int
Position = tuple[float, float]


class Mirror:
    """A hull in the plane that is notified of each change of a geographic hull before it takes place, and follows it.

    Args:
        hull: the geographic hull, which has a centre that stays.

    Attributes:
        plane: the keys at their projections.
        inside: called before keys leave that nobody names; returns those whose places matter.
    """

    def __init__(self, hull: GeoKeyedHull) -> None:
        assert hull.center is not None  # checked when the fence was created
        self._hull = hull
        self._frame = Gnomonic(hull.center)
        keys, points, times = hull.entities()
        places = self.project(points)
        self.plane = KeyedHull.from_entities(keys, places, times, hull.key_type, ordered=hull.ordered)
        self._previous: dict[Key, Position] = {}
        self._strangers: set[Key] = set()
        self.inside: Callable[[], Iterable[Keys]] = tuple

    def project(self, points: Points) -> Points:
        """The projections of places that the hull has admitted."""
        return self._frame.project_all(points)

    def note(self, keys: Keys) -> None:
        """Take note of where keys are before they change."""
        points = self._hull.positions(keys)
        there = ~np.isnan(points[:, 0])
        for key, (lon, lat), held in zip(key_list(keys), points.tolist(), there.tolist(), strict=True):
            if held:
                self._previous.setdefault(key, (lon, lat))

    def bring(self, source: "Mirror", keys: "Iterable[Key]") -> None:
        """Take over where keys were that have come from another hull, as long as that has not been taken there."""
        brought = {key: source._previous[key] for key in keys if key in source._previous}
        self._previous |= brought
        if source._frame.center != self._frame.center:
            self._strangers |= brought.keys()

    def take_previous(self) -> "tuple[dict[Key, Position], Container[Key]]":
        """Where keys were, in degrees, that have changed since this was last called.

        And those of them that were in another plane, so that nobody knows what is between.
        """
        previous, strangers = self._previous, self._strangers
        self._previous, self._strangers = {}, set()
        return previous, strangers

    def note_inside(self) -> None:
        """Take note of where those keys are that may leave."""
        for keys in self.inside():
            self.note(keys)

    def change(self, rows: "KeyRows") -> None:
        """Keys are put and removed."""
        self.note(rows.keys)
        self.note(rows.removes)
        self.plane.remove_many(rows.removes, missing="ignore")
        if len(rows.keys):
            update(self.plane, rows, self.project(rows.points))

    def evict(self, number: int) -> None:
        """The oldest keys leave."""
        self.note_inside()
        self.plane.evict(number)

    def expire(self, until: int | None) -> None:
        """The keys whose time is at most `until` leave, or others do by their deadlines."""
        self.note_inside()
        if until is not None:
            self.plane.expire(until)

    def remove(self, keys: "Sequence[Key]") -> None:
        """Keys leave by their deadlines, after `expire`."""
        self.plane.remove_many(keys, missing="ignore")
