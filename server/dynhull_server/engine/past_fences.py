"""Fences after the fact: hulls are rebuilt as of a moment, and the batches after it are compared as when they came."""

from collections import deque
from collections.abc import AsyncGenerator, Callable, Iterator, Set
from functools import partial
from heapq import heapify, heappop, heappush
from typing import TypeVar

from ..state.contents.live import AnyKeyedHull
from ..state.errors import HullNotFoundError, HullUnsuitableError, NotStoredError, RevisionForgottenError
from ..state.fences.model.config import FenceConfig
from ..state.fences.model.records import FenceEvent, Key
from ..state.fences.past import PastFence, changes_of
from ..state.fences.sieve import Sieve, Sifted
from ..state.hull import Hull
from ..state.hull_state import HullState
from ..state.records import CommitStamp, HullRow, Record
from ..storage.past import Erasure, Moment, Past, erased_since
from ..storage.port import DamagedError
from .driver import Driver
from .fences import Fences
from .hulls import Hulls
from .past import PastHulls
from .watch_fence import EVENTS_TOGETHER

T = TypeVar("T")

# Rows of batches that one step applies, about: some milliseconds.
STEP_ROWS = 4096

# Hulls of which the points are counted after each commit; those of more hulls at the beginning of a step.
FEW_HULLS = 2

# A moment as it is asked for: a revision of the hull of the subjects; or None, and a time in microseconds since 1970.
When = tuple[int | None, int]


class _ReadHull(Hull):
    """A hull as it was, and what had been erased from its past before that was read."""

    def __init__(self, row: HullRow, state: HullState, erasures: tuple[Erasure, ...]) -> None:
        super().__init__(row, state)
        self.erasures = erasures


class _Batches:
    """The batches of one hull after a revision, read some at a time.

    Args:
        past: keeps them.
        hull: the hull, rebuilt as of that revision.
        until: the last one that counts.
    """

    def __init__(self, past: Past, hull: _ReadHull, until: int) -> None:
        self.hull = hull
        self._past = past
        self._until = until
        self._read: deque[Record] = deque()
        self._after = hull.state.counts.revision
        self._unsifted = 0  # the last revision of batches that were not sifted

    def commit(self) -> CommitStamp | None:
        """The commit of the next batch; None after the last. Reads the disk."""
        if not self._read and self._after < self._until:
            self._read.extend(self._whole(lambda number: self._past.batches(number, self._after, self._until)))
            self._after = self._read[-1].revision
        if not self._read:
            return None
        record = self._read[0]
        if record.committed is None:
            raise _without_time(self.hull.name, record.revision)
        return record.committed

    def sifted(self, sieve: Sieve, waiting: Set[Key]) -> tuple[int, Sifted] | None:
        """What may mean something of batches up to a revision, all of which are taken; None where each has to be."""
        if self._read or self._after >= self._until or self._after < self._unsifted:
            return None
        keyed = self.hull.state.hull
        assert isinstance(keyed, AnyKeyedHull)  # a fence compares its keys
        sift = partial(sieve.sift, keyed, waiting)
        last, found = self._whole(lambda number: self._past.ways(number, self._after, self._until, sift))
        if found is None:
            self._unsifted = last
            return None
        self._after = last
        return last, found

    def take(self) -> Record:
        """The next batch, once `commit` has found it."""
        return self._read.popleft()

    def catch_up(self, number: int) -> None:
        """Apply the batches up to a commit. They are few."""
        while (commit := self.commit()) is not None and commit.number <= number:
            self.hull.state.repeat(self.take())
        self.hull.counts = self.hull.state.counts

    def _whole(self, read: Callable[[int], T]) -> T:
        """What is read of the past of the hull, which nobody has changed before."""
        number, after = self.hull.row.number, self._after
        try:
            found = read(number)
            if erased_since(self.hull.erasures, self._past.erasures(number)):
                raise NotStoredError("keys were erased from the past meanwhile: begin again")
            return found
        except DamagedError:
            oldest = self._past.oldest_moment(number)
            if after >= oldest.revision:
                raise
            time = None if oldest.committed is None else oldest.committed.time
            raise RevisionForgottenError(after + 1, oldest.revision, self._until, time, "start_revision") from None


