"""The difference between two lists of vertices, and between their keys."""

import asyncio
from collections import OrderedDict
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from ..state.hull_state import VertexKeys
from ..state.numbers import as_numbers
from .steps import Run

# Lists with at most this many vertices together are compared on the event loop.
FEW = 256
# The number of differences of one hull kept for further watchers, and the bytes of the vertices between which they are.
KEPT, KEPT_BYTES = 8, 32 * 2**20
# The approximate size of a key.
KEY_BYTES = 80

NO_ROWS = np.empty(0, np.intp)

_Lists = tuple[Points, Points, VertexKeys | None, VertexKeys | None]


@dataclass(frozen=True, slots=True)
class Difference:
    """The edit that makes the new list of vertices from the old one.

    Remove the rows at `removed`, move the first `rotation` of the remaining ones to the end, and insert the new rows so
    that they are at the positions `added`. Of the rows that remained, those at the positions `renamed` of the new list
    have another key than before.
    """

    removed: npt.NDArray[np.intp]
    added: npt.NDArray[np.intp]
    rotation: int
    renamed: npt.NDArray[np.intp]

    def __bool__(self) -> bool:
        """Whether there is a difference."""
        return bool(self.removed.size or self.added.size or self.renamed.size)


class Differences:
    """Computes each difference once for all watchers that request it.

    Args:
        run: calls a function in a thread.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._turn = asyncio.Lock()
        self._recent: OrderedDict[tuple[int, ...], tuple[_Lists, asyncio.Future[Difference]]] = OrderedDict()

    async def between(
        self, old: Points, new: Points, old_keys: VertexKeys | None = None, new_keys: VertexKeys | None = None
    ) -> Difference:
        """The difference from `old` to `new`."""
        lists = old, new, old_keys, new_keys
        if len(old) + len(new) <= FEW:
            return difference(*lists)
        # The entry holds the lists too, so that their ids are not reused.
        ids = tuple(map(id, lists))
        if ids not in self._recent:
            computing = asyncio.ensure_future(self._compute(lists))
            computing.add_done_callback(partial(self._computed, ids))
            self._recent[ids] = lists, computing
            self._forget()
        # A watcher that disconnects does not cancel the computation for the others.
        return await asyncio.shield(self._recent[ids][1])

    async def _compute(self, lists: _Lists) -> Difference:
        async with self._turn:  # each takes several times the memory of the vertices
            computed: Difference = await self._run(partial(difference, *lists))
        return computed

    def _forget(self) -> None:
        """Keep the newest, and those under way."""
        total = 0
        for number, (ids, (lists, computing)) in enumerate(reversed(list(self._recent.items()))):
            old, new, *keys = lists
            total += old.nbytes + new.nbytes + KEY_BYTES * sum(len(each) for each in keys if each is not None)
            if number and (number >= KEPT or total > KEPT_BYTES) and computing.done():
                del self._recent[ids]

    def _computed(self, ids: tuple[int, ...], computing: "asyncio.Future[Difference]") -> None:
        if computing.cancelled() or computing.exception() is not None:
            self._recent.pop(ids, None)  # let the next watcher try again
        self._forget()


def difference(
    old: Points, new: Points, old_keys: VertexKeys | None = None, new_keys: VertexKeys | None = None
) -> Difference:
    """The difference from the vertices `old` to the vertices `new`, both counter-clockwise. O(h log h).

    With `new_keys` but without `old_keys`, all vertices that remain are renamed.

    Vertices common to two convex polygons have the same cyclic order in both, so they differ by a rotation only.
    """
    before, after = as_numbers(old), as_numbers(new)
    kept, there = np.isin(before, after, assume_unique=True), np.isin(after, before, assume_unique=True)
    common = before[kept]
    rotation = int(np.argmax(common == after[there][0])) if len(common) else 0
    renamed = NO_ROWS  # as a rule: to turn the rows takes longer than all else
    if new_keys is not None and old_keys is not new_keys:
        renamed = _renamed(np.roll(np.flatnonzero(kept), -rotation), np.flatnonzero(there), old_keys, new_keys)
    return Difference(np.flatnonzero(~kept), np.flatnonzero(~there), rotation, renamed)


def _renamed(
    kept: npt.NDArray[np.intp], there: npt.NDArray[np.intp], old_keys: VertexKeys | None, new_keys: VertexKeys
) -> npt.NDArray[np.intp]:
    """The positions `there` whose new key is not the old one at the same row of `kept`."""
    if old_keys is None:
        return there
    renamed: npt.NDArray[np.intp] = there[old_keys[kept] != new_keys[there]]
    return renamed
