"""What callers see of one hull: reads of one revision, waiting for the next, and earlier revisions."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt

from dynhull import DynamicHull
from dynhull.arrays import Checked, Points

from ..state.errors import HullEmptyError, HullNotFoundError, HullReplacedError, RevisionForgottenError
from ..state.events import ReadHull
from ..state.hull import Hull
from ..state.hull_state import Counts, HullState
from ..state.sample import sample
from .difference import Differences
from .recalls import Recalls
from .steps import BLOCK, in_blocks
from .verification import Verification, verify
from .waiter import Waiter

if TYPE_CHECKING:
    from .engine import Engine

T = TypeVar("T")


class LiveHull:
    """A hull that many callers read and wait for.

    Batches and reads run one at a time in the order they came, so every read sees one revision, one that is committed.

    Attributes:
        differences: between the vertices it has told.
    """

    def __init__(self, engine: "Engine", hull: Hull, recalls: Recalls) -> None:
        self.differences = Differences(engine.aside)
        self._engine = engine
        self._hull = hull
        self._recalls = recalls
        self._moved: asyncio.Event | None = None
        self._outline: tuple[Points, DynamicHull] | None = None

    @property
    def name(self) -> str:
        """Its name."""
        return self._hull.name

    @property
    def number(self) -> int:
        """Its number in the storage."""
        return self._hull.row.number

    @property
    def uid(self) -> str:
        """What tells it from other hulls of its name."""
        return self._hull.uid

    @property
    def created(self) -> datetime:
        """When it was created."""
        return datetime.fromtimestamp(self._hull.row.created, UTC)

    @property
    def max_points(self) -> int:
        """The limit on its points that it was created with, 0 for the server's."""
        return self._hull.row.max_points

    @property
    def counts(self) -> Counts:
        """As of the latest revision that anybody may be told of."""
        return self._hull.counts

    @property
    def vertex_count(self) -> int:
        """The number of vertices when somebody last looked."""
        return self._hull.vertex_count

    @property
    def unsaved(self) -> int:
        """Points in batches since the last snapshot."""
        return self._hull.unsaved

    def saved(self, points: int) -> None:
        """A snapshot has made batches of so many points superfluous."""
        self._hull.unsaved -= points

    # Reads

    async def read(self, function: Callable[[HullState], T], rows: int = 0, min_revision: int = 0) -> tuple[Counts, T]:
        """What `function`, which looks at about `rows` points, says of the hull in its turn."""
        while True:
            if self._hull.counts.revision < min_revision:
                await self.reached(min_revision)
            counts, result = await self._engine.ask(ReadHull(Waiter(), self._hull, function, rows=rows))
            if counts.revision >= min_revision:
                return counts, result

    async def vertices(self, min_revision: int = 0) -> tuple[Counts, Points]:
        """The vertices; the very same array for as long as the hull has not changed."""
        return await self.read(HullState.vertices, self.vertex_count // 2, min_revision)

    async def ask_rows(
        self, question: Callable[[DynamicHull, slice], T], rows: int, min_revision: int = 0
    ) -> tuple[Counts, T]:
        """The answers to a question about so many rows that depends on the vertices alone.

        Args:
            question: called with a hull of these vertices and a slice of the rows, perhaps several times.
            rows: how many rows there are.
            min_revision: of the hull, at least.

        Returns:
            The counts of the one revision that was asked, and an array of the answers.
        """
        if rows <= BLOCK:  # these hold up the writes behind them for some milliseconds
            return await self.read(lambda state: question(state.hull, slice(0, rows)), rows, min_revision)
        counts, vertices = await self.vertices(min_revision)
        outline = await self._hull_of(vertices)
        return counts, await in_blocks(self._engine.aside, partial(question, outline), rows)

    async def count(self, xy: Checked, min_revision: int = 0) -> tuple[Counts, npt.NDArray[np.int64]]:
        """How many times each of some points is there."""
        if len(xy) <= BLOCK:
            return await self.read(lambda state: state.hull.count_many(xy), len(xy), min_revision)
        counts, stored = await self.read(lambda state: state.hull.points(), self.counts.points, min_revision)
        hull: DynamicHull = await self._engine.aside(partial(DynamicHull, stored))
        return counts, await in_blocks(self._engine.aside, lambda rows: hull.count_many(xy[rows]), len(xy))

    async def support(self, directions: Checked, min_revision: int = 0) -> tuple[Counts, Points]:
        """The extreme vertices, or raise HullEmptyError."""

        def extreme(hull: DynamicHull, block: slice) -> Points:
            if not len(hull):
                raise HullEmptyError(self.name)
            return hull.support(directions[block])

        return await self.ask_rows(extreme, len(directions), min_revision)

    async def verify(self, min_revision: int = 0) -> tuple[Counts, Verification]:
        """Compare the live hull with Chan's algorithm on the stored points. Writes go on meanwhile."""
        counts, (points, vertices) = await self.read(
            lambda state: (state.hull.points(), state.vertices()), self.counts.points, min_revision
        )
        return counts, await verify(points, vertices, self._engine.aside)

    async def sample(self, size: int, min_revision: int = 0) -> tuple[Counts, Points]:
        """At most `size` of the points. Writes go on while they are chosen."""
        counts, points = await self.read(lambda state: state.hull.points(), self.counts.points, min_revision)
        if len(points) <= size:
            return counts, points
        return counts, await self._engine.aside(partial(sample, points, size))

    async def last_sequence(self, producer: str) -> int:
        """The last number of a producer that was applied, 0 where there is none."""
        _, last = await self.read(lambda state: state.last_sequence(producer))
        return last

    # Revisions

    @asynccontextmanager
    async def recalled(self, uid: str, revision: int) -> AsyncIterator[Points | None]:
        """The vertices at an earlier revision, None where nobody was told them; to be held for a moment.

        Raises:
            HullReplacedError: this is not the hull of that uid.
            RevisionForgottenError: the revision is too old, or has not been yet.
        """
        if uid != self.uid:
            raise HullReplacedError(self.name, self.uid)
        try:
            _, vertices = await self.read(lambda state: state.earlier_vertices(revision))
        except RevisionForgottenError as error:
            if revision > error.newest:
                raise
            remembered = error.oldest
        else:
            yield vertices
            return
        try:
            async with self._recalls.vertices(self._hull, revision) as recalled:
                yield recalled
        except RevisionForgottenError as error:
            oldest = min(remembered, error.oldest)
            raise RevisionForgottenError(revision, oldest, error.newest) from None

    async def reached(self, revision: int) -> None:
        """Wait until the hull has this revision or a later one."""
        while not self._hull.ended and self.counts.revision < revision:
            if self._moved is None:
                self._moved = asyncio.Event()
            await self._moved.wait()
        if self._hull.ended:
            raise HullNotFoundError(self.name)

    def moved(self) -> None:
        """The hull has a new revision, or is no more."""
        if self._moved is not None:
            self._moved.set()
            self._moved = None

    async def _hull_of(self, vertices: Points) -> DynamicHull:
        """A hull of its own with these vertices: several large reads of one revision share it."""
        if self._outline is None or self._outline[0] is not vertices:
            made: DynamicHull = await self._engine.aside(partial(DynamicHull, vertices))
            self._outline = vertices, made
            return made
        return self._outline[1]
