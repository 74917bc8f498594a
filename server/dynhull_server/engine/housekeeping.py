"""Background work on the storage: snapshots, which shorten a restart; checkpoints, syncs and sweeps."""

from ..state.errors import HullNotFoundError
from ..storage.port import Storage
from .division import Divisions, StoredShard
from .driver import Driver
from .hulls import Hulls

# So many times the points that make a snapshot due are between the last two when another one does not wait for more.
BURST = 2


class Housekeeping:
    """The parts of the work, each called periodically by the supervisor."""

    CHECKPOINT_SECONDS = 0.25
    SNAPSHOT_SECONDS = 1.0
    SWEEP_SECONDS = 5.0

    def __init__(self, driver: Driver, hulls: Hulls, storage: Storage, divisions: Divisions | None) -> None:
        self._driver = driver
        self._hulls = hulls
        self._storage = storage
        self._divisions = divisions

    async def checkpoint(self) -> None:
        """Checkpoint the storage."""
        await self._driver.on_disk(self._storage.checkpoint)

    async def sync(self) -> None:
        """Make the commits so far durable."""
        await self._driver.on_disk(self._storage.sync)

    async def sweep(self) -> None:
        """Remove the data of deleted hulls."""
        await self._driver.commit_steps(self._storage.sweep(), self._driver.on_disk)

    async def snapshots(self, least_points: int) -> None:
        """Write a snapshot of every hull that needs one, one after another.

        A hull needs one when the batches since its last snapshot have at least as many points as the hull itself, and
        at least `least_points`. What comes between two snapshots goes into a segment after the later one: where it is
        BURST times as much, because batches came faster than snapshots, the next one does not wait for more batches.
        """
        failure: Exception | None = None
        for hull in list(self._driver.core.hulls.values()):
            if hull.unsaved < least_points and not hull.row.settings.history:
                continue
            try:
                live = self._hulls.of(hull)
                least = max(least_points, live.size)
                if live.unsaved >= least or (live.settings.history and live.between >= BURST * least):
                    await self._hulls.filing.snapshot(live)
            except HullNotFoundError:
                continue
            except Exception as error:  # go on with the other hulls
                failure = failure or error
        for shard in () if self._divisions is None else self._divisions.shards():
            if shard.unsaved < max(least_points, shard.points):
                continue
            try:
                await self._snapshot_of_shard(shard)
            except Exception as error:  # likewise
                failure = failure or error
        if failure is not None:
            raise failure

    async def _snapshot_of_shard(self, shard: StoredShard) -> None:
        taken = shard.take()
        if taken is not None:
            kept, unsaved = taken
            await self._driver.commit_steps(self._storage.snapshot(shard.number, kept), self._driver.on_disk)
            shard.saved(unsaved)
