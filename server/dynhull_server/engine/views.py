"""The part of a hull that a watcher follows: its vertices, or the extreme ones in some directions."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dynhull.arrays import Points

from ..state.contents.places import GeographicHull
from ..state.hull_state import Counts, HullState, VertexKeys
from ..state.numbers import rows_of
from .difference import Difference
from .live_hull import LiveHull


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The whole hull; `keys` are those of the vertices if the watcher requested them."""

    counts: Counts
    vertices: Points
    uid: str
    keys: VertexKeys | None = None


@dataclass(frozen=True, slots=True)
class Change:
    """The change of the hull since the previous event.

    `removed` are the vertices that it lost, and `keys` those of all vertices if the watcher requested them.
    """

    counts: Counts
    removed: Points
    vertices: Points
    difference: Difference
    keys: VertexKeys | None = None


@dataclass(frozen=True, slots=True)
class Sketch:
    """Some vertices, their keys if requested, and all vertices for requested measures.

    `error` is how far the hull reaches beyond them; 0 for extreme vertices, one per direction.
    """

    counts: Counts
    uid: str
    extremes: Points
    vertices: Points | None
    keys: VertexKeys | None = None
    error: float = 0.0


@dataclass(frozen=True, slots=True)
class Progress:
    """The watcher's copy is up to date at this revision."""

    counts: Counts


Event = Snapshot | Change | Sketch | Progress


class View(Protocol):
    """The events of one watcher. It remembers what the watcher holds."""

    async def first(self, min_revision: int) -> Event:
        """The first event."""

    async def next(self) -> Event:
        """The change since the previous event; Progress where there is none."""

    async def changed(self, revision: int) -> None:
        """Wait until the part of the hull may have changed after a revision."""


# A sketch of this many vertices takes some milliseconds, so it is made between two writes. A vertex of it takes as long
# as locating this many rows.
FEW_VERTICES, ROWS_A_VERTEX = 64, 64


async def _changed(hull: LiveHull, revision: int, *, any_point: bool) -> None:
    if any_point:  # vertices may have other keys, and inner layers other vertices
        await hull.reached(revision + 1)
    else:
        await hull.outlined(revision)


class VerticesView:
    """The vertices: a snapshot, then changes.

    Args:
        hull: the hull.
        keys: whether to include the keys of the vertices, in a keyed hull.
        layer: the convex layer.
    """

    def __init__(self, hull: LiveHull, *, keys: bool = False, layer: int = 1) -> None:
        self._hull = hull
        self._with_keys = keys
        self._layer = layer
        self._held = np.empty((0, 2))
        self._held_keys: VertexKeys | None = None

    @property
    def outline_only(self) -> bool:
        """Whether it reads nothing but the vertices of the hull itself."""
        return not self._with_keys and self._layer == 1

    async def _look(self, min_revision: int = 0) -> tuple[Counts, Points, VertexKeys | None]:
        if self._with_keys:
            return await self._hull.named_vertices(min_revision, self._layer)
        return *await self._hull.vertices(min_revision, self._layer), None

    async def first(self, min_revision: int) -> Event:
        """A snapshot."""
        counts, self._held, self._held_keys = await self._look(min_revision)
        return Snapshot(counts, self._held, self._hull.uid, self._held_keys)

    async def next(self) -> Event:
        """The change since the previous event."""
        held, held_keys = self._held, self._held_keys
        counts, vertices, keys = await self._look()
        self._held, self._held_keys = vertices, keys
        if vertices is held and keys is held_keys:
            return Progress(counts)
        change = await self._hull.differences.between(held, vertices, held_keys, keys)
        return Change(counts, held[change.removed], vertices, change, keys) if change else Progress(counts)

    async def changed(self, revision: int) -> None:
        """Wait until the vertices, or with keys or in an inner layer the hull, may have changed."""
        await _changed(self._hull, revision, any_point=self._with_keys or self._layer > 1)


class ResumedView(VerticesView):
    """The vertices, for a watcher that holds those of an earlier revision: changes alone.

    Args:
        hull: the hull.
        uid: of the hull that the watcher holds.
        revision: its revision.
        keys: whether to include the keys of the vertices; the first change has those of all vertices.
    """

    def __init__(self, hull: LiveHull, uid: str, revision: int, *, keys: bool = False) -> None:
        super().__init__(hull, keys=keys)
        self._uid = uid
        self._revision = revision

    async def first(self, min_revision: int) -> Event:
        """The change since then; a snapshot where its vertices were never sent.

        Raises:
            HullReplacedError, RevisionForgottenError, NotStoredError: there is no way from there to here.
        """
        await self._hull.reached(min_revision)  # beforehand: vertices that are recalled are not held for long
        async with self._hull.recalled(self._uid, self._revision) as held:
            if held is None:
                return await super().first(min_revision)
            self._held = held
            return await self.next()


