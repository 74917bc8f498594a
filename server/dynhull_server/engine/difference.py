"""How one list of vertices becomes another."""

import asyncio
from collections import OrderedDict
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from .steps import Run

# Lists of so many vertices together are compared at once, on the event loop.
FEW = 256
# Differences of one hull that are kept for the next watcher, and bytes of the vertices they are between.
KEPT, KEPT_BYTES = 8, 32 * 2**20


@dataclass(frozen=True, slots=True)
class Difference:
    """How to make one list of vertices from another.

    Strike the rows at `removed`, move the first `rotation` of the rest to the end, put in the rows that stand at
    `added` in the new list.
    """

    removed: npt.NDArray[np.intp]
    added: npt.NDArray[np.intp]
    rotation: int


class Differences:
    """Differences that many watchers want: each is computed once.

    Args:
        run: calls a function in a thread.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._turn = asyncio.Lock()
        self._recent: OrderedDict[tuple[int, int], tuple[Points, Points, asyncio.Future[Difference]]] = OrderedDict()

    async def between(self, old: Points, new: Points) -> Difference:
        """How to make `new` of `old`."""
        if len(old) + len(new) <= FEW:
            return difference(old, new)
        # The arrays are kept beside the result, so that their ids stay theirs.
        key = id(old), id(new)
        if key not in self._recent:
            computing = asyncio.ensure_future(self._compute(old, new))
            computing.add_done_callback(partial(self._computed, key))
            self._recent[key] = old, new, computing
            self._forget()
        # A watcher that leaves does not take the result away from the others.
        return await asyncio.shield(self._recent[key][2])

    async def _compute(self, old: Points, new: Points) -> Difference:
        async with self._turn:  # each takes several times the memory of the vertices
            computed: Difference = await self._run(partial(difference, old, new))
        return computed

    def _forget(self) -> None:
        """Keep the newest."""
        total = 0
        for number, (key, (old, new, computing)) in enumerate(reversed(list(self._recent.items()))):
            total += old.nbytes + new.nbytes
            if number and (number >= KEPT or total > KEPT_BYTES) and computing.done():
                del self._recent[key]

    def _computed(self, key: tuple[int, int], computing: "asyncio.Future[Difference]") -> None:
        if computing.cancelled() or computing.exception() is not None:
            self._recent.pop(key, None)  # the next watcher may have more luck


def difference(old: Points, new: Points) -> Difference:
    """How to make the vertices `new` from the vertices `old`, both counter-clockwise. O(h log h), without the GIL.

    Vertices common to two convex polygons stand in the same cyclic order on both, so a rotation is all they need.
    """
    before, after = _as_numbers(old), _as_numbers(new)
    kept, there = np.isin(before, after, assume_unique=True), np.isin(after, before, assume_unique=True)
    common = before[kept]
    rotation = int(np.argmax(common == after[there][0])) if len(common) else 0
    return Difference(np.flatnonzero(~kept), np.flatnonzero(~there), rotation)


def _as_numbers(vertices: Points) -> npt.NDArray[np.complex128]:
    """A number for each vertex, as numpy sorts and compares numbers alone at once."""
    return np.ascontiguousarray(vertices).view(np.complex128).ravel()
