"""Assembles what serves hulls: a driver with its core, the hulls and fences above it, and their background work."""

import asyncio
from functools import partial

from ..garbage import without_collections
from ..state.core import Core
from ..state.limits import Limits
from ..state.records import CommitStamp
from ..storage.port import FollowedStorage, Progress, Storage, StorageError, StoredContents
from .alarms import Alarms
from .division import Divisions
from .driver import Driver
from .fence_keeping import FenceKeeping
from .fences import Fences
from .housekeeping import Housekeeping
from .hulls import Hulls
from .loading import Loader
from .past_fences import PastFences
from .positions import incarnation_of
from .resting import Resting
from .series import LOOK_SECONDS
from .shard_store import ShardStore
from .supervisor import Supervisor
from .threads import Machine


class Engine:
    """Hulls and fences in memory and in a storage, from `start` to `close`. Use it from one event loop.

    Only what assembles a server holds it: everything else takes the parts that it needs.

    Args:
        limits: the limits on the state.
        storage: keeps the hulls.
        supervisor: receives all failures in the background.
        machine: time, threads and random names.
        divisions: runs hulls over shards; None for a server that has none.

    Attributes:
        driver: drives the core.
        hulls: the hulls.
        fences: the fences.
        past_fences: what fences would have made of the past.
        alarms: the alarms.
    """

    def __init__(
        self,
        limits: Limits,
        storage: Storage,
        supervisor: Supervisor,
        machine: Machine,
        divisions: Divisions | None = None,
    ) -> None:
        self.driver = Driver(limits, storage, supervisor, machine)
        self.fences = Fences(self.driver, storage)
        self.alarms = Alarms(self.driver, self.fences)
        self.hulls = Hulls(self.driver, storage, self.fences, divisions)
        self.past_fences = PastFences(self.driver, self.hulls, storage, self.fences)
        self._storage = storage
        self._divisions = divisions
        self._loader = Loader(self.driver, storage)
        self._opened = self._started = False

    async def read_ahead(self, storage: FollowedStorage, progress: Progress) -> None:
        """Load the hulls while another server owns them; again to load what has come since, before `start`.

        Args:
            storage: the storage of the engine.
            progress: called with the amount read so far and the total; what it raises ends this.

        Raises:
            StorageError: the storage cannot be used; only `close` may follow, as after any other error.
        """
        self.driver.begin()
        self._opened = True
        await self._loader.follow(storage, progress)

    async def start(self, progress: Progress) -> list[str]:
        """Load the hulls of the storage. Returns messages about what was lost or repaired there.

        Args:
            progress: called with the amount read so far and the total.

        Raises:
            StorageError: the storage cannot be used.
        """
        driver, storage = self.driver, self._storage
        driver.begin()
        with without_collections():
            contents: StoredContents = await driver.on_disk(partial(self._open, progress))
            driver.core = Core(
                driver.limits,
                contents.next_number,
                driver.machine.clock.monotonic(),
                immediate=storage.immediate,
                keeps=storage.keeps,
            )
            await self._loader.load(contents, progress)
            self._loader.restore(driver.core)
        await driver.in_turn(partial(self._restore_fences, contents))
        self.hulls.feed_consumers.restore(await driver.on_disk(storage.feed_consumers))
        if storage.keeps:
            self.hulls.restored(incarnation_of(contents.hulls))
        driver.start(self.hulls, self.fences, CommitStamp(contents.commits, contents.committed))
        self._started = True
        keeping = FenceKeeping(driver, self.fences, storage)
        driver.supervisor.every(keeping.SECONDS, "fences", keeping.round)
        shards = [row for row in contents.hulls if row.settings.shard is not None]
        roots = [hull for hull in driver.core.hulls.values() if hull.divided]
        if self._divisions is not None:
            await self._divisions.start(driver, ShardStore(driver, storage), shards, roots)
        elif shards or roots:
            raise StorageError("the storage has hulls over shards: start the server with `dynhull serve`")
        return contents.notes

    def _open(self, progress: Progress) -> StoredContents:
        contents = self._storage.open(progress)
        self._opened = True
        return contents

    def _restore_fences(self, contents: StoredContents) -> None:
        kept = self._storage.read_fences([row.number for row in contents.fences])
        self.driver.core.restore_fences([each for each in kept if each is not None])

    def keep_house(self, snapshot_points: int, sync_seconds: float | None) -> None:
        """Begin the background work on the storage.

        Args:
            snapshot_points: the least number of points in batches that makes a snapshot due.
            sync_seconds: the interval at which commits are made durable; None where each commit is.
        """
        house = Housekeeping(self.driver, self.hulls, self._storage, self._divisions)
        every = self.driver.supervisor.every
        every(house.CHECKPOINT_SECONDS, "checkpoint", house.checkpoint)
        every(house.SNAPSHOT_SECONDS, "snapshots", partial(house.snapshots, snapshot_points))
        every(house.SWEEP_SECONDS, "sweep", house.sweep)
        every(self.hulls.filing.SECONDS, "history", self.hulls.filing.round)
        if sync_seconds is not None:
            every(sync_seconds, "sync", house.sync)

    def let_rest(self) -> None:
        """Begin to put away the points of hulls that nobody uses."""
        resting = Resting(lambda: self.driver.core.hulls.values())
        self.driver.supervisor.every(resting.SECONDS, "rest", resting.round)

    def keep_series(self, seconds: float, most: int) -> None:
        """Begin to keep measures of hulls for so many seconds, in at most so many bytes."""
        self.hulls.series.begin(seconds, most)
        self.driver.supervisor.every(LOOK_SECONDS, "series", self.hulls.series.round)

    async def close(self) -> None:
        """Complete the trips in progress, refuse the waiting requests, and close the storage."""
        if self._started:
            if self._divisions is not None:
                await self._divisions.close()
            await self.driver.stop()
        await asyncio.to_thread(self._join)

    def _join(self) -> None:
        self.driver.join()
        if self._opened:
            self._storage.close()
