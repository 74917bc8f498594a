"""Loads the hulls of a storage, at the start or while another server still owns them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from ..state.core import Core
from ..state.dormant import Dormant, loaded
from ..state.hull_state import HullState
from ..state.records import HullRow, Kept
from ..state.trip import unsaved_of
from ..storage.port import FollowedStorage, Progress, Storage, StoredContents
from .driver import Driver

# Hulls that share queries of the storage.
READ_TOGETHER = 1000
# Seconds of loading between reports of the progress.
LOAD = 0.1


@dataclass(slots=True)
class _Loaded:
    """A hull that is loaded, and not yet in the core; `unsaved` is the number of points since its last snapshot."""

    row: HullRow
    state: HullState | Dormant
    unsaved: int


class Loader:
    """The hulls that are loaded, and not yet in a core.

    Args:
        driver: has the threads of the disk.
        storage: keeps the hulls.
    """

    def __init__(self, driver: Driver, storage: Storage) -> None:
        self._driver = driver
        self._storage = storage
        self._followed: FollowedStorage | None = None
        self._loaded: dict[int, _Loaded] = {}

    async def follow(self, storage: FollowedStorage, progress: Progress) -> None:
        """Load the hulls while another server owns them, or what has come since the last call."""
        self._followed = storage
        contents: StoredContents = await self._driver.on_disk(partial(storage.follow, progress))
        await self.load(contents, progress)

    async def load(self, contents: StoredContents, progress: Progress) -> None:
        """Load the hulls of the storage, or what has come since they were loaded."""
        rows = [row for row in contents.hulls if row.settings.shard is None]
        if self._loaded:
            for number in self._loaded.keys() - {row.number for row in rows}:
                del self._loaded[number]
            await self._driver.on_disk(self._catch_up)
        progress(len(self._loaded), len(rows))
        left = self._stored_hulls([row for row in rows if row.number not in self._loaded])
        while loaded := await self._driver.on_disk(partial(self._load_some, left)):
            self._loaded.update((each.row.number, each) for each in loaded)
            progress(len(self._loaded), len(rows))

    def restore(self, core: Core) -> None:
        """Move the hulls into a core."""
        for each in self._loaded.values():
            core.restore(each.row, each.state, each.unsaved)
        self._loaded.clear()

    def _catch_up(self) -> None:
        """Follow what has come since to the hulls that are loaded."""
        assert self._followed is not None  # otherwise none are
        now = self._driver.machine.clock.monotonic()
        for number, records in self._followed.read_since(
            {number: each.state.counts.revision for number, each in self._loaded.items()}
        ):
            hull = self._loaded[number]
            if isinstance(hull.state, Dormant):
                hull.state = hull.state.wake(hull.row.settings)
            hull.state.catch_up(records, now)
            hull.unsaved += sum(map(unsaved_of, records))

    def _stored_hulls(self, rows: Sequence[HullRow]) -> Iterator[tuple[HullRow, Kept]]:
        for first in range(0, len(rows), READ_TOGETHER):
            some = rows[first : first + READ_TOGETHER]
            yield from zip(some, self._storage.read_each([row.number for row in some]), strict=True)

    def _load_some(self, stored: Iterator[tuple[HullRow, Kept]]) -> list[_Loaded]:
        """Load the next hulls, for LOAD seconds: handing each to a thread takes longer than loading a small one.

        Returns none after the last.
        """
        clock = self._driver.machine.clock
        until = clock.monotonic() + LOAD
        found = []
        for row, kept in stored:
            now = clock.monotonic()
            state = loaded(self._driver.limits, row.settings, kept, now)
            found.append(_Loaded(row, state, sum(map(unsaved_of, kept.records))))
            if now > until:
                break
        return found
