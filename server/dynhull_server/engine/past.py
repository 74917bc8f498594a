"""Hulls as they were: rebuilt from a stored state and the batches after it, in short steps beside the writes."""

import asyncio
from collections import Counter, deque
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AbstractContextManager, asynccontextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, TypeVar
from weakref import WeakValueDictionary

from dynhull.arrays import Points

from ..state.contents import begun
from ..state.contents.live import LiveContents
from ..state.core import SMALL
from ..state.errors import (
    HullNotFoundError,
    HullUnsuitableError,
    LimitExceededError,
    MomentForgottenError,
    NotStoredError,
    RefusedError,
    RevisionForgottenError,
)
from ..state.fences.model.fence import Fence
from ..state.hull import Hull
from ..state.hull_state import Counts, HullState
from ..state.records import CommitStamp, Kept, Keys, Record
from ..state.root_state import state_of
from ..state.tracks import Moves, Tracker
from ..storage.past import Erasure, Hole, Moment, Past, created, erased_since
from ..storage.port import NEWEST
from .divided_hull import DividedHull
from .driver import Driver
from .fences import Fences
from .live_hull import LiveHull
from .recalls import UNREADABLE, Recalls, past_refusal

T = TypeVar("T")
Outcome = Literal["anew", "kept", "unreadable"]
# Holds a place of those who may rebuild at the same time.
Place = Callable[[], AbstractContextManager[None]]

# What is applied in one step for who wants the vertices after each batch: rows, and the bytes of the vertices.
OUTLINED_ROWS, OUTLINED_BYTES = 2**15, 2**20
# Rebuilt hulls that are kept for further reads, and the batches that are always applied to one rather than begin anew.
MOST_KEPT, NEAR = 4, 1024
# Reads of batches while a stored state is built, and the rows after which there is no further one: to build one of a
# million keys takes about as long.
AHEAD, AHEAD_ROWS = 4, 2**19


@dataclass(slots=True, eq=False)
class _Rebuilt:
    """A rebuilt hull that nobody reads at present.

    Attributes:
        hull: the hull.
        state: its state at a revision.
        rows: about the number of rows that it takes.
        erasures: the erasures from its past before it was read.
        round: how often keys of any hull had been erased before.
    """

    hull: Hull
    state: HullState
    rows: int
    erasures: tuple[Erasure, ...]
    round: int


@dataclass(frozen=True, slots=True)
class Outlined:
    """A hull at one revision, as far as its vertices tell.

    Attributes:
        counts: its counts.
        committed: the commit; None where it is not known.
        vertices: the vertices.
        time: the time of the commit, or of the one before where it is not known; 0 for none.
    """

    counts: Counts
    committed: CommitStamp | None
    vertices: Points
    time: int


def time_of(record: Record, before: CommitStamp | None) -> int:
    """The time of a record's commit, or of the one before where it is not known; 0 for none."""
    committed = record.committed or before
    return 0 if committed is None else committed.time


class _ErasedMeanwhileError(Exception):
    """Keys were erased while a hull was rebuilt: what was read first may have them, and what was read last not."""