# Chosen vertices, all vertices, the keys of the chosen ones, and how far the hull reaches beyond them.
_Chosen = tuple[Points, Points | None, VertexKeys | None, float]


class _ChosenView(ABC):
    """Some of the vertices; each event has all of them.

    Args:
        hull: the hull.
        vertices: whether to include all vertices.
        keys: whether to include the keys of those that are chosen, in a keyed hull.
        layer: the convex layer.
    """

    def __init__(self, hull: LiveHull, *, vertices: bool, keys: bool, layer: int = 1) -> None:
        self._hull = hull
        self._with_vertices = vertices
        self._with_keys = keys
        self._layer = layer
        self._held: _Chosen = np.empty((0, 2)), None, None, 0.0

    @abstractmethod
    async def _choose(self, min_revision: int) -> tuple[Counts, _Chosen]:
        """What there is at a revision."""

    def _read(self, state: HullState, chosen: Points, error: float = 0.0) -> _Chosen:
        vertices = state.vertices() if self._with_vertices else None
        return chosen, vertices, state.keys_at(chosen) if self._with_keys else None, error

    def _rows(self, chosen: int) -> int:
        return chosen + (self._hull.vertex_count if self._with_vertices else 0)

    async def first(self, min_revision: int) -> Event:
        """A sketch."""
        counts, self._held = await self._choose(min_revision)
        return Sketch(counts, self._hull.uid, *self._held)

    async def next(self) -> Event:
        """A sketch, if it has changed."""
        before = self._held
        counts, self._held = await self._choose(0)
        if all(map(_same, before, self._held)):
            return Progress(counts)
        return Sketch(counts, self._hull.uid, *self._held)

    async def changed(self, revision: int) -> None:
        """Wait until the vertices, or with keys or in an inner layer the hull, may have changed."""
        await _changed(self._hull, revision, any_point=self._with_keys or self._layer > 1)


class SketchView(_ChosenView):
    """The extreme vertices in some directions.

    Args:
        hull: the hull.
        directions: (k, 2) non-zero vectors.
        vertices: whether to include the vertices.
        keys: whether to include the keys of the extreme vertices, in a keyed hull.
    """

    def __init__(self, hull: LiveHull, directions: Points, *, vertices: bool, keys: bool = False) -> None:
        super().__init__(hull, vertices=vertices, keys=keys)
        self._directions = directions

    def _look(self, state: HullState) -> _Chosen:
        extremes = state.outline().support(self._directions) if len(state.hull) else np.empty((0, 2))
        return self._read(state, extremes)

    async def _choose(self, min_revision: int) -> tuple[Counts, _Chosen]:
        return await self._hull.read(self._look, self._rows(len(self._directions)), min_revision)


class FewView(_ChosenView):
    """At most `most` of the vertices, and how far the hull reaches beyond them.

    Args:
        hull: the hull.
        most: the number of vertices.
        vertices: whether to include all vertices.
        keys: whether to include the keys of the vertices, in a keyed hull.
        layer: the convex layer.
    """

    def __init__(self, hull: LiveHull, most: int, *, vertices: bool, keys: bool, layer: int) -> None:
        super().__init__(hull, vertices=vertices, keys=keys, layer=layer)
        self._most = most

    def _look(self, state: HullState) -> _Chosen:
        """A sketch of the hull itself."""
        assert not isinstance(state.hull, GeographicHull)  # its sketches are made aside
        return self._read(state, *state.hull.sketch(self._most))

    async def _look_aside(self, min_revision: int) -> tuple[Counts, _Chosen]:
        """A sketch of the vertices of the layer or of places on the globe, made outside of the trips."""
        keys = None
        if self._with_keys:
            counts, vertices, keys = await self._hull.named_vertices(min_revision, self._layer)
        else:
            counts, vertices = await self._hull.vertices(min_revision, self._layer)
        chosen, error = await self._hull.sketch(counts, vertices, self._most)
        named = None if keys is None else keys[rows_of(chosen, vertices)]
        return counts, (chosen, vertices if self._with_vertices else None, named, error)

    async def _choose(self, min_revision: int) -> tuple[Counts, _Chosen]:
        if self._layer > 1 or self._most > FEW_VERTICES or self._hull.geographic:
            return await self._look_aside(min_revision)
        return await self._hull.read(self._look, self._rows(self._most * ROWS_A_VERTEX), min_revision)


def _same(a: Points | VertexKeys | float | None, b: Points | VertexKeys | float | None) -> bool:
    return a is b or (a is not None and b is not None and np.array_equal(a, b))
