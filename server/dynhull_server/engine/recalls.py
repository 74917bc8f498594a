"""Vertices at earlier revisions, from the storage; concurrent requests share one read of the disk."""

import asyncio
from collections import defaultdict
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from dynhull.arrays import Points

from ..state.errors import HullNotFoundError, NotStoredError, RefusedError, RevisionForgottenError
from ..state.hull import Hull
from ..state.hull_state import replay, replayed
from ..state.records import Kept
from ..storage.port import DamagedError, Storage, StorageError

Answer = Points | RefusedError
# The errors of a read when the machine has run out of a resource.
UNREADABLE = (StorageError, OSError, MemoryError)


class Recalls:
    """Reads the vertices of hulls at earlier revisions.

    The disk is read for one hull at a time, once for all revisions requested of it: a hundred watchers that resume
    after a restart cost as much time and memory as one.

    Args:
        storage: keeps the hulls.
        run: calls a function in a thread.
    """

    def __init__(self, storage: Storage, run: Callable[[Callable[[], Any]], Awaitable[Any]]) -> None:
        self._storage = storage
        self._run = run
        self._wanted: dict[Hull, dict[int, asyncio.Future[Points]]] = defaultdict(dict)
        self._reading: asyncio.Task[None] | None = None

    async def vertices(self, hull: Hull, revision: int) -> Points:
        """The vertices at a past revision.

        Raises:
            RevisionForgottenError: the storage no longer has that revision.
            NotStoredError: the storage cannot be read.
        """
        wanted = self._wanted[hull]
        if revision not in wanted:
            wanted[revision] = asyncio.get_running_loop().create_future()
            wanted[revision].add_done_callback(_retrieve)
        if self._reading is None or self._reading.done():
            self._reading = asyncio.get_running_loop().create_task(self._read())
        # A watcher that disconnects does not cancel the read for the others.
        return await asyncio.shield(wanted[revision])

    async def _read(self) -> None:
        while self._wanted:
            hull, wanted = next(iter(self._wanted.items()))
            del self._wanted[hull]
            try:
                answers = await self._run(partial(self._recall, hull, sorted(wanted)))
            except Exception as error:
                refusal = NotStoredError(str(error)) if isinstance(error, UNREADABLE) else error
                answers = dict.fromkeys(wanted, refusal)
            except BaseException:
                for future in wanted.values():
                    future.cancel()
                raise
            for revision, future in wanted.items():
                answer = answers[revision]
                if isinstance(answer, Exception):
                    future.set_exception(answer)
                else:
                    future.set_result(answer)

    def _recall(self, hull: Hull, revisions: list[int]) -> dict[int, Answer]:
        """The vertices at some revisions, given in ascending order, or the error for each."""
        try:
            return self._recalled(hull, revisions)
        except KeyError:  # deleted meanwhile
            return dict.fromkeys(revisions, HullNotFoundError(hull.name))

    def _recalled(self, hull: Hull, revisions: list[int]) -> dict[int, Answer]:
        answers: dict[int, Answer] = {}
        left = revisions
        while left:
            try:
                kept = self._storage.read(hull.row.number, left[-1])
            except StorageError:
                if left[-1] >= self._storage.oldest(hull.row.number):
                    raise
                kept = None  # trimmed
            oldest = self._storage.oldest(hull.row.number)
            covered = [] if kept is None else [revision for revision in left if revision >= kept.revision]
            if kept is None or not covered or left[-1] < oldest:
                newest = hull.counts.revision
                return answers | {revision: RevisionForgottenError(revision, oldest, newest) for revision in left}
            if kept.last_revision != left[-1]:
                raise DamagedError(f"revision {left[-1]} of {hull.name} is missing from the storage")
            answers |= _vertices_at(kept, covered)
            left = left[: -len(covered)]
        return answers


def _vertices_at(kept: Kept, revisions: list[int]) -> dict[int, Answer]:
    live = replayed(Kept(kept.revision, kept.points, {}, []))
    vertices: dict[int, Answer] = {}
    position = 0
    for revision in revisions:
        end = revision - kept.revision
        replay(live, kept.records[position:end])
        position = end
        vertices[revision] = live.vertices()
    return vertices


def _retrieve(future: "asyncio.Future[Points]") -> None:
    """Retrieve the exception: if all watchers have disconnected, asyncio shall not log it as never retrieved."""
    if not future.cancelled():
        future.exception()
