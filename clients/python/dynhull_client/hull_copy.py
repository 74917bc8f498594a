"""A watcher's own copy of a hull."""

from collections.abc import Iterator

import numpy as np

from .messages import Change, Event, Points, Snapshot


class HullCopy:
    """A copy of a watched hull, brought up to date event by event.

    Attributes:
        uid: the hull's, from the snapshot; empty before.
        revision: the revision of the last event; 0 before the first.
        points: how many points the hull had then, with multiplicity.
        vertices: (h, 2) counter-clockwise from the lexicographically smallest; exactly the hull's at that revision.
    """

    def __init__(self) -> None:
        self.uid = ""
        self.revision = 0
        self.points = 0
        self.vertices: Points = np.empty((0, 2))

    def update(self, event: Event) -> None:
        """Do what the event says. O(h)."""
        if isinstance(event, Snapshot):
            self.vertices, self.uid = event.vertices, event.uid
        elif isinstance(event, Change):
            self.vertices = _changed(self.vertices, event)
        self.revision, self.points = event.revision, event.points

    def follow(self, watch: Iterator[Event], revision: int) -> None:
        """Take events until the copy has the revision or a later one."""
        while self.revision < revision:
            self.update(next(watch))


def _changed(vertices: Points, change: Change) -> Points:
    kept = np.roll(np.delete(vertices, change.removed_rows, axis=0), -change.rotation, axis=0)
    changed = np.empty((len(kept) + len(change.added), 2))
    is_added = np.zeros(len(changed), np.bool_)
    is_added[change.added_rows] = True
    changed[is_added] = change.added
    changed[~is_added] = kept
    return changed
