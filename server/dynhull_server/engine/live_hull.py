"""One hull as its callers use it: reads at one revision, waits for the next, and earlier revisions."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from dynhull import DynamicHull, globe
from dynhull.arrays import Checked, Points
from dynhull.keys import PackedKeys

from ..state.alarms.rule import unmarked
from ..state.batch import NO_POINTS, Applied, KeyedBatch, Write
from ..state.contents.keyed import KINDS
from ..state.core import SMALL
from ..state.errors import (
    FenceNotFoundError,
    HullEmptyError,
    HullNotFoundError,
    HullReplacedError,
    HullUnsuitableError,
    RevisionForgottenError,
)
from ..state.fences.model.fence import Fence
from ..state.fences.recovery.sides import Sides, sides_of
from ..state.hull import Hull
from ..state.hull_state import Counts, HullState, VertexKeys
from ..state.outline import GlobeOutline, Outline
from ..state.records import Center, CommitStamp, Contents, HullSettings, Keys, QuarantineRules
from ..state.requests import ReadHull, ReadTogether, Recenter, WriteBatch
from ..state.sample import sample
from .difference import Differences
from .driver import Driver
from .fence_verification import MOST_FAULTS, verify_events, verify_sides
from .fences import Fences
from .layers import Peeling
from .measures import HullMeasures, measures_of
from .recalls import Recalls
from .steps import BLOCK, FEW_ROWS, at_once, in_blocks
from .verification import Verification, verify
from .waiter import Waiter

T = TypeVar("T")

# The rows of a step that measures on the ellipsoid, which takes a tenth of a millisecond a row.
MEASURED_BLOCK = 256


class LiveHull:
    """A hull that many callers read and watch.

    Batches and reads run one at a time in order of arrival, so every read sees exactly one, committed revision.

    Args:
        driver: drives the core that has it.
        hull: its committed state.
        recalls: reads earlier revisions.
        fences: the fences that compare it.
        copies: limits the copies of hulls that large reads make.
    """

    def __init__(self, driver: Driver, hull: Hull, recalls: Recalls, fences: Fences, copies: asyncio.Semaphore) -> None:
        self._driver = driver
        self._copies = copies
        self._fences = fences
        self._hull = hull
        self._recalls = recalls
        self._moved: asyncio.Event | None = None
        self._outlined: asyncio.Event | None = None
        self._last_outlined = 0  # when the first caller began to wait for `_outlined`
        self._outline: tuple[Points, Center | None, Outline] | None = None
        self._measures: tuple[Points, HullMeasures] | None = None
        # Made for those of ten thousand hulls that need one.
        self._measuring: asyncio.Lock | None = None
        self._differences: Differences | None = None
        self._peeling: Peeling | None = None

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
        """Distinguishes it from other hulls of its name."""
        return self._hull.uid

    @property
    def restored(self) -> bool:
        """Whether a backup has brought it back, so that it may lack batches after that backup."""
        return self._hull.row.restored

    @property
    def created(self) -> datetime:
        """The time of its creation."""
        return datetime.fromtimestamp(self._hull.row.created, UTC)

    @property
    def settings(self) -> HullSettings:
        """Its settings."""
        return self._hull.row.settings

    @property
    def counts(self) -> Counts:
        """The counts at the latest committed revision."""
        return self._hull.counts

    @property
    def committed(self) -> CommitStamp | None:
        """The commit of the latest revision; None where it is not known."""
        return self._hull.committed

    @property
    def erased(self) -> bool:
        """Whether it may lack keys that were erased from its past: not as it is now."""
        return False

    @property
    def vertex_count(self) -> int:
        """The number of vertices when they were last read."""
        return self._hull.vertex_count

    @property
    def size(self) -> int:
        """The number of points that a snapshot has."""
        return self.counts.points

    @property
    def unsaved(self) -> int:
        """The number of points in batches since the last snapshot."""
        return self._hull.unsaved

    @property
    def between(self) -> int:
        """The number of points in batches between the last two snapshots; 0 for none since the hull was loaded."""
        return self._hull.between

    def saved(self, points: int) -> None:
        """Record a snapshot, which includes batches with this number of points."""
        self._hull.unsaved -= points
        self._hull.between = points

    @property
    def differences(self) -> Differences:
        """The differences between its vertices at successive reads."""
        if self._differences is None:
            self._differences = Differences(self._driver.aside)
        return self._differences

    @property
    def peeling(self) -> Peeling:
        """Its convex layers."""
        if self._peeling is None:
            self._peeling = Peeling(self, self._driver.aside, self._copies)
        return self._peeling

    @property
    def keyed(self) -> bool:
        """Whether the points have keys."""
        return self.settings.identity != "multiset"

    @property
    def geographic(self) -> bool:
        """Whether the points are places on the globe."""
        return self.settings.geographic

    def require_plane(self) -> None:
        """Raise HullUnsuitableError if the points are places on the globe."""
        if self.geographic:
            reason = "is geographic, and this question is about points of a plane"
            raise HullUnsuitableError(self.name, reason)

    def require_frame_of(self, other: "LiveHull", field: str) -> None:
        """Raise HullUnsuitableError if one hull is geographic, and the other one is not; `field` names this one."""
        if self.geographic != other.geographic:
            kind, kind_of_other = ("geographic", "a plane") if self.geographic else ("a plane", "geographic")
            raise HullUnsuitableError(self.name, f"is {kind}, and {other.name!r} is {kind_of_other}", field=field)

    def require_keys(self, field: str) -> None:
        """Raise HullUnsuitableError if the points have no keys; `field` is that of the request which asks for them."""
        if not self.keyed:
            raise HullUnsuitableError(self.name, "has points without keys", field=field)

    def keys(self, keys: Keys | None) -> Keys:
        """The keys of a question, which may be none; raise HullUnsuitableError if the hull has none of their kind."""
        self.require_keys("keys")
        none: Keys = PackedKeys(b"", b"") if self.settings.identity == "str" else np.empty(0, np.uint64)
        if keys is not None and type(keys) is not type(none):
            raise HullUnsuitableError(self.name, f"has keys that are {KINDS[self.settings.identity]}", field="keys")
        return none if keys is None else keys

    # Reads

    @property
    def ended(self) -> bool:
        """Whether it has been deleted."""
        return self._hull.ended

    @property
    def now(self) -> tuple[Counts, Outline] | None:
        """What a small read needs that can run now; None if it has to wait for its turn."""
        hull = self._hull
        return (hull.counts, hull.state.outline()) if self._driver.idle(hull) else None

    async def read(self, function: Callable[[HullState], T], rows: int = 0, min_revision: int = 0) -> tuple[Counts, T]:
        """Call `function`, which reads about `rows` points, with the state at one revision, `min_revision` or later."""
        while True:
            if self._hull.counts.revision < min_revision:
                await self.reached(min_revision)
            if rows <= SMALL and self._driver.idle(self._hull):
                return self._hull.counts, function(self._hull.state)
            counts, result = await self._driver.ask(ReadHull(Waiter(), self._hull, function, rows=rows))
            if counts.revision >= min_revision:
                return counts, result

    async def read_beside(
        self,
        other: "LiveHull",
        function: Callable[[HullState, HullState], T],
        rows: int = 0,
        min_revision: int = 0,
        other_min_revision: int = 0,
    ) -> tuple[Counts, Counts, T]:
        """Call `function` with the states of this hull and another one, of one moment; both may be the same.

        No batch over both hulls has been applied to one of them only.
        """
        if other is self:
            least = max(min_revision, other_min_revision)
            counts, result = await self.read(lambda state: function(state, state), rows, least)
            return counts, counts, result
        parts = [self._hull, other._hull]
        while True:
            await self.reached(min_revision)
            await other.reached(other_min_revision)
            request = ReadTogether(Waiter(), parts, lambda states: function(*states), rows=rows)
            (counts, other_counts), result = await self._driver.ask(request)
            if counts.revision >= min_revision and other_counts.revision >= other_min_revision:
                return counts, other_counts, result

    async def vertices(self, min_revision: int = 0, layer: int = 1) -> tuple[Counts, Points]:
        """The vertices, or those of another convex layer; the same array object while they have not changed."""
        if layer > 1:
            peeled = await self.peeling.layers(layer, min_revision)
            return peeled.counts, peeled.layer(layer)[0]
        return await self.read(HullState.vertices, self.vertex_count // 2, min_revision)

    async def named_vertices(self, min_revision: int = 0, layer: int = 1) -> tuple[Counts, Points, VertexKeys]:
        """As `vertices`, with the keys of a keyed hull."""
        if layer > 1:
            peeled = await self.peeling.layers(layer, min_revision)
            vertices, named = peeled.layer(layer)
            assert named is not None  # the hull is keyed
            return peeled.counts, vertices, named
        counts, (vertices, keys) = await self.read(
            lambda state: (state.vertices(), state.vertex_keys()), self.vertex_count, min_revision
        )
        return counts, vertices, keys

    async def ask_rows(
        self,
        question: Callable[[Outline, slice], T],
        rows: int,
        min_revision: int = 0,
        *,
        layer: int = 1,
        check: Callable[[Center], None] | None = None,
    ) -> tuple[Counts, T]:
        """Answer a query about many rows that depends only on the vertices.

        Args:
            question: called with a hull of these vertices and a slice of the rows, once or several times.
            rows: the number of rows.
            min_revision: the least revision of the hull.
            layer: the convex layer to ask.
            check: called with the centre of a geographic hull that has one; raises an error to refuse the query.

        Returns:
            The counts at the revision that answered, and an array of the answers.
        """
        if rows <= BLOCK and layer == 1 and not self.geographic:  # delays later writes by some milliseconds only
            return await self.read(lambda state: question(state.outline(), slice(0, rows)), rows, min_revision)
        counts, vertices = await self.vertices(min_revision, layer)
        if check is not None and counts.center is not None:
            await (at_once if rows <= FEW_ROWS else self._driver.aside)(partial(check, counts.center))
        return counts, await self.ask_vertices(counts, vertices, question, rows)

    async def ask_vertices(
        self, counts: Counts, vertices: Points, question: Callable[[Outline, slice], T], rows: int
    ) -> T:
        """Answer such a query for these vertices of the hull, outside of the trips."""
        outline = await self.outline(counts, vertices)
        block = MEASURED_BLOCK if self.geographic else BLOCK
        run = at_once if rows <= FEW_ROWS and len(vertices) <= FEW_ROWS else self._driver.aside
        answers: T = await in_blocks(run, partial(question, outline), rows, block)
        return answers

    async def sketch(self, counts: Counts, vertices: Points, most: int) -> tuple[Points, float]:
        """At most `most` of these vertices, and how far the hull reaches beyond them."""
        if self.geographic:
            work = partial(globe.sketch, vertices, most)
        else:
            outline = await self.outline(counts, vertices)
            assert isinstance(outline, DynamicHull)  # of the plane
            work = partial(outline.sketch, most)
        found: tuple[Points, float] = await self._driver.aside(work)
        return found

    async def count(self, xy: Checked, min_revision: int = 0) -> tuple[Counts, npt.NDArray[np.int64]]:
        """The multiplicity of each of some points."""
        if len(xy) <= BLOCK:
            return await self.read(lambda state: state.hull.count_many(xy), len(xy), min_revision)
        counts, stored = await self.read(lambda state: state.hull.points(), self.counts.points, min_revision)
        hull: DynamicHull = await self._driver.aside(partial(DynamicHull, stored))
        return counts, await in_blocks(self._driver.aside, lambda rows: hull.count_many(xy[rows]), len(xy))

    async def support(self, directions: Checked, min_revision: int = 0, layer: int = 1) -> tuple[Counts, Points]:
        """The extreme vertices, or raise HullEmptyError."""

        def extreme(hull: Outline, block: slice) -> Points:
            if not len(hull):
                raise HullEmptyError(self.name)
            return hull.support(directions[block])

        return await self.ask_rows(extreme, len(directions), min_revision, layer=layer)

    async def verify(
        self, min_revision: int = 0, prefixes: tuple[str, ...] = ("",), *, events: bool = True
    ) -> tuple[Counts, Verification]:
        """Compare the live hull with Chan's algorithm on the stored points. Writes continue meanwhile.

        Also compare the sides of its keys in fences with their positions.

        Args:
            min_revision: the revision to wait for.
            prefixes: only fences whose names begin with one of these are compared.
            events: whether to compare the events of these fences, too.
        """
        run = self._driver.aside

        def copied(state: HullState) -> tuple[Points, Points, Contents | None, bool, Sides | None]:
            held = state.quarantine
            whole = held is None or held.whole()
            return state.hull.points(), state.vertices(), state.entities(), whole, self._sides(prefixes)

        size = self.counts.points + self.counts.held + len(self.fences())
        counts, (points, vertices, stored, whole, sides) = await self.read(copied, size, min_revision)
        outcome = await verify(points, vertices, run, stored, counts.center)
        if not whole:
            outcome = replace(outcome, keys_equal=False)
        if sides is None:
            return counts, outcome
        found = [await verify_sides(sides, run)]
        for fence in self.fences(prefixes) if events else ():
            with suppress(FenceNotFoundError):
                found.append(await verify_events(self._fences.live(fence), run))
        faults = tuple(fault for each in found for fault in each.faults)[:MOST_FAULTS]
        seconds = outcome.seconds + sum(each.seconds for each in found)
        return counts, replace(outcome, fences=len(sides), fence_faults=faults, seconds=seconds)

    def fences(self, prefixes: tuple[str, ...] = ("",)) -> list[Fence]:
        """The fences that compare its keys, or it as a whole, and whose names begin with one of the prefixes."""
        line = self._driver.core.line(self.name)
        return (
            []
            if line is None
            else [each for each in line.comparing(self.name) if unmarked(each.name).startswith(prefixes)]
        )

    def _sides(self, prefixes: tuple[str, ...]) -> Sides | None:
        """What fences have about it, during a read: none is created or deleted meanwhile. None if there is no fence."""
        fences = self.fences(prefixes)
        return sides_of(self.name, fences) if fences else None

    async def sample(self, size: int, min_revision: int = 0) -> tuple[Counts, Points]:
        """A sample of at most `size` of the points. Writes continue meanwhile."""
        counts, points = await self.read(lambda state: state.hull.points(), self.counts.points, min_revision)
        if len(points) <= size:
            return counts, points
        return counts, await self._driver.aside(partial(sample, points, size))

    async def last_sequence(self, producer: str) -> int:
        """The last sequence number applied of a producer, 0 where there is none."""
        _, last = await self.read(lambda state: state.last_sequence(producer))
        return last

    async def recenter(self, center: Center | None) -> tuple[Counts, bool]:
        """Move the centre of a geographic hull, None to the mean direction of its points.

        Returns the counts after it, and whether the vertices have changed.

        Raises:
            HullUnsuitableError: the hull is a plane, or cannot have this centre.
            NotStoredError: the storage has failed.
        """
        result: tuple[Counts, bool] = await self._driver.ask(
            Recenter(Waiter(), self.name, center, self._driver.time(), rows=self.counts.points)
        )
        return result

    async def reshard(self, shards: int) -> Counts:
        """Divide the points of a hull over shards among another number of them. Returns the counts after it.

        Raises:
            HullUnsuitableError: the hull is not divided.
            ShardAwayError: a shard does not answer; nothing has changed.
        """
        del shards
        raise HullUnsuitableError(
            self.name, "is not divided among shards: create one that is, and load its points", field="shards"
        )

    async def set_quarantine(self, rules: QuarantineRules) -> Counts:
        """Replace the rules of the quarantine of a keyed hull. Returns the counts after it.

        Raises:
            HullUnsuitableError: the hull has no keys.
            NotStoredError: the storage has failed.
        """
        self.require_keys("quarantine")
        kind, none = self.settings.identity, self.keys(None)
        assert kind != "multiset"  # it has keys
        batch = KeyedBatch(kind, none, NO_POINTS, none, rules=rules)
        write = Write(self.name, batch, self._driver.time())
        applied: Applied = await self._driver.ask(WriteBatch(Waiter(), write))
        counts, _ = await self.read(lambda _: None, min_revision=applied.revision)
        return counts

    # Revisions

    @asynccontextmanager
    async def recalled(self, uid: str, revision: int) -> AsyncIterator[Points | None]:
        """The vertices at an earlier revision; None where they were never sent. Callers leave the context soon.

        Raises:
            HullReplacedError: the uid is not that of this hull.
            RevisionForgottenError: the revision is too old, or later than the newest.
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
        """Wait until the hull has this revision or a later one; raise HullNotFoundError if it is deleted."""
        while not self._hull.ended and self.counts.revision < revision:
            if self._moved is None:
                self._moved = asyncio.Event()
            await self._moved.wait()
        if self._hull.ended:
            raise HullNotFoundError(self.name)

    async def outlined(self, revision: int) -> None:
        """Wait until the vertices change after this revision; raise HullNotFoundError if the hull is deleted."""
        while not self._hull.ended and self.counts.outlined <= revision:
            if self._outlined is None:
                self._outlined, self._last_outlined = asyncio.Event(), self.counts.outlined
            await self._outlined.wait()
        if self._hull.ended:
            raise HullNotFoundError(self.name)

    def moved(self) -> None:
        """Wake the waiting callers: the hull has a new revision, or was deleted."""
        if self._moved is not None:
            self._moved.set()
            self._moved = None
        if self._outlined is not None and (self._hull.ended or self.counts.outlined != self._last_outlined):
            self._outlined.set()
            self._outlined = None

    async def measures(self, vertices: Points) -> HullMeasures:
        """The measures of these vertices: made once, however many ask, until the vertices change."""
        if self._measuring is None:
            self._measuring = asyncio.Lock()
        async with self._measuring:
            if self._measures is None or self._measures[0] is not vertices:
                run = at_once if len(vertices) <= FEW_ROWS else self._driver.aside
                self._measures = vertices, await measures_of(vertices, run, geographic=self.geographic)
            return self._measures[1]

    async def outline(self, counts: Counts, vertices: Points) -> Outline:
        """A separate hull with these vertices, shared by large reads of one revision."""
        held, center = self._outline, counts.center
        if held is not None and held[0] is vertices and held[1] == center:
            return held[2]
        make = partial(GlobeOutline, vertices, center) if self.geographic else partial(DynamicHull, vertices)
        run = at_once if len(vertices) <= FEW_ROWS else self._driver.aside
        made: Outline = await run(make)
        self._outline = vertices, center, made
        return made
