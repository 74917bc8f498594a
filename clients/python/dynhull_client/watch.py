"""Following a hull."""

from collections.abc import Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Self

import grpc
import numpy as np

from .errors import error_of
from .messages import Change, Event, Points, Snapshot, decode_event

if TYPE_CHECKING:
    from dynhull_proto.v1 import hull_service_pb2 as pb


class Watch(Iterator[Event]):
    """The events of a watched hull: a `Snapshot`, then `Change` and `Progress`. Iterates until closed.

    Iterating waits for the next event, and raises DynhullError where the server ends the watch. A context manager,
    closed on leaving; `close` may also be called by another thread, and ends the iteration.
    """

    def __init__(self, call: "grpc._CallIterator[pb.WatchResponse]") -> None:
        self._call = call
        self._closed = False

    def __next__(self) -> Event:
        try:
            return decode_event(next(self._call))
        except grpc.RpcError:
            if self._closed:
                raise StopIteration from None
            raise error_of(self._call) from None

    def close(self) -> None:
        """End the watch."""
        self._closed = True
        self._call.cancel()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


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
