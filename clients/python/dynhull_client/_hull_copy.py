"""A watcher's own copy of a hull."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from dynhull._shown import geometry, svg
from dynhull.arrays import Points

from ._messages import Change, Deleted, Event, Snapshot


class HullCopy:
    """A copy of a watched hull, updated event by event. It has a GeoJSON geometry and a picture, as `Hull` has.

    Attributes:
        uid: identifies the hull; empty before the first snapshot and after a deletion.
        revision: the revision of the last event; 0 before the first.
        points: the number of points at that revision, duplicates included.
        vertices: (h, 2) counter-clockwise from the lexicographically smallest; exactly the hull's at that revision.
            Read-only.
    """

    uid: str
    revision: int
    points: int
    vertices: Points

    def __init__(self) -> None:
        self._clear()

    def update(self, event: Event) -> None:
        """Apply an event. O(h)."""
        if isinstance(event, Deleted):
            self._clear()
            return
        if isinstance(event, Snapshot):
            self.vertices, self.uid = event.vertices, event.uid
        elif isinstance(event, Change):
            self.vertices = _changed(self.vertices, event)
        self.revision, self.points = event.revision, event.points

    def follow(self, watch: Iterator[Event], revision: int) -> None:
        """Apply events of the watch until the copy has reached the revision or a later one."""
        while self.revision < revision:
            self.update(next(watch))

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The hull as a GeoJSON geometry."""
        return geometry(self.vertices)

    def __repr__(self) -> str:
        return f"<HullCopy at revision {self.revision}: {self.points} points, {len(self.vertices)} vertices>"

    def _repr_svg_(self) -> str:
        return svg(self.vertices, repr(self))

    def _clear(self) -> None:
        self.uid = ""
        self.revision = 0
        self.points = 0
        self.vertices = np.empty((0, 2))


def _changed(vertices: Points, change: Change) -> Points:
    kept = np.roll(np.delete(vertices, change.removed_rows, axis=0), -change.rotation, axis=0)
    changed = np.empty((len(kept) + len(change.added), 2))
    is_added = np.zeros(len(changed), np.bool_)
    is_added[change.added_rows] = True
    changed[is_added] = change.added
    changed[~is_added] = kept
    changed.flags.writeable = False
    return changed
