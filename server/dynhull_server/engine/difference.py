"""How one list of vertices becomes another."""

import asyncio
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

# Lists of so many vertices together are compared at once, on the event loop.
FEW = 256
# Differences of one hull that are kept for the next watcher.
KEPT = 8


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

    def __init__(self, run: Callable[[Callable[[], Any]], Awaitable[Any]]) -> None:
        self._run = run
        self._recent: OrderedDict[tuple[int, int], tuple[Points, Points, asyncio.Future[Difference]]] = OrderedDict()

    async def between(self, old: Points, new: Points) -> Difference:
        """How to make `new` of `old`."""
        if len(old) + len(new) <= FEW:
            return difference(old, new)
        # The arrays are kept beside the result, so that their ids stay theirs.
        key = id(old), id(new)
        if key not in self._recent:
            computing = asyncio.ensure_future(self._run(partial(difference, old, new)))
            computing.add_done_callback(partial(self._computed, key))
            self._recent[key] = old, new, computing
            if len(self._recent) > KEPT:
                self._recent.popitem(last=False)
        # A watcher that leaves does not take the result away from the others.
        return await asyncio.shield(self._recent[key][2])

    def _computed(self, key: tuple[int, int], computing: "asyncio.Future[Difference]") -> None:
        if computing.cancelled() or computing.exception() is not None:
            self._recent.pop(key, None)  # the next watcher may have more luck


def difference(old: Points, new: Points) -> Difference:
    """How to make the vertices `new` from the vertices `old`, both counter-clockwise. O(h).

    Vertices common to two convex polygons stand in the same cyclic order on both, so a rotation is all they need.
    """
    old_points, new_points = _points(old), _points(new)
    common = set(old_points).intersection(new_points)
    kept = [p for p in old_points if p in common]
    first = next((p for p in new_points if p in common), None)
    rotation = 0 if first is None else kept.index(first)
    return Difference(_positions_outside(old_points, common), _positions_outside(new_points, common), rotation)


def _points(vertices: Points) -> list[tuple[Any, ...]]:
    return list(map(tuple, vertices.tolist()))


def _positions_outside(points: list[tuple[Any, ...]], common: set[tuple[Any, ...]]) -> npt.NDArray[np.intp]:
    return np.array([i for i, p in enumerate(points) if p not in common], np.intp)
