"""What the journal drops becomes segments; and what is erased from them."""

import asyncio
from contextlib import suppress
from functools import partial

import numpy as np

from dynhull.keys import key_list

from ..state.contents.keyed import Keyed
from ..state.core import not_stored
from ..state.errors import (
    HullNotFoundError,
    HullUnsuitableError,
    NotStoredError,
    OutcomeUnknownError,
    words_for_callers,
)
from ..state.hull import Hull
from ..state.hull_state import HullState
from ..state.records import Kept, Keys
from ..storage.past import Erasure
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
        await self._turn.acquire()  # who goes away before has asked for nothing: their keys would keep others waiting
        return await self._erasing.run(self._erase(hull, keys))

    async def _erase(self, hull: LiveHull, keys: Keys) -> Erasure | None:
        """Erase keys, and end the turn."""
        try:
            return await self._erase_in_turn(hull, keys)
        finally:
            self._turn.release()

    async def _erase_in_turn(self, hull: LiveHull, keys: Keys) -> Erasure | None:
        unsaved = hull.unsaved
        _, found = await hull.read(partial(_without, keys), rows=hull.counts.points)
        if not isinstance(found, Kept):
            reason = f"has the key {found!r} now: remove it first, since what is erased is the past"
            raise HullUnsuitableError(hull.name, reason, field="keys")
        try:
            for _ in range(SNAPSHOTS):
                steps = self._storage.snapshot(hull.number, found)
                await self._driver.commit_steps(steps, self._driver.on_disk)
            hull.saved(unsaved)
            before = await self._erasures(hull)
            steps = self._storage.erase(hull.number, keys, found.revision, self._driver.commit_time())
            await self._driver.commit_steps(steps, self._driver.in_history)
            after = await self._erasures(hull)
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
        finally:
            self._pasts.forget()
        return next((each for each in after if each not in before), None)

    async def _erasures(self, hull: LiveHull) -> tuple[Erasure, ...]:
        found: tuple[Erasure, ...] = await self._driver.on_disk(partial(self._storage.erasures, hull.number))
        return found


def _without(keys: Keys, state: HullState) -> Kept | int | str:
    """The hull as it is; or the first of some keys that it has, also in quarantine."""
    contents = state.contents
    assert isinstance(contents, Keyed)  # the keys are those of such a hull
    listed = key_list(keys)
    for place in np.flatnonzero(contents.find(keys).present).tolist():
        return listed[place]  # type: ignore[no-any-return]
    if contents.quarantine is not None:
        for key in listed:
            if key in contents.quarantine:
                return key  # type: ignore[no-any-return]
    return state.kept()
