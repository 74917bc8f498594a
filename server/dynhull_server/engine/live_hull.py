"""One named hull: its points, its revision, and everybody who waits for the next one."""

import asyncio
import secrets
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TypeVar

from dynhull import DynamicHull
from dynhull.arrays import Points

from .batch import Applied, apply_batch
from .difference import Differences
from .errors import HullEmptyError, HullNotFoundError, HullReplacedError, LimitExceededError
from .history import History
from .limits import Limits
from .producers import Producers
from .serial import SerialExecutor
from .verification import Verification, verify
from .writer import SMALL, Write, Writer

T = TypeVar("T")

# A hull of at most so many vertices is told at once.
FEW_VERTICES = 256


@dataclass(frozen=True, slots=True)
class Config:
    """What a hull is told at its creation; no bound on its points but the server's where `max_points` is 0."""

    max_points: int = 0


@dataclass(slots=True)
class Counts:
    """How much a hull holds at a revision; `points` with multiplicity."""

    revision: int
    points: int
    distinct: int


class LiveHull:
    """A hull that many callers read, write and wait for.

    Batches and reads run one at a time in the order they came, so every read sees one revision.

    Attributes:
        name: the hull's name.
        config: what it was told at its creation.
        uid: tells it from other hulls of its name.
        created: when.
        counts: as of the latest revision.
        differences: between the vertices it has told.
    """

    def __init__(self, name: str, config: Config, pool: Executor, limits: Limits) -> None:
        self.name = name
        self.config = config
        self.uid = secrets.token_hex(8)
        self.created = datetime.now(UTC)
        self.counts = Counts(0, 0, 0)
        self.differences = Differences()
        self._hull = DynamicHull()
        self._most_points = min(config.max_points or limits.max_points, limits.max_points)
        self._serial = SerialExecutor(pool, self._wake)
        self._moved: asyncio.Event | None = None
        self._deleted = False
        self._vertices = self._hull.vertices()
        self._vertices_as_of = self._hull.changes
        self._changed_at = 0
        self._history = History(limits.history_bytes, self._vertices)
        self._producers = Producers(limits.max_producers)

    @property
    def vertex_count(self) -> int:
        """The number of vertices when somebody last looked."""
        return len(self._vertices)

    def writer(self, notify: Callable[[], None]) -> Writer:
        """For many batches, without waiting for each; `notify` is called when there is news of one."""
        return Writer(self._apply, self._serial, notify)

    async def apply(self, write: Write) -> Applied:
        """Apply a batch as the next revision, or raise what refuses it and change nothing."""
        return await self._serial.run(lambda: self._apply(write), write.rows <= SMALL)

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

    async def recall(self, uid: str, revision: int) -> Points | None:
        """The vertices at an earlier revision, None where nobody was told them.

        Raises:
            HullReplacedError: this is not the hull of that uid.
            RevisionForgottenError: the revision is too old, or has not been yet.
        """
        if uid != self.uid:
            raise HullReplacedError(self.name, self.uid)
        _, vertices = await self._read(0, lambda: self._history.at(revision, self.counts.revision), small=True)
        return vertices

    def last_sequence(self, producer: str) -> int:
        """The last number of a producer that was applied, 0 where there is none."""
        return self._producers.last(producer)

    async def reached(self, revision: int) -> None:
        """Wait until the hull has this revision or a later one."""
        while not self._deleted and self.counts.revision < revision:
            if self._moved is None:
                self._moved = asyncio.Event()
            await self._moved.wait()
        if self._deleted:
            raise HullNotFoundError(self.name)

    def delete(self) -> None:
        """Refuse all further work; whoever waits gets HullNotFoundError."""
        self._deleted = True
        self._wake()

    async def _read(self, min_revision: int, function: Callable[[], T], small: bool) -> tuple[Counts, T]:
        await self.reached(min_revision)
        return await self._serial.run(lambda: (self.counts, function()), small)

    def _apply(self, write: Write) -> Applied:
        if self._deleted:
            raise HullNotFoundError(self.name)
        counts = self.counts
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
        self.counts = Counts(applied.revision, applied.points, self._hull.distinct)
        return applied

    def _current_vertices(self) -> Points:
        if self._vertices_as_of != self._hull.changes:
            self._vertices = self._hull.vertices()
            self._vertices.setflags(write=False)
            self._vertices_as_of = self._hull.changes
            self._history.told(self._changed_at, self._vertices)
        return self._vertices

    def _wake(self) -> None:
        if self._moved is not None:
            self._moved.set()
            self._moved = None
