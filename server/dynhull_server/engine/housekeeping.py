"""Background work on the storage: snapshots, which shorten a restart; checkpoints, syncs and sweeps."""

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

from ..state.errors import HullNotFoundError
from ..storage.port import Storage
from .threads import Clock

if TYPE_CHECKING:
    from .division import StoredShard
    from .engine import Engine
    from .live_hull import LiveHull

# Batches have priority on the disk: each step of a snapshot or sweep is followed by a pause of this many times its
# duration.
PAUSE_FACTOR = 4.0


class Housekeeping:
    """The parts of the work, each called periodically by the supervisor."""

    CHECKPOINT_SECONDS = 0.25
    SNAPSHOT_SECONDS = 1.0
    SWEEP_SECONDS = 5.0

    def __init__(self, engine: "Engine", storage: Storage, clock: Clock) -> None:
        self._engine = engine
        self._storage = storage
        self._clock = clock

    async def checkpoint(self) -> None:
        """Checkpoint the storage."""
        await self._engine.run(self._engine.disk, self._storage.checkpoint)

    async def sync(self) -> None:
        """Make the commits so far durable."""
        await self._engine.run(self._engine.disk, self._storage.sync)

    async def sweep(self) -> None:
        """Remove the data of deleted hulls."""
        await self._carry_out(self._storage.sweep())

    async def snapshots(self, least_points: int) -> None:
        """Write a snapshot of every hull that needs one, one after another.

        A hull needs one when the batches since its last snapshot have at least as many points as the hull itself, and
        at least `least_points`.
        """
        failure: Exception | None = None
        for hull in self._engine:
            if hull.unsaved < max(least_points, hull.size):
                continue
            try:
                await self._snapshot(hull)
            except HullNotFoundError:
                continue
            except Exception as error:  # go on with the other hulls
                failure = failure or error
        for shard in () if self._engine.divisions is None else self._engine.divisions.shards():
            if shard.unsaved < max(least_points, shard.points):
                continue
            try:
                await self._snapshot_of_shard(shard)
            except Exception as error:  # likewise
                failure = failure or error
        if failure is not None:
            raise failure

    async def _snapshot(self, hull: "LiveHull") -> None:
        unsaved = hull.unsaved
        _, kept = await hull.read(lambda state: state.kept(), rows=hull.counts.points)
        await self._carry_out(self._storage.snapshot(hull.number, kept))
        hull.saved(unsaved)

    async def _snapshot_of_shard(self, shard: "StoredShard") -> None:
        taken = shard.take()
        if taken is not None:
            kept, unsaved = taken
            await self._carry_out(self._storage.snapshot(shard.number, kept))
            shard.saved(unsaved)

    async def _carry_out(self, steps: Iterator[Any]) -> None:
        while True:
            begun = self._clock.monotonic()
            step = await self._engine.run(self._engine.disk, partial(next, steps, None))
            if step is None:
                return
            await self._engine.commit([step])
            await self._clock.sleep(PAUSE_FACTOR * (self._clock.monotonic() - begun))
