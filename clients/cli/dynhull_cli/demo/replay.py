"""Replays a scene through a server and compares three hulls after every frame."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dynhull import GeoHull, convex_hull
from dynhull_client import Batch, FenceEvent, Hull, HullClient, HullCopy

from .alarms import Alarms
from .follower import Follower
from .scene import Frame, Points, Scene


@dataclass(frozen=True, slots=True)
class ReplayStep:
    """The outcome of one frame.

    Attributes:
        frame: the frame.
        vertices: (h, 2) vertices of the live hull.
        area: the live hull's area, in the unit of the scene.
        keys: the key of each vertex, as the server names it; None in a scene without keys.
        events: the events of the fences.
        alarms: the counts of events so far: equal to the recomputed ones, and recomputed.
        difference: the first thing that differed, None where everything agreed.
        revision: the revision of the live hull.
    """

    frame: Frame
    vertices: Points
    area: float
    keys: tuple[object, ...] | None
    events: list[FenceEvent]
    alarms: tuple[int, int]
    difference: str | None
    revision: int

    def corners(self) -> list[str]:
        """The names of the vertices."""
        return self.frame.names_at(self.vertices) if self.keys is None else [str(key) for key in self.keys]


@dataclass(frozen=True, slots=True)
class Reached:
    """What a watcher's copy was: its revision, vertices and their keys."""

    revision: int
    vertices: Points
    keys: tuple[object, ...] | None


class Watcher:
    """A copy of a hull that a thread keeps up to date from a watch."""

    def __init__(self, client: HullClient, name: str, *, keys: bool) -> None:
        self._copy = HullCopy()
        self._follower = Follower("watcher", client.watch(name, keys=keys), self._copy.update)

    def at(self, revision: int) -> Reached | None:
        """The copy at a revision, or at a later one that it skipped to; None if it does not get there in time."""
        return self._follower.wait(lambda: self._reached(revision))

    def _reached(self, revision: int) -> Reached | None:
        copy = self._copy
        return Reached(copy.revision, copy.vertices, copy.vertex_keys) if copy.revision >= revision else None

    def stop(self) -> None:
        """End the subscription."""
        self._follower.stop()


def replay(client: HullClient, scene: Scene, *, history: bool = False) -> Iterator[ReplayStep]:
    """Send every frame as one batch, and check the hull after each. With `history`, its past is kept for ever.

    The live hull must equal Chan's recomputation from the points in the server. These must be the points sent: the same
    keys at the same positions or, without keys, as many points with the same hull. The watcher's copy must equal the
    live hull, and the keys of the vertices must be at the vertices. The events of fences must be those that follow from
    all positions before and after the frame, recomputed without the server.
    """
    name = scene.hull_name
    clock: Literal["server", "data"] = "server" if scene.max_age is None else "data"
    client.create_hull(
        name,
        keyed="str" if scene.keyed else None,
        max_age=scene.max_age,
        clock=clock,
        geographic=scene.center is not None,
        center=scene.center,
        history=history or None,
    )
    alarms = Alarms(client, scene) if scene.circles or scene.rivals else None
    watcher = Watcher(client, name, keys=scene.keyed)
    try:
        for number, frame in enumerate(scene.frames(), start=1):
            revision = _send(client, scene, frame, alarms)
            live = client.get_hull(name, min_revision=revision)
            difference = (
                _verified(client, scene, frame, live) or _named(frame, live) or _watched(watcher.at(revision), live)
            )
            events: list[FenceEvent] = []
            counts = 0, 0
            if alarms:
                events, wrong = alarms.check(frame, revision)
                difference = difference or wrong or (alarms.surplus() if number == scene.length else None)
                counts = alarms.agreed, alarms.expected
            area = live.measures.area * scene.area_scale
            yield ReplayStep(frame, live.vertices, area, live.vertex_keys, events, counts, difference, live.revision)
    finally:
        watcher.stop()
        if alarms:
            alarms.stop()


def _send(client: HullClient, scene: Scene, frame: Frame, alarms: Alarms | None) -> int:
    """Send a frame as one batch, or as one batch to each of several hulls. Returns the revision of the scene's hull."""
    name = scene.hull_name
    if alarms:
        batch = Batch(keys=frame.keys, points=frame.points, remove=frame.removed)
        batches = alarms.batches(frame)
        if batches:
            return client.transfer({name: batch, **batches})[name].revision
    if scene.keyed:
        return client.put(name, frame.keys, frame.points, remove=frame.removed).revision
    times = None if scene.max_age is None else [frame.time] * len(frame.points)
    return client.apply(name, insert=frame.points, times=times).revision


def _verified(client: HullClient, scene: Scene, frame: Frame, live: Hull) -> str | None:
    """What is wrong with the points in the server; None if they are those of the frame."""
    found = client.verify(scene.hull_name, min_revision=live.revision)
    if not found.equal:
        return f"the live hull differs from Chan's recomputation: {found.difference}"
    if found.points != len(frame.positions):
        return f"the server holds {found.points} points, {len(frame.positions)} were sent"
    if not scene.keyed:
        same = np.array_equal(live.vertices, _vertices(scene, frame))
        return None if same else "the server holds other points than those that were sent"
    if not found.keys_equal:
        return "the points of the hull are not the positions of its keys"
    there = client.entities(scene.hull_name, min_revision=live.revision)
    sent = dict(zip(frame.names, frame.positions.tolist(), strict=True))
    if dict(zip(there.keys, there.points.tolist(), strict=True)) != sent:
        return f"the server holds the keys {sorted(there.keys)}, {sorted(sent)} were sent, or their positions differ"
    return None


def _vertices(scene: Scene, frame: Frame) -> Points:
    """The vertices of the hull of all points of a frame, computed without the server."""
    if scene.center is None:
        return convex_hull(frame.positions)
    return GeoHull(frame.positions, scene.center).vertices()


def _named(frame: Frame, live: Hull) -> str | None:
    """A key that is not at its vertex; None if all are."""
    if live.vertex_keys is None:
        return None
    sent = dict(zip(frame.names, frame.positions.tolist(), strict=True))
    for key, vertex in zip(live.vertex_keys, live.vertices.tolist(), strict=True):
        if sent.get(str(key)) != vertex:
            return f"the vertex {vertex} has the key {key}, which is at {sent.get(str(key))}"
    return None


def _watched(copy: Reached | None, live: Hull) -> str | None:
    """How the watcher's copy differs from the live hull; None if it does not."""
    if copy is None or copy.revision != live.revision:
        return f"the watcher did not reach revision {live.revision}"
    if not np.array_equal(copy.vertices, live.vertices):
        return f"the watcher's copy differs: {copy.vertices.tolist()} instead of {live.vertices.tolist()}"
    if copy.keys != live.vertex_keys:
        return f"the watcher's copy has the keys {copy.keys} instead of {live.vertex_keys}"
    return None
