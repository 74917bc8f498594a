"""A watcher's own copy of a hull."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull._shown import geometry, svg
from dynhull.arrays import Points

from ._keys import KeyTuple
from ._messages import Change, Deleted, Event, Snapshot


class HullCopy:
    """A copy of a watched hull, updated event by event. It has a GeoJSON geometry and a picture, as `Hull` has.

    Attributes:
        uid: identifies the hull; empty before the first snapshot and after a deletion.
        revision: the revision of the last event; 0 before the first.
        points: the number of points at that revision, duplicates included.
        vertices: (h, 2) counter-clockwise from the lexicographically smallest; exactly the hull's at that revision.
            Read-only.
        vertex_keys: the key of each vertex; None unless the watch has `keys=True`.
    """

    uid: str
    revision: int
    points: int
    vertices: Points
    vertex_keys: KeyTuple | None

    def __init__(self) -> None:
        self._clear()

    def update(self, event: Event) -> None:
        """Apply an event. O(h)."""
        if isinstance(event, Deleted):
            self._clear()
            return
        if isinstance(event, Snapshot):
            self.vertices, self.uid, self.vertex_keys = event.vertices, event.uid, event.vertex_keys
        elif isinstance(event, Change):
            self.vertex_keys = _changed_keys(self.vertex_keys, len(self.vertices), event)
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
        self.vertex_keys = None


def _changed(vertices: Points, change: Change) -> Points:
    changed: Points = _edited(vertices, change.added, change)
    changed.flags.writeable = False
    return changed


def _changed_keys(keys: KeyTuple | None, count: int, change: Change) -> KeyTuple | None:
    """The keys after a change; those of a copy that had none are all among the renamed ones."""
    if change.added_keys is None or change.renamed_keys is None:
        return None
    before = np.empty(count, object) if keys is None else np.array(keys, object)
    changed = _edited(before, np.array(change.added_keys, object), change)
    changed[change.renamed_rows] = change.renamed_keys
    return tuple(changed.tolist())


def _edited(rows: npt.NDArray[Any], added: npt.NDArray[Any], change: Change) -> npt.NDArray[Any]:
    kept = np.roll(np.delete(rows, change.removed_rows, axis=0), -change.rotation, axis=0)
    changed = np.empty((len(kept) + len(added), *rows.shape[1:]), rows.dtype)
    is_added = np.zeros(len(changed), np.bool_)
    is_added[change.added_rows] = True
    changed[is_added] = added
    changed[~is_added] = kept
    return changed