class PastHulls:
    """Rebuilds hulls as they were.

    The hulls rebuilt last are kept: a later moment of one of them takes the batches in between alone.

    Args:
        driver: has the threads.
        past: keeps the past.
        keeps: whether anything is kept.
        max_rows: the number of points and of rows of batches that one read may rebuild, and that are kept.

    Attributes:
        outcomes: how often a hull was rebuilt anew, or from one that was kept; and how often it could not be read.
        erasures: how often keys were erased from the past of any: what was read before may have them.
    """

    def __init__(self, driver: Driver, past: Past, *, keeps: bool, max_rows: int) -> None:
        self._driver = driver
        self._past = past
        self._keeps = keeps
        self._max_rows = max_rows
        self._kept: list[_Rebuilt] = []  # the last used at the end
        self._turns: WeakValueDictionary[tuple[int, int], asyncio.Lock] = WeakValueDictionary()
        self.outcomes: Counter[Outcome] = Counter()
        self.erasures = 0

    async def moment(self, live: LiveHull, revision: int | None, time: int, field: str = "at_") -> Moment:
        """The revision that is asked for: a number, or None for the last one committed at or before a time.

        `field` is the beginning of the fields of the request that say so.

        Raises:
            HullUnsuitableError: nothing is kept of the past of this hull.
            RevisionForgottenError: that revision is not kept any more, or not reached.
            MomentForgottenError: that time is before the oldest that is kept, or later than now.
        """
        self._require_past(live)
        found, erasures = await self._moment(live, revision, time, field)
        return replace(found, erased=any(each.concerns(found.revision) for each in erasures))

    async def _moment(
        self, live: LiveHull, revision: int | None, time: int, field: str
    ) -> tuple[Moment, tuple[Erasure, ...]]:
        """The revision, and the erasures of the hull."""
        number, newest, past = live.number, live.counts.revision, self._past
        if revision is None:
            await self._settled(time, field)
            found, erasures = await self.ask(live.name, lambda: (past.moment(number, time), past.erasures(number)))
            if found is None:
                oldest = await self.ask(live.name, partial(past.oldest_moment, number, timed=True))
                at = None if oldest.committed is None else oldest.committed.time
                raise MomentForgottenError(time, oldest.revision, at, live.counts.revision, f"{field}time")
            if found.revision > live.counts.revision:  # it was in doubt: the storage knows it before the hull has it
                await self._driver.whole()
            return found, erasures
        oldest, erasures = await self.ask(live.name, lambda: (past.oldest_moment(number), past.erasures(number)))
        if not oldest.revision <= revision <= newest:
            raise _forgotten(newest, revision, oldest, f"{field}revision")
        return Moment(revision, None), erasures

    async def oldest(self, live: LiveHull) -> Moment:
        """The oldest revision of a hull that can be read, or raise HullUnsuitableError if it has no past."""
        self._require_past(live)
        oldest: Moment = await self.ask(live.name, partial(self._past.oldest_moment, live.number))
        return oldest

    @asynccontextmanager
    async def state(self, hull: Hull, revision: int) -> AsyncIterator[HullState]:
        """The state of a hull at a revision, for one reader at a time: others wait for it, rather than rebuild it, too.

        Raises:
            LimitExceededError: it would take too many rows.
            RevisionForgottenError: what it takes is not kept any more.
        """
        async with self._turns.setdefault((hull.row.number, revision), asyncio.Lock()):
            rebuilt = await self._reach(hull, revision)
            try:
                yield rebuilt.state
            except RefusedError:
                self._keep(rebuilt)
                raise
            # After any other end a thread may still read it.
            self._keep(rebuilt)

    async def own(self, hull: Hull, revision: int) -> tuple[HullState, tuple[Erasure, ...]]:
        """The state of a hull at a revision, for one who changes it, and what had been erased from its past.

        Raises the errors of `state`.
        """
        rebuilt = await self._reach(hull, revision)
        return rebuilt.state, rebuilt.erasures

    async def batches(
        self, live: LiveHull, after: int, until: int, erasures: tuple[Erasure, ...] | None = None
    ) -> list[Record]:
        """The batches that follow revision `after`, none after `until`, as many as are applied in some milliseconds.

        For a state to be applied to, `erasures` are those before it was read.

        Raises:
            RevisionForgottenError: they are not kept any more.
            NotStoredError: they cannot be read at present, or do not fit the state, since keys were erased meanwhile.
        """
        found: list[Record] = await self._onwards(live, after, partial(self._read, live, after, until, erasures))
        return found

    def _read(self, live: LiveHull, after: int, until: int, erasures: tuple[Erasure, ...] | None) -> list[Record]:
        records = self._past.batches(live.number, after, until)
        if erasures is not None:
            self._require_unerased(live, erasures)
        return records

    async def require_unerased(self, live: LiveHull, erasures: tuple[Erasure, ...]) -> None:
        """Raise NotStoredError if keys were erased from the past of a hull after these erasures."""
        await self.ask(live.name, partial(self._require_unerased, live, erasures))

    def _require_unerased(self, live: LiveHull, erasures: tuple[Erasure, ...]) -> None:
        if erased_since(erasures, self._past.erasures(live.number)):
            raise NotStoredError("keys were erased from the past meanwhile: begin again")

    async def outlined(
        self, live: LiveHull, state: HullState, ahead: deque[Record], until: int, erasures: tuple[Erasure, ...]
    ) -> list[Outlined]:
        """Apply the next batches to a state that the caller has for himself, with the vertices after each.

        As many as take some milliseconds, none after revision `until`. Those in `ahead` come first, which gets others
        that have been read. Raises the errors of `batches` if there are none.
        """
        now = self._driver.machine.clock.monotonic()

        def work() -> list[Outlined]:
            self._require_room(state.counts.points)
            found: list[Outlined] = []
            rows, size = 0, 0
            while rows < OUTLINED_ROWS and size < OUTLINED_BYTES and (ahead or state.counts.revision < until):
                if not ahead:
                    try:
                        ahead.extend(self._read(live, state.counts.revision, until, erasures))
                    except Exception:
                        if found:  # these come first
                            break
                        raise
                record = ahead.popleft()
                time = time_of(record, state.committed)
                state.catch_up([record], now)
                if found and state.counts.points > self._max_rows:
                    break
                self._require_room(state.counts.points)
                before, vertices = state.known_vertices, state.vertices()
                found.append(Outlined(state.counts, state.committed, vertices, time))
                rows += 1 + len(record.rows)
                size += 0 if vertices is before else vertices.nbytes
            return found

        found: list[Outlined] = await self._onwards(live, state.counts.revision, work)
        return found

    async def tracker(self, live: LiveHull, keys: Keys, revision: int) -> Tracker:
        """What follows some keys of a hull, from a state not after a revision up to that revision.

        Raises:
            LimitExceededError: it would take too many rows.
            RevisionForgottenError: what it takes is not kept any more.
        """

        def begin() -> tuple[Tracker, int]:
            at, rows, contents = self._past.key_state(live.number, keys, revision)
            return Tracker(live.settings, len(keys), rows, contents), at

        tracker, at = await self._onwards(live, revision, begin)
        while at < revision:
            at, _ = await self.track(live, keys, tracker, at, revision)
        found: Tracker = tracker
        return found

    async def track(
        self, live: LiveHull, keys: Keys, tracker: Tracker, after: int, until: int, rows: int = 0
    ) -> tuple[int, Moves]:
        """Follow them through some batches after a revision. Returns the last revision of these, and the moves.

        `rows` is the number of rows that the reader had so far.
        """

        def step() -> tuple[int, Moves]:
            last, changes = self._past.key_changes(live.number, keys, after, until)
            self._require_room(rows + len(changes))
            return last, tracker.moves(changes)

        found: tuple[int, Moves] = await self._onwards(live, after, step)
        return found

    async def _onwards(self, live: LiveHull, after: int, read: Callable[[], Any]) -> Any:
        """Read what follows a revision, or raise RevisionForgottenError if it is not kept any more."""
        try:
            return await self.ask(live.name, read)
        except NotStoredError:
            oldest = await self.oldest(live)
            if oldest.revision > after:
                raise _forgotten(live.counts.revision, after + 1, oldest, "start_revision") from None
            raise

    async def follow(self, state: HullState, records: Sequence[Record]) -> None:
        """Apply batches to a state that the caller has for himself."""
        work = partial(state.catch_up, records, self._driver.machine.clock.monotonic())
        moved = any(each.center is not None for each in records)
        if sum(1 + len(each.rows) for each in records) + moved * state.counts.points <= SMALL:
            work()
        else:
            await self._driver.rebuild(work)
        self._require_room(state.counts.points)

    async def _reach(self, hull: Hull, revision: int) -> _Rebuilt:
        """A hull at a revision, from a kept one or anew."""
        rebuilt = self._take(hull, revision)
        self.outcomes["anew" if rebuilt is None else "kept"] += 1
        ahead: list[Record] = []
        at = NEWEST  # the revision that is there
        while rebuilt is None or rebuilt.state.counts.revision < revision:
            try:
                if rebuilt is None:
                    erasures, at = await self._where_to_begin(hull, revision)
                    rebuilt, ahead = await self._begin(hull, revision, erasures, at)
                else:
                    at = rebuilt.state.counts.revision
                    ahead = await self._step(rebuilt, ahead, revision)
            except _ErasedMeanwhileError:
                rebuilt, at = None, NEWEST
            except NotStoredError:
                oldest: Moment = await self.ask(hull.name, partial(self._past.oldest_moment, hull.row.number))
                if oldest.revision > revision:
                    raise _forgotten(hull.counts.revision, revision, oldest, "at_revision") from None
                if at >= oldest.revision:
                    raise
                rebuilt, at = None, NEWEST  # what followed it has been dropped meanwhile: a newer state leads there
        return rebuilt

    async def _where_to_begin(self, hull: Hull, revision: int) -> tuple[tuple[Erasure, ...], int]:
        """The erasures from the past of a hull, and the revision of the newest state that leads to another one."""
        number = hull.row.number
        found: tuple[tuple[Erasure, ...], int] = await self.ask(
            hull.name, lambda: (self._past.erasures(number), self._past.state_revision(number, revision))
        )
        return found

    async def _begin(
        self, hull: Hull, revision: int, erasures: tuple[Erasure, ...], at: int
    ) -> tuple[_Rebuilt, list[Record]]:
        """A hull from a stored state and some batches after it, which are read while the state is read and loaded.

        And others after these, which are read while the hull is built of both. The state is that of revision `at`, or,
        if that one turns out to be damaged, an older one.
        """
        number, round_, settings = hull.row.number, self.erasures, hull.row.settings
        limits, now = self._driver.limits, self._driver.machine.clock.monotonic()

        def load() -> tuple[Kept, int, LiveContents]:
            kept, parts = self._past.state(number, revision)
            self._require_room(parts.count)
            if not kept.revision:
                kept.committed = created(hull.row)
            return kept, parts.count, begun(kept, settings, limits.points_of(settings), parts)

        def read() -> list[Record]:
            found: list[Record] = []
            after = at
            for _ in range(AHEAD):
                if after >= revision or sum(len(each.rows) for each in found) >= AHEAD_ROWS:
                    break
                found += self._gathered(number, after, revision, erasures)
                after = found[-1].revision
            return found

        (kept, points, contents), records = await self._both(hull.name, load, read)
        if kept.revision == at:
            kept.records = records
        rows = points + sum(1 + len(each.rows) for each in kept.records)
        self._require_room(rows)
        last = kept.last_revision
        build = partial(state_of, limits, settings, kept, now, contents)
        onwards = partial(self._gathered, number, last, revision, erasures) if last < revision else None
        state, following = await self._both(hull.name, build, onwards)
        return _Rebuilt(hull, state, rows, erasures, round_), following

    async def _both(
        self, name: str, work: Callable[[], Any], read: Callable[[], list[Record]] | None
    ) -> tuple[Any, list[Record]]:
        """What two functions return, that have a thread each; the second one may be none."""
        works = [self.ask(name, each) for each in (work, read) if each is not None]
        found: list[Any] = await asyncio.gather(*works, return_exceptions=True)
        for each in found:
            if isinstance(each, BaseException):
                raise each
        return found[0], found[1] if read is not None else []

    def _gathered(self, number: int, after: int, until: int, erasures: tuple[Erasure, ...]) -> list[Record]:
        """What the next batches come to, for a state that was read when these were the erasures."""
        found = self._past.gathered(number, after, until)
        if erased_since(erasures, self._past.erasures(number)):
            raise _ErasedMeanwhileError
        return found

    async def _step(self, rebuilt: _Rebuilt, records: list[Record], revision: int) -> list[Record]:
        """Apply the next batches, those that have been read if there are some. Returns others, read meanwhile."""
        state, name = rebuilt.state, rebuilt.hull.name

        def read(after: int) -> list[Record]:
            return self._gathered(rebuilt.hull.row.number, after, revision, rebuilt.erasures)

        if not records:
            records = await self.ask(name, partial(read, state.counts.revision))
        rebuilt.rows += sum(1 + len(each.rows) for each in records)
        self._require_room(rebuilt.rows)
        last = records[-1].revision
        apply = partial(state.catch_up, records, self._driver.machine.clock.monotonic())
        _, following = await self._both(name, apply, partial(read, last) if last < revision else None)
        return following

    def require_room(self, hulls: Sequence[Hull]) -> None:
        """Raise LimitExceededError, which says why, if hulls that one reader has have too many points together."""
        points = sum(hull.state.counts.points for hull in hulls)
        if points > self._max_rows:
            named = [f"{hull.name!r} at revision {hull.state.counts.revision}" for hull in hulls[:2]]
            which = " and ".join([*named, *([f"{len(hulls) - 2} others"] if len(hulls) > 2 else [])])
            raise LimitExceededError("max_past_rows", self._max_rows, f"{points} points of {which}")

    def _require_room(self, rows: int) -> None:
        if rows > self._max_rows:
            raise LimitExceededError("max_past_rows", self._max_rows)

    def _take(self, hull: Hull, revision: int) -> _Rebuilt | None:
        """The rebuilt hull from which the revision is nearest, which nobody else has from now on."""
        self._kept = [each for each in self._kept if not each.hull.ended]
        near = [
            each
            for each in self._kept
            if each.hull is hull and 0 <= revision - each.state.counts.revision <= max(NEAR, each.state.counts.points)
        ]
        if not near:
            return None
        found = max(near, key=lambda each: each.state.counts.revision)
        self._kept.remove(found)
        found.rows = found.state.counts.points
        return found

    def forget(self) -> None:
        """Forget what was rebuilt: keys have been erased that it may have."""
        self.erasures += 1
        self._kept.clear()

    def _keep(self, rebuilt: _Rebuilt) -> None:
        if rebuilt.state.torn or rebuilt.round != self.erasures:
            return
        rebuilt.rows = rebuilt.state.counts.points
        self._kept.append(rebuilt)
        while len(self._kept) > MOST_KEPT or sum(each.rows for each in self._kept) > self._max_rows:
            del self._kept[0]

    def _require_past(self, live: LiveHull) -> None:
        """Raise HullUnsuitableError if nothing is kept of the past of a hull."""
        if not self._keeps:
            raise HullUnsuitableError(live.name, "has no past: this server keeps no batches")
        if isinstance(live, DividedHull):
            raise HullUnsuitableError(live.name, "is divided among shards, and only its present can be read")

    async def _settled(self, time: int, field: str) -> None:
        """Wait until no commit can come any more that has this time or an earlier one."""
        if time >= self._driver.commit_time():
            raise MomentForgottenError(time, None, None, None, field=f"{field}time")
        if time >= self._driver.published.time:
            await self._driver.settled()

    async def ask(self, name: str, function: Callable[[], Any]) -> Any:
        """The value of a function of the past of a hull, or the refusal of who cannot be told."""
        try:
            return await self._driver.rebuild(function)
        except KeyError:
            raise HullNotFoundError(name) from None
        except UNREADABLE as error:
            self.outcomes["unreadable"] += 1
            raise past_refusal(error) from error

    async def holes(self) -> list[Hole]:
        """What of the past of hulls could not be read when it was last needed."""
        found: list[Hole] = await self._driver.rebuild(self._past.holes)
        return found


