"""A shard in this process, with a thread of its own."""

import asyncio
from functools import partial
from typing import Any

from dynhull_server.engine.shard_store import ShardStore
from dynhull_server.engine.threads import Pool
from dynhull_server.state.contents.live import LiveContents
from dynhull_server.state.records import HullRow, Kept

from ..shards.shard import Shard
from .logs import StoredShardLog
from .peers import PeerAwayError


class LocalShard:
    """A shard, from its first message until `close`.

    Args:
        pool: its thread.
        store: has the storage.
        row: the row of the shard.
        stored: whether it is certain that the storage has it.

    Attributes:
        row: the row of the shard.
        stored: the same.
        number: its number in the storage.
        points: the number of its points.
        unsaved: the number of points in steps since the last snapshot.
    """

    def __init__(self, pool: Pool, store: ShardStore, row: HullRow, *, stored: bool = True) -> None:
        self.row = row
        self.stored = stored
        self.number = row.number
        self.points = self.unsaved = 0
        self._pool = pool
        self._store = store
        self._log: StoredShardLog | None = None
        self._shard: Shard | None = None
        self._saved = 0
        self._snapshot_wanted = False
        self._taken: tuple[Kept, int] | None = None

    async def store(self) -> None:
        """Put it into the storage; again where an earlier attempt has failed, or its caller has gone."""
        if not self.stored:
            await self._store.add(self.row)
            self.stored = True

    async def epoch(self) -> int:
        """The last epoch that was begun."""
        epoch: int = await self._run(lambda: self._loaded()[0].epoch)
        return epoch

    async def receive(self, message: Any) -> Any:
        """The reply to a message of the root; None where it comes too late."""
        return await self._run(partial(self._receive, message))

    def take(self) -> tuple[Kept, int] | None:
        """What is decided, for a snapshot; None if it is not at hand so far."""
        taken, self._taken = self._taken, None
        self._snapshot_wanted = taken is None
        return taken

    def saved(self, points: int) -> None:
        """Record a snapshot."""
        self._saved += points
        self.unsaved -= points

    async def close(self) -> None:
        """Complete the message in progress."""
        await asyncio.to_thread(self._pool.shutdown)

    async def _run(self, function: Any) -> Any:
        """Call a function in the thread of the shard. It goes on without its caller, who asks again."""
        try:
            submitted = self._pool.submit(function)
        except RuntimeError:  # it is closed
            raise PeerAwayError("the shard has been ended") from None
        running = asyncio.wrap_future(submitted)
        running.add_done_callback(lambda done: done.cancelled() or done.exception())
        return await asyncio.shield(running)

    def _loaded(self) -> tuple[StoredShardLog, Shard]:
        if self._log is None or self._shard is None:
            self._log = StoredShardLog(self._store, self.row)
            self._shard = Shard(self.row.settings, self._log)
        return self._log, self._shard

    def _receive(self, message: Any) -> Any:
        log, shard = self._loaded()
        settled = shard.settled(message)
        if settled is not None:
            self._look_at(log, settled)
        try:
            return shard.receive(message)
        except BaseException:  # memory may be ahead of the log or behind it
            self._log = self._shard = None
            self._saved = 0
            raise

    def _look_at(self, log: StoredShardLog, settled: LiveContents) -> None:
        """Take what a snapshot needs, in a moment in which everything is decided."""
        self.points, self.unsaved = len(settled.hull), log.added - self._saved
        if self._snapshot_wanted:
            self._snapshot_wanted = False
            self._taken = log.kept(settled), self.unsaved
