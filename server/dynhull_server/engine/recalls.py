"""Vertices at earlier revisions, from the storage; concurrent requests share one read of the disk."""

import asyncio
from collections import defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from dynhull.arrays import Points

from ..state.contents import replayed
from ..state.errors import (
    HullNotFoundError,
    NotStoredError,
    PastDamagedError,
    RevisionForgottenError,
    words_for_callers,
)
from ..state.hull import Hull
from ..state.records import HullSettings, Kept
from ..storage.port import DamagedError, Storage, StorageError

Answer = Points | Exception
# The errors of a read when the machine has run out of a resource.
UNREADABLE = (StorageError, OSError, MemoryError)


def past_refusal(error: Exception) -> NotStoredError:
    """What callers get for a past that cannot be read; only what is not damaged may be asked for again."""
    kind = PastDamagedError if isinstance(error, DamagedError) else NotStoredError
    return kind(words_for_callers(error))


# Bytes of vertices that callers hold at a time, about: further revisions are read after these.
MOST_BYTES = 64 * 2**20


@dataclass(slots=True, eq=False)
class _Recall:
    """One revision: the callers that wait for it or hold its vertices, and how many bytes these take."""

    future: "asyncio.Future[Points]"
    callers: int = 0
    bytes: int = 0


class Recalls:
    """Reads the vertices of hulls at earlier revisions.

    The disk is read for one hull at a time, once for all revisions requested of it, as far as their vertices fit in
    MOST_BYTES: a hundred watchers that resume after a restart cost about as much as one.

    Args:
        storage: keeps the hulls.
        run: calls a function in a thread.
    """

    def __init__(self, storage: Storage, run: Callable[[Callable[[], Any]], Awaitable[Any]]) -> None:
        self._storage = storage
        self._run = run
        self._wanted: dict[Hull, dict[int, _Recall]] = defaultdict(dict)
        self._reading: asyncio.Task[None] | None = None
        self._held = 0
        self._room = asyncio.Event()

    @asynccontextmanager
    async def vertices(self, hull: Hull, revision: int) -> AsyncIterator[Points]:
        """The vertices at a past revision. Callers hold them no longer than the context.

        Raises:
            RevisionForgottenError: the storage no longer has that revision.
            NotStoredError: the storage cannot be read.
        """
        recall = self._wanted[hull].get(revision)
        if recall is None:
            recall = self._wanted[hull][revision] = _Recall(asyncio.get_running_loop().create_future())
            recall.future.add_done_callback(_retrieve)
        if self._reading is None or self._reading.done():
            self._reading = asyncio.get_running_loop().create_task(self._read())
        recall.callers += 1
        try:
            # A watcher that disconnects does not cancel the read for the others.
            yield await asyncio.shield(recall.future)
        finally:
            recall.callers -= 1
            if not recall.callers:
                self._held -= recall.bytes
                recall.bytes = 0
                self._room.set()

    async def _read(self) -> None:
        while self._wanted:
            hull, wanted = next(iter(self._wanted.items()))
            try:
                answers = await self._answers(hull, sorted(wanted))
            except BaseException:
                for recall in self._wanted.pop(hull).values():
                    recall.future.cancel()
                raise
            for revision, answer in answers.items():
                self._deliver(wanted.pop(revision), answer)
            del self._wanted[hull]
            if wanted:  # after the other hulls
                self._wanted[hull] = wanted
            while self._held >= MOST_BYTES:
                self._room.clear()
                await self._room.wait()

    async def _answers(self, hull: Hull, revisions: list[int]) -> dict[int, Answer]:
        try:
            answers: dict[int, Answer] = await self._run(partial(self._recall, hull, revisions))
        except Exception as error:
            refusal = NotStoredError(words_for_callers(error)) if isinstance(error, UNREADABLE) else error
            return dict.fromkeys(revisions, refusal)
        return answers

    def _deliver(self, recall: _Recall, answer: Answer) -> None:
        if isinstance(answer, Exception):
            recall.future.set_exception(answer)
            return
        recall.future.set_result(answer)
        if recall.callers:
            recall.bytes = answer.nbytes
            self._held += answer.nbytes

    def _recall(self, hull: Hull, revisions: list[int]) -> dict[int, Answer]:
        """The vertices at some revisions, given in ascending order, or the error for each; as many as fit."""
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
            found = _vertices_at(hull.row.settings, kept, covered)
            answers |= found
            if len(found) < len(covered):
                return answers
            left = left[: -len(covered)]
        return answers


def _vertices_at(settings: HullSettings, kept: Kept, revisions: list[int]) -> dict[int, Points]:
    """The vertices at the first of some revisions, as many as there is room for."""
    contents = replayed(replace(kept, records=[]), settings)
    found: dict[int, Points] = {}
    position = total = 0
    for revision in revisions:
        end = revision - kept.revision
        contents.replay(kept.records[position:end])
        position = end
        found[revision] = contents.hull.vertices()
        total += found[revision].nbytes
        if total >= MOST_BYTES:
            break
    return found


def _retrieve(future: "asyncio.Future[Points]") -> None:
    """Retrieve the exception: if all watchers have disconnected, asyncio shall not log it as never retrieved."""
    if not future.cancelled():
        future.exception()
