"""What a watcher holds of a hull: its vertices, or the extreme ones in some directions."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dynhull.arrays import Points

from ..state.hull_state import Counts, HullState
from .difference import Difference
from .live_hull import LiveHull


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The whole hull."""

    counts: Counts
    vertices: Points
    uid: str


@dataclass(frozen=True, slots=True)
class Change:
    """The hull is another than at the event before; `removed` are vertices that it had then."""

    counts: Counts
    removed: Points
    vertices: Points
    difference: Difference


@dataclass(frozen=True, slots=True)
class Sketch:
    """The extreme vertices, one for each direction; and the vertices, for their measures, where those are wanted."""

    counts: Counts
    extremes: Points
    vertices: Points | None


@dataclass(frozen=True, slots=True)
class Progress:
    """What is held is right for this revision too."""

    counts: Counts


Event = Snapshot | Change | Sketch | Progress


class View(Protocol):
    """What a watcher is told of a hull. It remembers what it has told."""

    async def first(self, min_revision: int) -> Event:
        """What there is to be told to begin with."""

    async def next(self) -> Event:
        """What is new since then; Progress where nothing is."""


class VerticesView:
    """The vertices: a snapshot, then changes."""

    def __init__(self, hull: LiveHull) -> None:
        self._hull = hull
        self._held = np.empty((0, 2))

    async def first(self, min_revision: int) -> Event:
        """A snapshot."""
        counts, self._held = await self._hull.vertices(min_revision)
        return Snapshot(counts, self._held, self._hull.uid)

    async def next(self) -> Event:
        """The change."""
        counts, vertices = await self._hull.vertices()
        held, self._held = self._held, vertices
        if vertices is held:
            return Progress(counts)
        change = await self._hull.differences.between(held, vertices)
        if change.removed.size or change.added.size:
            return Change(counts, held[change.removed], vertices, change)
        return Progress(counts)


class ResumedView(VerticesView):
    """The vertices, for a watcher that holds those of an earlier revision: changes alone.

    Args:
        hull: the hull.
        uid: of the hull that the watcher holds.
        revision: its revision.
    """

    def __init__(self, hull: LiveHull, uid: str, revision: int) -> None:
        super().__init__(hull)
        self._uid = uid
        self._revision = revision

    async def first(self, min_revision: int) -> Event:
        """The change since then; a snapshot where nobody was told what the vertices were.

        Raises:
            HullReplacedError, RevisionForgottenError, NotStoredError: there is no way from there to here.
        """
        await self._hull.reached(min_revision)  # beforehand: vertices that are recalled are not held for long
        async with self._hull.recalled(self._uid, self._revision) as held:
            if held is None:
                return await super().first(min_revision)
            self._held = held
            return await self.next()


class SketchView:
    """The extreme vertices in some directions, each time all of them.

    Args:
        hull: the hull.
        directions: (k, 2) vectors other than 0.
        vertices: whether the vertices are wanted too.
    """

    def __init__(self, hull: LiveHull, directions: Points, vertices: bool) -> None:
        self._hull = hull
        self._directions = directions
        self._with_vertices = vertices
        self._rows = len(directions) + (hull.vertex_count if vertices else 0)
        self._held: tuple[Points, Points | None] = np.empty((0, 2)), None

    def _look(self, state: HullState) -> tuple[Points, Points | None]:
        extremes = state.hull.support(self._directions) if len(state.hull) else np.empty((0, 2))
        return extremes, state.vertices() if self._with_vertices else None

    async def first(self, min_revision: int) -> Event:
        """A sketch."""
        counts, self._held = await self._hull.read(self._look, self._rows, min_revision)
        return Sketch(counts, *self._held)

    async def next(self) -> Event:
        """A sketch, where it is another."""
        before = self._held
        counts, self._held = await self._hull.read(self._look, self._rows)
        if all(map(_same, before, self._held)):
            return Progress(counts)
        return Sketch(counts, *self._held)


def _same(a: Points | None, b: Points | None) -> bool:
    return a is b or (a is not None and b is not None and np.array_equal(a, b))
