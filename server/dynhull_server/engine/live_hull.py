"""One named hull: its points, its revision, and everybody who waits for the next one."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from dynhull import DynamicHull
from dynhull.arrays import Points

from .batch import Applied, Batch, apply_batch
from .errors import HullNotFoundError
from .serial import SerialExecutor
from .verification import Verification, verify

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
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
        created: when.
        counts: as of the latest revision.
    """

    def __init__(self, name: str, pool: Executor) -> None:
        self.name = name
        self.created = datetime.now(UTC)
        self.counts = Counts(0, 0, 0)
        self._hull = DynamicHull()
        self._pool = pool
        self._serial = SerialExecutor(pool, self._wake)
        self._moved = asyncio.Event()
        self._deleted = False
        self._vertices = self._hull.vertices()
        self._vertices_as_of = self._hull.changes

    async def apply(self, batch: Batch) -> Applied:
        """Apply a batch as the next revision, or raise PointMissingError and change nothing."""
        if self._deleted:
            raise HullNotFoundError(self.name)
        return await self._serial.run(lambda: self._apply(batch))

    async def locate(self, xy: Points, min_revision: int = 0) -> tuple[Counts, npt.NDArray[np.int8]]:
        """Where the points are: +1 inside, 0 on the boundary, -1 outside."""
        return await self._read(min_revision, lambda: self._hull.locate(xy))

    async def vertices(self, min_revision: int = 0) -> tuple[Counts, Points]:
        """The vertices; the very same array for as long as the hull has not changed."""
        return await self._read(min_revision, self._current_vertices)

    async def verify(self, min_revision: int = 0) -> tuple[Counts, Verification]:
        """Compare the live hull with Chan's algorithm on the stored points. Writes go on meanwhile."""
        counts, (points, vertices) = await self._read(
            min_revision, lambda: (self._hull.points(), self._current_vertices())
        )
        loop = asyncio.get_running_loop()
        return counts, await loop.run_in_executor(self._pool, verify, points, vertices)

    async def reached(self, revision: int) -> None:
        """Wait until the hull has this revision or a later one."""
        while not self._deleted and self.counts.revision < revision:
            await self._moved.wait()
        if self._deleted:
            raise HullNotFoundError(self.name)

    def delete(self) -> None:
        """Refuse all further work; whoever waits gets HullNotFoundError."""
        self._deleted = True
        self._wake()

    async def _read(self, min_revision: int, function: Callable[[], T]) -> tuple[Counts, T]:
        await self.reached(min_revision)
        return await self._serial.run(lambda: (self.counts, function()))

    def _apply(self, batch: Batch) -> Applied:
        applied = apply_batch(self._hull, batch, self.counts.revision + 1)
        self.counts = Counts(applied.revision, applied.points, self._hull.distinct)
        return applied

    def _current_vertices(self) -> Points:
        if self._vertices_as_of != self._hull.changes:
            self._vertices = self._hull.vertices()
            self._vertices.setflags(write=False)
            self._vertices_as_of = self._hull.changes
        return self._vertices

    def _wake(self) -> None:
        moved, self._moved = self._moved, asyncio.Event()
        moved.set()