def _forgotten(newest: int, revision: int, oldest: Moment, field: str) -> RevisionForgottenError:
    at = None if oldest.committed is None else oldest.committed.time
    return RevisionForgottenError(revision, oldest.revision, newest, at, field)


class PastHull(LiveHull):
    """A hull at one revision of the past, for readers: it never changes.

    Args:
        live: the hull.
        pasts: rebuilds it.
        place: holds a place of those who may rebuild at the same time.
        moment: the revision.
    """

    def __init__(
        self,
        driver: Driver,
        hull: Hull,
        recalls: Recalls,
        fences: Fences,
        copies: asyncio.Semaphore,
        pasts: PastHulls,
        place: Place,
        moment: Moment,
    ) -> None:
        super().__init__(driver, hull, recalls, fences, copies)
        self._pasts = pasts
        self._place = place
        self._revision = moment.revision
        self._counts: Counts | None = None
        self._stamp = moment.committed
        self._erased = moment.erased
        self._size = 0

    async def begin(self) -> None:
        """Rebuild it once, so that its counts are known."""

        def look(state: HullState) -> None:
            self._counts, self._stamp, self._size = state.counts, state.committed, state.vertex_count

        with self._place():
            async with self._pasts.state(self._hull, self._revision) as state:
                look(state)

    @property
    def counts(self) -> Counts:
        """The counts at its revision."""
        assert self._counts is not None  # it has begun
        return self._counts

    @property
    def committed(self) -> CommitStamp | None:
        """The commit of its revision; None where it is not known."""
        return self._stamp

    @property
    def erased(self) -> bool:
        """Whether it may lack keys that were erased from its past."""
        return self._erased

    @property
    def vertex_count(self) -> int:
        """The number of its vertices."""
        return self._size

    async def read(self, function: Callable[[HullState], T], rows: int = 0, min_revision: int = 0) -> tuple[Counts, T]:
        """Call `function` with the state at its revision."""
        await self.reached(min_revision)
        with self._place():
            async with self._pasts.state(self._hull, self._revision) as state:
                work = partial(function, state)
                return state.counts, work() if rows <= SMALL else await self._driver.aside(work)

    def fences(self, prefixes: tuple[str, ...] = ("",)) -> list[Fence]:
        """None: fences compare the present."""
        del prefixes
        return []