class _Run:
    """A fence, and the batches that it has still to compare.

    Args:
        pasts: bounds the points of its hulls.
        fence: the fence.
        batches: those of its hulls; of that of the subjects first.
        until: the time up to which time passes after the last batch; None for none.
        leads: whether the last batch of the subjects is the end.
    """

    def __init__(
        self, pasts: PastHulls, fence: PastFence, batches: list[_Batches], until: int | None, *, leads: bool
    ) -> None:
        self._pasts = pasts
        self._fence = fence
        self._batches = batches
        self._until = until
        self._leads = leads
        self._sieve = fence.sieve() if len(batches) == 1 else None
        self._following: Iterator[int] = iter(())
        # The commits that come next, each with the place of a hull that it has changed.
        self._coming: list[tuple[int, int]] | None = None
        self.over = False

    def step(self) -> list[FenceEvent]:
        """The next events, if some come soon."""
        fence, rows, made = self._fence, 0, self._fence.take()
        hulls = [each.hull for each in self._batches]
        while rows < STEP_ROWS and len(made) < EVENTS_TOGETHER:
            if len(hulls) <= FEW_HULLS or not rows:
                self._pasts.require_room(hulls)
            followed = self._follow()
            if followed:
                rows += followed
                made += fence.take()
                continue
            time, commit = self._next()
            if not commit:
                if self._until is not None:
                    fence.pass_time(self._until)
                self.over = True
                return made + fence.take()
            fence.pass_time(time)
            for change in changes_of(commit):
                fence.repeat(change, time)
            rows += sum(1 + len(record.rows) for records in commit.values() for record in records)
            made += fence.take()
        return made

    def _next(self) -> tuple[int, dict[Hull, list[Record]]]:
        """The next commit: its time, and the batches of each hull, in the order of these; none after the last."""
        if self._coming is None or self._sieve is not None:
            self._coming = [
                (first.number, place)
                for place, each in enumerate(self._batches)
                if (first := each.commit()) is not None
            ]
            heapify(self._coming)
        coming, found, time = self._coming, dict[Hull, list[Record]](), 0
        if not coming or (self._leads and self._batches[0].commit() is None):
            return time, found
        number, _ = coming[0]
        while coming and coming[0][0] == number:
            _, place = heappop(coming)
            each = self._batches[place]
            time = _take(each, number, found.setdefault(each.hull, []))
            if (following := each.commit()) is not None:
                heappush(coming, (following.number, place))
        return time, found

    def _follow(self) -> int:
        """Follow what was sifted, or sift what comes next. Returns the rows applied; 0 where each batch has to be."""
        followed = next(self._following, 0)
        if followed or self._sieve is None:
            return followed
        (batches,) = self._batches
        found = batches.sifted(self._sieve, self._fence.waiting)
        if found is None:
            return 0
        last, sifted = found
        self._following = self._fence.follow(batches.hull, sifted, last)
        return next(self._following, 0)


def _take(batches: _Batches, number: int, records: list[Record]) -> int:
    """Take the batches of a commit. Returns its time."""
    time = 0
    while (commit := batches.commit()) is not None and commit.number == number:
        time = commit.time
        records.append(batches.take())
    return time


