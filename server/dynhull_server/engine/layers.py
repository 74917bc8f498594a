"""Convex layers of a hull, and the influence of its vertices. Writes go on while they are computed.

What takes a few milliseconds is read between two writes. For anything larger the hull is copied between two writes (a
hundredth of the time of building it), and the copy is asked outside of the trips; few such copies exist at a time.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from ..state.batch import NO_POINTS
from ..state.contents.live import AnyHull, AnyKeyedHull
from ..state.errors import LimitExceededError
from ..state.hull_state import Counts, HullState, VertexKeys, key_array
from .steps import BLOCK, Run

T = TypeVar("T")

# The most layers and the most of their vertices in an answer, and the most vertices whose influence is computed.
MOST_LAYERS, MOST_LAYER_VERTICES, MOST_INFLUENCES = 1_000, 1_000_000, 100_000
# The number of vertices whose influence is read between two writes.
FEW_INFLUENCES = 1024
# Hulls that are copied for such reads at the same time.
COPIES = 2
# The layers last read are kept for further watchers if they have at most this many vertices.
MOST_KEPT = 65_536


@dataclass(frozen=True, slots=True)
class Layers:
    """The outermost layers at one revision, and the keys of their vertices if the hull is keyed."""

    counts: Counts
    layers: list[Points]
    keys: list[VertexKeys] | None

    @property
    def vertex_count(self) -> int:
        """The number of vertices of all layers."""
        return sum(map(len, self.layers))

    def layer(self, number: int) -> tuple[Points, VertexKeys | None]:
        """The vertices of a layer, from 1, and their keys; none if the points run out before."""
        if number > len(self.layers):
            return NO_POINTS, None if self.keys is None else np.empty(0, object)
        return self.layers[number - 1], None if self.keys is None else self.keys[number - 1]


class Readable(Protocol):
    """A hull as far as its layers ask it."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def counts(self) -> Counts:
        """The counts at the latest committed revision."""

    @property
    def geographic(self) -> bool:
        """Whether the points are places on the globe."""

    async def reached(self, revision: int) -> None:
        """Wait until the hull has this revision or a later one."""

    async def vertices(self, min_revision: int = 0) -> tuple[Counts, Points]:
        """The vertices."""

    async def read(self, function: Callable[[HullState], T], rows: int = 0) -> tuple[Counts, T]:
        """The value of a function of the state at one revision."""


class Peeling:
    """The layers of one hull, computed once for all who ask about the same revision.

    Args:
        hull: the hull.
        run: calls a function outside of the trips.
        copies: limits the number of copies.
    """

    def __init__(self, hull: Readable, run: Run, copies: asyncio.Semaphore) -> None:
        self._hull = hull
        self._run = run
        self._copies = copies
        self._turn = asyncio.Lock()
        self._recent: Layers | None = None
        self._recent_count = 0
        self._last_size = 0

    async def layers(self, count: int, min_revision: int = 0) -> Layers:
        """The outermost `count` layers.

        Raises:
            LimitExceededError: they have too many vertices.
        """
        await self._hull.reached(min_revision)
        async with self._turn:
            recent = self._recent
            if recent is None or recent.counts.revision != self._hull.counts.revision or self._recent_count < count:
                recent = await self._peel(count)
        first = recent.layers[:count]
        found = Layers(recent.counts, first, None if recent.keys is None else recent.keys[:count])
        if found.vertex_count > MOST_LAYER_VERTICES:
            raise LimitExceededError("max_layer_vertices", MOST_LAYER_VERTICES)
        return found

    async def influence(self, min_revision: int = 0) -> tuple[Counts, Points, npt.NDArray[np.float64], Any]:
        """The vertices, the area that the hull loses without each, and their keys if the hull is keyed.

        Raises:
            LimitExceededError: the hull has too many vertices.
        """

        def influence(hull: AnyHull) -> tuple[Points, npt.NDArray[np.float64], VertexKeys | None]:
            vertices = hull.vertices()
            if len(vertices) > MOST_INFLUENCES:
                raise LimitExceededError("max_influence_vertices", MOST_INFLUENCES)
            return vertices, hull.influence(), _keys(hull, vertices)

        size = await self._size(min_revision)
        counts, found = await self._ask(influence, size > FEW_INFLUENCES)
        return counts, *found

    async def _peel(self, count: int) -> Layers:
        def peel(hull: AnyHull) -> tuple[list[Points], list[VertexKeys] | None]:
            layers = hull.layers(count)
            if not isinstance(hull, AnyKeyedHull):
                return layers, None
            return layers, [key_array(hull, hull.keys_at(layer)) for layer in layers]

        size = max(self._last_size, count * await self._size())
        counts, (layers, keys) = await self._ask(peel, size > BLOCK)
        peeled = self._with_arrays_of_recent(Layers(counts, layers, keys))
        self._last_size = peeled.vertex_count
        self._recent, self._recent_count = (peeled, count) if self._last_size <= MOST_KEPT else (None, 0)
        return peeled

    async def _size(self, min_revision: int = 0) -> int:
        """The number of vertices of the hull."""
        _, vertices = await self._hull.vertices(min_revision)
        return len(vertices)

    async def _ask(self, question: Callable[[AnyHull], T], large: bool) -> tuple[Counts, T]:
        """Ask the hull between two writes; if that would take long, or it is on the globe, a copy of it."""
        hull, points = self._hull, self._hull.counts.points
        if not large and (not hull.geographic or points <= FEW_INFLUENCES):
            # Layers may be larger than the hull, so the event loop does not wait for them.
            return await hull.read(lambda state: question(state.hull), BLOCK)
        await self._copies.acquire()
        # A caller that leaves ends only the wait: the copy is there, and counts, until the question is answered.
        asking = asyncio.ensure_future(self._ask_copy(question))
        asking.add_done_callback(self._asked_copy)
        return await asyncio.shield(asking)

    async def _ask_copy(self, question: Callable[[AnyHull], T]) -> tuple[Counts, T]:
        counts, copied = await self._hull.read(_copy, max(self._hull.counts.points, BLOCK))
        return counts, await self._run(partial(question, copied))

    def _asked_copy(self, asking: "asyncio.Future[Any]") -> None:
        self._copies.release()
        if not asking.cancelled():
            asking.exception()  # it is the caller's, who may have left

    def _with_arrays_of_recent(self, peeled: Layers) -> Layers:
        """The same layers, as the same array objects as before where they have not changed: watchers compare these."""
        if self._recent is None:
            return peeled
        layers = list(map(_kept, peeled.layers, _padded(self._recent.layers, len(peeled.layers))))
        keys = peeled.keys
        if keys is not None and self._recent.keys is not None:
            keys = list(map(_kept, keys, _padded(self._recent.keys, len(keys))))
        return Layers(peeled.counts, layers, keys)


def _copy(state: HullState) -> AnyHull:
    return state.hull.copy()


def _keys(hull: AnyHull, vertices: Points) -> VertexKeys | None:
    return key_array(hull, hull.keys_at(vertices)) if isinstance(hull, AnyKeyedHull) else None


def _padded(arrays: list[Any], count: int) -> list[Any]:
    return [*arrays, *[None] * count][:count]


def _kept(array: Any, before: Any) -> Any:
    return before if before is not None and np.array_equal(array, before) else array
