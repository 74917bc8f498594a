"""One named hull: its points, its revision, and everybody who waits for the next one."""

import asyncio
import secrets
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TypeVar

from dynhull import DynamicHull
from dynhull.arrays import Points

from ..state.batch import Applied, apply_batch
from ..state.errors import (
    HullEmptyError,
    HullNotFoundError,
    HullReplacedError,
    LimitExceededError,
    RevisionForgottenError,
    StorageError,
)
from ..state.history import History
from ..state.limits import Limits
from ..state.producers import Producers
from ..state.sample import sample
from ..storage.sqlite.errors import JournalError
from ..storage.sqlite.records import Record
from .difference import Differences
from .serial import SerialExecutor
from .storage import HullStore, Restored, storage_error
from .verification import Verification, verify
from .writer import SMALL, Write, Writer

T = TypeVar("T")

# A hull of at most so many vertices is told at once.
FEW_VERTICES = 256


@dataclass(frozen=True, slots=True)
class Config:
    """What a hull is told at its creation; no bound on its points but the server's where `max_points` is 0."""

    max_points: int = 0


@dataclass(frozen=True, slots=True)
class Birth:
    """Where a hull comes from: `uid` tells it from others of its name."""

    uid: str
    created: datetime

    @classmethod
    def now(cls) -> "Birth":
        """Of a new hull."""
        return cls(secrets.token_hex(8), datetime.now(UTC))


@dataclass(slots=True)
class Counts:
    """How much a hull holds at a revision; `points` with multiplicity."""

    revision: int
    points: int
    distinct: int


