"""Replays a scene through a server and compares three hulls after every frame."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from time import monotonic

import numpy as np

from dynhull_client import HullClient, HullCopy

from .scene import Frame, Points, Scene

PATIENCE = 30.0  # seconds to wait for the watcher; later, its copy counts as different


@dataclass(frozen=True, slots=True)
class Step:
    """The outcome of one frame.

    Attributes:
        frame: the frame.
        vertices: (h, 2) vertices of the live hull.
        area: the live hull's area.
        difference: the first thing that differed, None where everything agreed.
    """

    frame: Frame
    vertices: Points
    area: float
    difference: str | None


class Watcher:
    """A copy of a hull that a thread keeps up to date from a watch."""

    def __init__(self, client: HullClient, name: str) -> None:
        self._moved = threading.Condition()
        self._copy = HullCopy()
        self._failure: Exception | None = None
        self._events = client.watch(name)
        self._thread = threading.Thread(target=self._follow, name="watcher", daemon=True)
        self._thread.start()

    def _follow(self) -> None:
        try:
            for event in self._events:
                with self._moved:
                    self._copy.update(event)
                    self._moved.notify_all()
        except Exception as failure:  # raised in the thread that waits for the copy
            with self._moved:
                self._failure = failure
                self._moved.notify_all()

    def vertices_at(self, revision: int) -> Points | None:
        """The copy at a revision; None if it does not get there in time, or skips it."""
        deadline = monotonic() + PATIENCE
        with self._moved:
            while self._copy.revision < revision:
                if self._failure:
                    raise self._failure
                if not self._moved.wait(deadline - monotonic()):
                    return None
            return self._copy.vertices if self._copy.revision == revision else None

    def stop(self) -> None:
        """End the subscription."""
        self._events.close()
        self._thread.join()


def replay(client: HullClient, scene: Scene) -> Iterator[Step]:
    """Send every frame as one batch over one open stream, and check the hull after each in three ways.

    The live hull must equal Chan's recomputation from the points in the server, the number of these points must be the
    number sent, and the watcher's copy must equal the live hull.
    """
    name = scene.hull_name
    client.create_hull(name)
    watcher = Watcher(client, name)
    try:
        with client.ingest(name) as stream:
            for revision, frame in enumerate(scene.frames(), start=1):
                stream.apply(insert=frame.insert, delete=frame.delete)
                verified = client.verify(name, min_revision=revision)
                live = client.get_hull(name, min_revision=revision)
                copy = watcher.vertices_at(revision)
                difference = None
                if not verified.equal:
                    difference = f"the live hull differs from Chan's recomputation: {verified.difference}"
                elif verified.points != len(frame.positions):
                    difference = f"the server holds {verified.points} points, {len(frame.positions)} were sent"
                elif copy is None:
                    difference = f"the watcher did not reach revision {revision}"
                elif not np.array_equal(copy, live.vertices):
                    difference = f"the watcher's copy differs: {copy.tolist()} instead of {live.vertices.tolist()}"
                yield Step(frame, live.vertices, live.measures.area, difference)
    finally:
        watcher.stop()
