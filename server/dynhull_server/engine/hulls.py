"""All hulls of a server, by name."""

import asyncio
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from datetime import UTC, datetime

from sortedcontainers import SortedDict

from ..state.errors import HullExistsError, HullNotFoundError, LimitExceededError, StorageError
from ..state.limits import Limits
from ..storage.sqlite.journal import HullRow, Journal
from .live_hull import Birth, Config, LiveHull
from .storage import HullStore


class Engine:
    """Named hulls, in memory, and on the disk where there is a journal."""

    def __init__(self, limits: Limits, journal: Journal | None = None) -> None:
        self._limits = limits
        self._journal = journal
        self._hulls: SortedDict[str, LiveHull] = SortedDict()
        self._pool = ThreadPoolExecutor(thread_name_prefix="hull")

    def __len__(self) -> int:
        return len(self._hulls)

    def __iter__(self) -> Iterator[LiveHull]:
        return iter(list(self._hulls.values()))

    async def restore(self, progress: Callable[[int, int], None]) -> list[str]:
        """Take up the hulls of the journal. Returns what was lost at its end, in words.

        Args:
            progress: called with hulls restored and hulls in all, before the first and after each.

        Raises:
            JournalDamagedError: something in the middle of the journal is damaged.
        """
        if self._journal is None:
            return []
        loop = asyncio.get_running_loop()
        rows = await loop.run_in_executor(self._pool, self._journal.hulls)
        progress(0, len(rows))
        for done, row in enumerate(rows, start=1):
            store = HullStore(self._journal, row, known=True)
            restored = await loop.run_in_executor(self._pool, store.restore)
            config, birth = _decode(row)
            self._hulls[row.name] = LiveHull(row.name, config, self._pool, self._limits, birth, store, restored)
            progress(done, len(rows))
        return self._journal.notes

    def begin(self, name: str, config: Config) -> LiveHull:
        """Make an empty hull, or raise HullExistsError or LimitExceededError. It is stored with its first batch."""
        if name in self._hulls:
            raise HullExistsError(name)
        if len(self._hulls) >= self._limits.max_hulls:
            raise LimitExceededError("max_hulls", self._limits.max_hulls)
        birth = Birth.now()
        store = None
        if self._journal is not None:
            row = self._journal.new_row(name, birth.created.timestamp(), _encode(config, birth))
            store = HullStore(self._journal, row, known=False)
        hull = self._hulls[name] = LiveHull(name, config, self._pool, self._limits, birth, store)
        return hull

    async def create(self, name: str, config: Config) -> LiveHull:
        """As `begin`, and store it at once; StorageError where that cannot be."""
        hull = self.begin(name, config)
        try:
            await hull.create()
        except StorageError:
            self.discard_unwritten(hull)
            raise
        return hull

    def get(self, name: str) -> LiveHull:
        """The hull of that name, or raise HullNotFoundError."""
        hull: LiveHull | None = self._hulls.get(name)
        if hull is None:
            raise HullNotFoundError(name)
        return hull

    def has(self, name: str) -> bool:
        """Whether there is a hull of that name."""
        return name in self._hulls

    async def delete(self, name: str) -> None:
        """Remove the hull of that name, or raise HullNotFoundError or StorageError."""
        hull = self.get(name)
        await hull.delete()
        if self._hulls.get(name) is hull:
            del self._hulls[name]

    def discard_unwritten(self, hull: LiveHull) -> None:
        """Remove a hull that nothing has been written to, and that the journal does not know."""
        if hull.counts.revision == 0 and self._hulls.get(hull.name) is hull:
            hull.discard()
            del self._hulls[hull.name]

    def page(self, prefixes: Sequence[str], after: str, size: int) -> tuple[list[LiveHull], bool]:
        """At most `size` hulls whose names follow `after`, and whether there are more.

        The names begin with one of the prefixes, which are sorted and none of which begins with another.
        """
        hulls: list[LiveHull] = []
        for prefix in prefixes:
            for name in self._hulls.irange(minimum=max(prefix, after)):
                if not name.startswith(prefix):
                    break
                if name == after:
                    continue
                if len(hulls) == size:
                    return hulls, True
                hulls.append(self._hulls[name])
        return hulls, False

    def close(self) -> None:
        """Wait for the work under way, and commit it. What waits behind it is left."""
        for hull in self:
            hull.stop()
        self._pool.shutdown()
        if self._journal is not None:
            self._journal.close()


def _encode(config: Config, birth: Birth) -> bytes:
    return json.dumps({"uid": birth.uid, "config": asdict(config)}).encode()


def _decode(row: HullRow) -> tuple[Config, Birth]:
    stored = json.loads(row.config)
    return Config(**stored["config"]), Birth(stored["uid"], datetime.fromtimestamp(row.created, UTC))