class PastFences:
    """The events that fences would have made.

    Args:
        driver: has the threads.
        hulls: the hulls.
        past: keeps their batches.
        fences: checks areas.
    """

    def __init__(self, driver: Driver, hulls: Hulls, past: Past, fences: Fences) -> None:
        self._driver = driver
        self._hulls = hulls
        self._pasts = hulls.pasts
        self._past = past
        self._fences = fences

    async def events(
        self, config: FenceConfig, start: When | None, end: When | None
    ) -> AsyncGenerator[list[FenceEvent], None]:
        """The events between two moments, some at a time; at first none, once the fence is there.

        Args:
            config: the settings of the fence.
            start: when it is created; None for the oldest revision that is kept.
            end: when it ends; None for now.

        Raises:
            RefusedError: a fence with these settings would have been refused then, or a moment is not kept any more.
        """
        run, hulls = await self._begin(config, start, end)
        yield []
        while not run.over:
            for hull in hulls:
                if hull.ended:
                    raise HullNotFoundError(hull.name)
            made = deque(await self._pasts.ask(hulls[0].name, run.step))
            while made:
                yield [made.popleft() for _ in range(min(len(made), EVENTS_TOGETHER))]

    async def _begin(self, config: FenceConfig, start: When | None, end: When | None) -> tuple[_Run, list[Hull]]:
        if config.kind == "prefix":
            return await self._begin_many(config, start, end)
        names = dict.fromkeys((config.subjects, config.area_hull or config.subjects))
        hulls = [self._driver.core.get(name) for name in names]
        checked = await self._fences.checked(config)
        lasts, until = await self._end(hulls, end)
        began, own = await self._start(hulls, start)
        if lasts[0] < own[0].counts.revision:
            reason = f"was at revision {lasts[0]} at the end, before the start, {own[0].counts.revision}"
            raise HullUnsuitableError(config.subjects, reason, field="end")
        batches = [_Batches(self._past, hull, last) for hull, last in zip(own, lasts, strict=True)]
        leads = end is not None and end[0] is not None

        def begin() -> _Run:
            commit = _commit_of(own[0])
            if began is None:
                for each in batches[1:]:
                    each.catch_up(commit.number)
            fence = PastFence(config, own, commit.time if began is None else began, checked)
            return _Run(self._pasts, fence, batches, until, leads=leads)

        return await self._pasts.ask(config.subjects, begin), hulls

    async def _begin_many(self, config: FenceConfig, start: When | None, end: When | None) -> tuple[_Run, list[Hull]]:
        """A fence over the hulls with a prefix that there are. One that came later is empty at the beginning."""
        for field, when in (("start", start), ("end", end)):
            if when is not None and when[0] is not None:
                reason = "is a prefix, whose hulls have revisions of their own: give a time"
                raise HullUnsuitableError(config.subjects, reason, field=f"{field}_revision")
        await self._driver.whole()  # the creation of a hull may be in doubt
        compared = self._compared(config)
        area = None if config.area_hull is None else self._driver.core.get(config.area_hull)
        hulls = list(dict.fromkeys([*compared, *([] if area is None else [area])]))
        checked = await self._fences.checked(config)
        lasts, until = await self._end(hulls, end)
        oldest = [
            await self._pasts.ask(hull.name, partial(self._past.oldest_moment, hull.row.number, timed=True))
            for hull in hulls
        ]
        times = [0 if each.committed is None else each.committed.time for each in oldest]
        whole = [each.revision == 0 and hull is not area for hull, each in zip(hulls, oldest, strict=True)]
        began = start[1] if start is not None else _oldest_of_many(times, whole)
        own: list[_ReadHull] = []
        for hull, time, is_whole in zip(hulls, times, whole, strict=True):
            came_later = is_whole and time > began
            moment = Moment(0, None) if came_later else await self._moment(hull, (None, began), "start")
            own.append(await self._as_of(hull, moment))
            self._pasts.require_room(own)
        batches = [
            _Batches(self._past, hull, max(last, hull.counts.revision)) for hull, last in zip(own, lasts, strict=True)
        ]

        def begin() -> _Run:
            return _Run(self._pasts, PastFence(config, own, began, checked), batches, until, leads=False)

        return await self._pasts.ask(config.subjects, begin), hulls

    def _compared(self, config: FenceConfig) -> list[Hull]:
        """The keyed hulls with the prefix of a fence, by name."""
        prefix, hulls = config.subjects, self._driver.core.hulls
        found = [hulls[name] for name in hulls.irange(prefix, f"{prefix}\U0010ffff")]
        for hull in found:
            if hull.divided:
                raise HullUnsuitableError(hull.name, "is divided among shards, which no fence compares")
        keyed = [hull for hull in found if hull.row.settings.identity != "multiset"]
        if not keyed:
            raise HullUnsuitableError(prefix, "is a prefix of no keyed hull", field="config.subject_prefix")
        return keyed

    async def _start(self, hulls: list[Hull], start: When | None) -> tuple[int | None, list[_ReadHull]]:
        """The time at which it begins, and the hulls as they were then.

        None in place of the time if it begins at a revision: then the other hull is as it was at that or before.
        """
        if start is None:
            start = await self._oldest(hulls)
        first = await self._as_of(hulls[0], await self._moment(hulls[0], start, "start"))
        if start[0] is None:
            moments = [await self._moment(hull, start, "start") for hull in hulls[1:]]
            return start[1], [first, *[await self._as_of(*each) for each in zip(hulls[1:], moments, strict=True)]]
        time = _commit_of(first).time
        others = []
        for hull in hulls[1:]:
            await self._moment(hull, (None, time), "start")  # it was there
            before = await self._pasts.ask(hull.name, partial(self._past.moment, hull.row.number, time - 1))
            oldest = partial(self._past.oldest_moment, hull.row.number)
            others.append(await self._as_of(hull, before or await self._pasts.ask(hull.name, oldest)))
        return None, [first, *others]

    async def _end(self, hulls: list[Hull], end: When | None) -> tuple[list[int], int | None]:
        """The last revision that counts of each hull, and the time that passes after it; None for none."""
        if end is not None and end[0] is None:
            return [await self._last(hull, end) for hull in hulls], end[1]
        now = self._driver.commit_time()
        await self._driver.whole()
        newest = [hull.counts.revision for hull in hulls]
        if end is None:
            return newest, now
        return [(await self._moment(hulls[0], end, "end")).revision, *newest[1:]], None

    async def _last(self, hull: Hull, end: When) -> int:
        """The last revision of a hull at a time; 0 if it came later."""
        oldest: Moment = await self._pasts.ask(hull.name, partial(self._past.oldest_moment, hull.row.number))
        if oldest.revision == 0 and oldest.committed is not None and oldest.committed.time > end[1]:
            return 0
        return (await self._moment(hull, end, "end")).revision

    async def _oldest(self, hulls: list[Hull]) -> When:
        """The oldest moment at which all hulls are kept."""
        found = [
            await self._pasts.ask(hull.name, partial(self._past.oldest_moment, hull.row.number, timed=True))
            for hull in hulls
        ]
        if len(found) == 1:
            return found[0].revision, 0
        return None, max(0 if each.committed is None else each.committed.time for each in found)

    async def _moment(self, hull: Hull, when: When, field: str) -> Moment:
        return await self._pasts.moment(self._hulls.of(hull), *when, f"{field}_")

    async def _as_of(self, hull: Hull, moment: Moment) -> _ReadHull:
        found = _ReadHull(hull.row, *await self._pasts.own(hull, moment.revision))
        if hull.row.settings.geographic and found.state.center is None:
            await self._pasts.ask(hull.name, partial(self._stand_at_first_center, found, hull.counts.revision))
        return found

    def _stand_at_first_center(self, hull: _ReadHull, until: int) -> None:
        """Have a hull without points the centre that its first ones choose: a fence keeps its projection."""
        after = hull.state.counts.revision
        while after < until:
            records = self._past.batches(hull.row.number, after, until)
            center = next((record.center for record in records if record.center is not None), None)
            if center is not None:
                hull.state.stand_at(center)
                hull.counts = hull.state.counts
                return
            after = records[-1].revision


def _oldest_of_many(times: list[int], whole: list[bool]) -> int:
    """The oldest moment at which nothing is missing: that of the first hull, unless a past begins later."""
    begun = [time for time, is_whole in zip(times, whole, strict=True) if not is_whole]
    return max(begun) if begun else min(times)


def _commit_of(hull: Hull) -> CommitStamp:
    """The commit of a hull that was rebuilt."""
    if hull.state.committed is None:
        raise _without_time(hull.name, hull.state.counts.revision)
    return hull.state.committed


def _without_time(name: str, revision: int) -> HullUnsuitableError:
    return HullUnsuitableError(name, f"has revision {revision} of an earlier version, without a time: begin after it")
