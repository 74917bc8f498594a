"""Watching a hull: what to tell somebody who holds an earlier one.

A watcher has no queue. It remembers the vertices it has been told, waits for the revision to move, and is told the
difference to the hull as it is then. So whoever is slow gets fewer and larger changes, and memory does not grow.
"""

import asyncio
from collections.abc import AsyncGenerator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from .live_hull import Counts, LiveHull


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The whole hull."""

    counts: Counts
    vertices: Points


@dataclass(frozen=True, slots=True)
class Difference:
    """How to make one list of vertices from another.

    Strike the rows at `removed`, move the first `rotation` of the rest to the end, put in the rows that stand at
    `added` in the new list.
    """

    removed: npt.NDArray[np.intp]
    added: npt.NDArray[np.intp]
    rotation: int


@dataclass(frozen=True, slots=True)
class Change:
    """The hull is another than at the event before."""

    counts: Counts
    before: Points
    vertices: Points
    difference: Difference


@dataclass(frozen=True, slots=True)
class Progress:
    """The hull is the one of the event before."""

    counts: Counts


Event = Snapshot | Change | Progress


async def watch(
    hull: LiveHull, min_revision: int = 0, min_interval: float = 0.0, progress_interval: float | None = None
) -> AsyncGenerator[Event, None]:
    """A snapshot, then an event whenever the revision has moved.

    Args:
        hull: the hull to watch.
        min_revision: the snapshot waits for this revision.
        min_interval: seconds from one event to the next, at least.
        progress_interval: seconds without an event after which there is a Progress; None for never.

    Raises:
        HullNotFoundError: the hull has been deleted.
    """
    loop = asyncio.get_running_loop()
    counts, held = await hull.vertices(min_revision)
    told = loop.time()
    yield Snapshot(counts, held)
    while True:
        await asyncio.sleep(told + min_interval - loop.time())
        try:
            async with asyncio.timeout_at(None if progress_interval is None else told + progress_interval):
                await hull.reached(counts.revision + 1)
        except TimeoutError:
            told = loop.time()
            yield Progress(counts)
            continue
        counts, vertices = await hull.vertices()
        event: Event = Progress(counts)
        if vertices is not held:
            change = await asyncio.to_thread(difference, held, vertices)
            if change.removed.size or change.added.size:
                event = Change(counts, held, vertices, change)
            held = vertices
        told = loop.time()
        yield event


def difference(old: Points, new: Points) -> Difference:
    """How to make the vertices `new` from the vertices `old`, both counter-clockwise. O(h).

    Vertices common to two convex polygons stand in the same cyclic order on both, so a rotation is all they need.
    """
    common = set(_points(old)).intersection(_points(new))
    kept = [p for p in _points(old) if p in common]
    first = next((p for p in _points(new) if p in common), None)
    rotation = 0 if first is None else kept.index(first)
    return Difference(_positions_outside(old, common), _positions_outside(new, common), rotation)


def _points(vertices: Points) -> list[tuple[Any, ...]]:
    return list(map(tuple, vertices.tolist()))


def _positions_outside(vertices: Points, common: set[tuple[Any, ...]]) -> npt.NDArray[np.intp]:
    return np.array([i for i, p in enumerate(_points(vertices)) if p not in common], np.intp)