class LiveHull:
    """A hull that many callers read, write and wait for.

    Batches and reads run one at a time in the order they came, so every read sees one revision. With a store, nobody
    is told of a batch before it is committed.

    Attributes:
        name: the hull's name.
        config: what it was told at its creation.
        uid: tells it from other hulls of its name.
        created: when.
        counts: as of the latest revision that anybody may be told of.
        unsaved: points in batches since the last snapshot.
        differences: between the vertices it has told.
    """

    def __init__(
        self,
        name: str,
        config: Config,
        pool: Executor,
        limits: Limits,
        birth: Birth | None = None,
        store: HullStore | None = None,
        restored: Restored | None = None,
    ) -> None:
        birth = birth or Birth.now()
        self.name = name
        self.config = config
        self.uid = birth.uid
        self.created = birth.created
        self.unsaved = 0
        self.differences = Differences()
        self._limits = limits
        self._most_points = min(config.max_points or limits.max_points, limits.max_points)
        self._pool = pool
        self._serial = SerialExecutor(pool, self._commit, self._roll_back, self._wake)
        self._store = store
        self._uncommitted: list[Record] = []
        self._moved: asyncio.Event | None = None
        self._closed = False
        self._deleted = False
        self._load(restored or Restored(DynamicHull(), 0, {}))
        self.counts = self._counts

    def _load(self, restored: Restored) -> None:
        self._hull = restored.hull
        self._counts = Counts(restored.revision, len(restored.hull), restored.hull.distinct)
        self._producers = Producers(self._limits.max_producers, restored.producers)
        self._vertices = self._hull.vertices()
        self._vertices.setflags(write=False)
        self._vertices_as_of = self._hull.changes
        self._changed_at = restored.revision
        self._history = History(self._limits.history_bytes, self._vertices, restored.revision)

    @property
    def vertex_count(self) -> int:
        """The number of vertices when somebody last looked."""
        return len(self._vertices)

    def writer(self, notify: Callable[[], None]) -> Writer:
        """For many batches, without waiting for each; `notify` is called when there is news of one."""
        return Writer(self._apply, self._serial, notify)

    async def apply(self, write: Write) -> Applied:
        """Apply a batch as the next revision, or raise what refuses it and change nothing."""
        return await self._serial.run(lambda: self._apply(write), small=write.rows <= SMALL, writes=True)

    async def read(
        self, function: Callable[[DynamicHull], T], rows: int = 0, min_revision: int = 0
    ) -> tuple[Counts, T]:
        """What `function`, which does work for `rows` points, says of the hull."""
        return await self._read(min_revision, lambda: function(self._hull), rows <= SMALL)

    async def support(self, directions: Points, min_revision: int = 0) -> tuple[Counts, Points]:
        """The extreme vertices, or raise HullEmptyError."""

        def extreme(hull: DynamicHull) -> Points:
            if not len(hull):
                raise HullEmptyError(self.name)
            return hull.support(directions)

        return await self.read(extreme, len(directions), min_revision)

    async def vertices(self, min_revision: int = 0) -> tuple[Counts, Points]:
        """The vertices; the very same array for as long as the hull has not changed."""
        return await self._read(min_revision, self._current_vertices, len(self._vertices) <= FEW_VERTICES)

    async def verify(self, min_revision: int = 0) -> tuple[Counts, Verification]:
        """Compare the live hull with Chan's algorithm on the stored points. Writes go on meanwhile."""
        counts, (points, vertices) = await self._read(
            min_revision, lambda: (self._hull.points(), self._current_vertices()), small=False
        )
        return counts, await verify(points, vertices)

    async def sample(self, size: int, min_revision: int = 0) -> tuple[Counts, Points]:
        """At most `size` of the points. Writes go on while they are chosen."""
        counts, points = await self._read(min_revision, lambda: self._hull.points(), self._counts.points <= SMALL)
        if len(points) <= size:
            return counts, points
        return counts, await asyncio.to_thread(sample, points, size)

    async def recall(self, uid: str, revision: int) -> Points | None:
        """The vertices at an earlier revision, None where nobody was told them.

        Raises:
            HullReplacedError: this is not the hull of that uid.
            RevisionForgottenError: the revision is too old, or has not been yet.
        """
        if uid != self.uid:
            raise HullReplacedError(self.name, self.uid)
        try:
            _, vertices = await self._read(0, lambda: self._history.at(revision, self._counts.revision), small=True)
        except RevisionForgottenError as error:
            if self._store is None or revision > error.newest:
                raise
            loop = asyncio.get_running_loop()
            return await loop.run_in_executor(self._pool, self._recall_stored, self._store, error)
        return vertices

    async def last_sequence(self, producer: str) -> int:
        """The last number of a producer that was applied, 0 where there is none."""
        _, last = await self._read(0, lambda: self._producers.last(producer), small=True)
        return last

    async def snapshot(self) -> None:
        """Write the points and the producers to the store, beside the traffic."""
        if self._store is None:
            return
        unsaved = self.unsaved
        counts, (points, producers) = await self._read(
            0, lambda: (self._hull.points(), self._producers.state()), small=False
        )
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(self._pool, self._store.snapshot, counts.revision, points, producers)
        self.unsaved -= unsaved

    async def reached(self, revision: int) -> None:
        """Wait until the hull has this revision or a later one."""
        while not self._deleted and self.counts.revision < revision:
            if self._moved is None:
                self._moved = asyncio.Event()
            await self._moved.wait()
        if self._deleted:
            raise HullNotFoundError(self.name)

    async def create(self) -> None:
        """Commit the hull to the store, or raise StorageError."""
        if self._store is not None:
            await _committed(self._store.create())

    async def delete(self) -> None:
        """Refuse all further work; whoever waits gets HullNotFoundError. StorageError where it cannot be committed."""
        await self._serial.run(lambda: self._close(closed=True), small=True)  # after the batches under way
        if self._store is not None:
            try:
                await _committed(self._store.delete())
            except StorageError:
                self._close(closed=False)
                raise
        self.discard()

    def discard(self) -> None:
        """As `delete`, of a hull that the store does not know."""
        self._deleted = True
        self._wake()

    def stop(self) -> None:
        """Begin nothing more: the server ends."""
        self._serial.stop()

    def _close(self, *, closed: bool) -> None:
        self._closed = closed

    async def _read(self, min_revision: int, function: Callable[[], T], small: bool) -> tuple[Counts, T]:
        while True:
            await self.reached(min_revision)
            counts, result = await self._serial.run(lambda: (self._counts, function()), small=small)
            if counts.revision >= min_revision:
                return counts, result

    def _apply(self, write: Write) -> Applied:
        if self._closed or self._deleted:
            raise HullNotFoundError(self.name)
        counts = self._counts
        if write.producer and not self._producers.is_new(write.producer, write.sequence):
            return Applied(counts.revision, 0, 0, 0, False, counts.points, duplicate=True)
        batch = write.make()
        if counts.points + batch.growth > self._most_points:
            raise LimitExceededError("max_points", self._most_points)
        applied = apply_batch(self._hull, batch, counts.revision + 1)
        if applied.hull_changed:
            self._changed_at = applied.revision
            self._history.changed(applied.revision)
        if write.producer:
            self._producers.applied(write.producer, write.sequence)
        self._counts = Counts(applied.revision, applied.points, self._hull.distinct)
        if self._store is not None:
            lenient = applied.missing > 0
            self._uncommitted.append(
                Record(applied.revision, batch.inserts, batch.deletes, write.producer, write.sequence, lenient)
            )
            self.unsaved += len(batch.inserts) + len(batch.deletes)
        return applied

    def _commit(self) -> Future[None] | None:
        if self._store is None or not self._uncommitted:
            return None
        records, self._uncommitted = self._uncommitted, []
        return self._store.append(records)

    def _roll_back(self, failure: BaseException) -> StorageError:
        assert self._store is not None
        self._load(self._store.restore())
        return storage_error(failure)

    def _recall_stored(self, store: HullStore, forgotten: RevisionForgottenError) -> Points:
        oldest = store.oldest()
        if forgotten.revision < oldest:
            raise RevisionForgottenError(forgotten.revision, oldest, forgotten.newest) from None
        return store.restore(forgotten.revision).hull.vertices()

    def _current_vertices(self) -> Points:
        if self._vertices_as_of != self._hull.changes:
            self._vertices = self._hull.vertices()
            self._vertices.setflags(write=False)
            self._vertices_as_of = self._hull.changes
            self._history.told(self._changed_at, self._vertices)
        return self._vertices

    def _wake(self) -> None:
        self.counts = self._counts
        if self._moved is not None:
            self._moved.set()
            self._moved = None


async def _committed(commit: Future[None]) -> None:
    try:
        await asyncio.wrap_future(commit)
    except JournalError as error:
        raise storage_error(error) from error
