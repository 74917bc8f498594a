"""Snapshots of hulls; what the journal drops behind them becomes segments; and what is erased from these."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from weakref import WeakValueDictionary

import numpy as np

from dynhull.keys import key_list

from ..state.contents.keyed import Keyed
from ..state.core import not_stored
from ..state.errors import (
    HullNotFoundError,
    HullUnsuitableError,
    NotStoredError,
    OutcomeUnknownError,
    RefusedError,
    words_for_callers,
)
from ..state.hull import Hull
from ..state.hull_state import HullState
from ..state.records import Kept, Keys
from ..storage.past import EraseRequest, Erasure
from ..storage.port import NotCommittedError, Storage
from .driver import Driver
from .live_hull import LiveHull
from .outliving import Outliving
from .past import PastHulls
from .recalls import UNREADABLE, past_refusal

# The journal keeps what is after the older of two snapshots.
SNAPSHOTS = 2
# Half of the time segments are written, if there is so much to write: most of it goes on beside the interpreter, and
# what the journal must keep meanwhile is not to grow without end.
PAUSE = 1.0


@dataclass(frozen=True, eq=False)
class _Asked:
    """An erasure that somebody waits for, unless they have gone away."""

    request: EraseRequest
    answer: "asyncio.Future[Erasure | None]"

    def reply(self) -> None:
        if not self.answer.done():
            self.answer.set_result(self.request.erased)

    def refuse(self, error: Exception) -> None:
        if not self.answer.done():
            self.answer.set_exception(error)


class Filing:
    """The segments of the hulls of a server, which one at a time writes.

    Args:
        driver: has the threads, and commits.
        storage: keeps them.
        pasts: reads them.

    Attributes:
        unsure: hulls of which it is not known whether their settings have been changed as was asked.
    """

    SECONDS = 1.0

    def __init__(self, driver: Driver, storage: Storage, pasts: PastHulls) -> None:
        self._driver = driver
        self._storage = storage
        self._pasts = pasts
        self._turn = asyncio.Lock()
        self._erasing = Outliving()
        self._snapshots: WeakValueDictionary[int, asyncio.Lock] = WeakValueDictionary()  # of each hull, one at a time
        self._asked: dict[int, list[_Asked]] = {}  # of each hull, what waits for the turn
        self.unsure: set[Hull] = set()

    async def round(self) -> None:
        """Make segments of what the journal need not have any longer, and remove those that are not to be kept."""
        async with self._turn:
            # By the time that commits have: what is kept has it, and it may be ahead of the server's after a restart.
            steps = self._storage.file_history(self._driver.commit_time())
            await self._driver.commit_steps(steps, self._driver.in_history, PAUSE)
        for hull in list(self.unsure):
            with suppress(KeyError):
                await self.take_settings(hull)
            self.unsure.discard(hull)

    async def take_settings(self, hull: Hull) -> None:
        """Take the settings of a hull from the storage, or raise KeyError: it was deleted meanwhile."""
        row = await self._driver.on_disk(partial(self._storage.row, hull.row.number))
        if row is None:
            raise KeyError(hull.name)
        hull.row = row

    async def erase(self, hull: LiveHull, keys: Keys) -> Erasure | None:
        """Erase keys from the past of a hull. None if it has none of them. What has begun goes on without its caller.

        All that wait for the same hull are carried out together, since each segment is read and written once for that:
        each as if those before it had been alone, and all in one commit.

        What the journal has is filed first, so that it has nothing of them any more. The journal of a hull without a
        history forgets all of its past.

        Raises:
            HullNotFoundError: the hull was deleted meanwhile.
            HullUnsuitableError: the hull has one of the keys at present, or keeps its newest ones, or nothing of its
                past is kept.
            NotStoredError: the storage has failed, and the past has the keys, as before.
            PastDamagedError: a segment is damaged, and the past has the keys, as before.
            OutcomeUnknownError: it has failed, and perhaps they are erased.
        """
        if not self._storage.keeps:
            raise HullUnsuitableError(hull.name, "has no past: this server keeps no batches")
        if hull.settings.divided:
            raise HullUnsuitableError(hull.name, "is divided among shards, and has no past")
        window = hull.settings.window
        if window is not None and window.max_points:
            reason = f"keeps its {window.max_points} newest: those that a key has pushed out would seem to have stayed"
            raise HullUnsuitableError(hull.name, f"{reason}. Shorten its history instead", field="keys")
        asked = _Asked(EraseRequest(keys), asyncio.get_running_loop().create_future())
        waiting = self._asked.setdefault(hull.number, [])
        waiting.append(asked)
        if len(waiting) == 1:
            self._erasing.begin(self._erase_asked(hull))
        return await asked.answer

    async def _erase_asked(self, hull: LiveHull) -> None:
        """Carry out together what waits for the turn, and answer it."""
        async with self._turn:
            # Who has gone away by now has asked for nothing.
            asked = [each for each in self._asked.pop(hull.number) if not each.answer.done()]
            try:
                if asked:
                    await self._erase_together(hull, asked)
            except Exception as error:
                for each in asked:
                    each.refuse(error)

    async def snapshot(self, hull: LiveHull) -> None:
        """Write a snapshot of a hull as it is."""
        async with self._turn_of_snapshots(hull):
            unsaved = hull.unsaved
            _, kept = await hull.read(lambda state: state.kept(), rows=hull.counts.points)
            await self._write_snapshot(hull, kept)
            hull.saved(unsaved)

    def _turn_of_snapshots(self, hull: LiveHull) -> asyncio.Lock:
        return self._snapshots.setdefault(hull.number, asyncio.Lock())

    async def _write_snapshot(self, hull: LiveHull, kept: Kept) -> None:
        await self._driver.commit_steps(self._storage.snapshot(hull.number, kept), self._driver.on_disk)

    async def _erase_together(self, hull: LiveHull, asked: list["_Asked"]) -> None:
        async with self._turn_of_snapshots(hull):  # one that is under way may be of a revision with the keys
            unsaved = hull.unsaved
            keys = [each.request.keys for each in asked]
            _, (kept, present) = await hull.read(partial(_kept, keys), rows=hull.counts.points)
            for each, key in zip(asked, present, strict=True):
                if key is not None:
                    reason = f"has the key {key!r} now: remove it first, since what is erased is the past"
                    each.refuse(HullUnsuitableError(hull.name, reason, field="keys"))
            if kept is None:
                return
            with _as_answers(hull):
                for _ in range(SNAPSHOTS):
                    await self._write_snapshot(hull, kept)
            hull.saved(unsaved)
        left = [each for each, key in zip(asked, present, strict=True) if key is None]
        await self._erase_past(hull, kept.revision, [each.request for each in left])
        for each in left:
            each.reply()

    async def _erase_past(self, hull: LiveHull, until: int, requests: list[EraseRequest]) -> None:
        try:
            with _as_answers(hull):
                steps = self._storage.erase(hull.number, requests, until, self._driver.commit_time())
                await self._driver.commit_steps(steps, self._driver.in_history, PAUSE)
                gone = await self._driver.on_disk(partial(self._storage.row, hull.number)) is None
        except (RefusedError, OutcomeUnknownError) as error:
            if not any(each.erased for each in requests):
                raise
            gone = False
            self._driver.supervisor.failed("history", error)  # the next round does what is left, once it is erased
        finally:
            self._pasts.forget()
        if gone:
            raise HullNotFoundError(hull.name)


@contextmanager
def _as_answers(hull: LiveHull) -> Iterator[None]:
    """Convert errors of the storage to what callers get."""
    try:
        yield
    except KeyError:
        raise HullNotFoundError(hull.name) from None
    except NotStoredError:
        raise
    except NotCommittedError as error:
        raise not_stored(error) from error
    except UNREADABLE as error:
        raise past_refusal(error) from error
    except Exception as error:
        raise OutcomeUnknownError(words_for_callers(error)) from error


def _kept(requests: list[Keys], state: HullState) -> tuple[Kept | None, list[int | str | None]]:
    """The hull as it is, and of each request the first of its keys that it has, also in quarantine, None for none.

    None for the hull if there is no request without one.
    """
    present = [_present(keys, state) for keys in requests]
    return state.kept() if None in present else None, present


def _present(keys: Keys, state: HullState) -> int | str | None:
    contents = state.contents
    assert isinstance(contents, Keyed)  # the keys are those of such a hull
    listed = key_list(keys)
    for place in np.flatnonzero(contents.find(keys).present).tolist():
        return listed[place]  # type: ignore[no-any-return]
    if contents.quarantine is not None:
        for key in listed:
            if key in contents.quarantine:
                return key  # type: ignore[no-any-return]
    return None
