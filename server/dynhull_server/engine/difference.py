"""The difference between two lists of vertices."""

import asyncio
from collections import OrderedDict
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from .steps import Run

# Lists with at most this many vertices together are compared on the event loop.
FEW = 256
# The number of differences of one hull kept for further watchers, and the bytes of the vertices between which they are.
KEPT, KEPT_BYTES = 8, 32 * 2**20


@dataclass(frozen=True, slots=True)
class Difference:
    """The edit that makes the new list of vertices from the old one.

    Remove the rows at `removed`, move the first `rotation` of the remaining ones to the end, and insert the new rows so
    that they are at the positions `added`.
    """

    removed: npt.NDArray[np.intp]
    added: npt.NDArray[np.intp]
    rotation: int


class Differences:
    """Computes each difference once for all watchers that request it.

    Args:
        run: calls a function in a thread.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._turn = asyncio.Lock()
        self._recent: OrderedDict[tuple[int, int], tuple[Points, Points, asyncio.Future[Difference]]] = OrderedDict()

    async def between(self, old: Points, new: Points) -> Difference:
        """The difference from `old` to `new`."""
        if len(old) + len(new) <= FEW:
            return difference(old, new)
        # The entry holds the arrays too, so that their ids are not reused.
        key = id(old), id(new)
        if key not in self._recent:
            computing = asyncio.ensure_future(self._compute(old, new))
            computing.add_done_callback(partial(self._computed, key))
            self._recent[key] = old, new, computing
            self._forget()
        # A watcher that disconnects does not cancel the computation for the others.
        return await asyncio.shield(self._recent[key][2])

    async def _compute(self, old: Points, new: Points) -> Difference:
        async with self._turn:  # each takes several times the memory of the vertices
            computed: Difference = await self._run(partial(difference, old, new))
        return computed

    def _forget(self) -> None:
        """Keep the newest, and those under way."""
        total = 0
        for number, (key, (old, new, computing)) in enumerate(reversed(list(self._recent.items()))):
            total += old.nbytes + new.nbytes
            if number and (number >= KEPT or total > KEPT_BYTES) and computing.done():
                del self._recent[key]

    def _computed(self, key: tuple[int, int], computing: "asyncio.Future[Difference]") -> None:
        if computing.cancelled() or computing.exception() is not None:
            self._recent.pop(key, None)  # let the next watcher try again
        self._forget()


def difference(old: Points, new: Points) -> Difference:
    """The difference from the vertices `old` to the vertices `new`, both counter-clockwise. O(h log h).

    Vertices common to two convex polygons have the same cyclic order in both, so they differ by a rotation only.
    """
    before, after = _as_numbers(old), _as_numbers(new)
    kept, there = np.isin(before, after, assume_unique=True), np.isin(after, before, assume_unique=True)
    common = before[kept]
    rotation = int(np.argmax(common == after[there][0])) if len(common) else 0
    return Difference(np.flatnonzero(~kept), np.flatnonzero(~there), rotation)


def _as_numbers(vertices: Points) -> npt.NDArray[np.complex128]:
    """One complex number per vertex, because numpy sorts and compares only scalars."""
    return np.ascontiguousarray(vertices).view(np.complex128).ravel()
