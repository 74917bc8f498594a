"""The feed of many hulls: the batches of all that have a prefix, in the order of their commits.

As in the feed of one hull, a reader has no queue. It remembers the commit that it has been sent last, and merges what
the hulls that have changed since then have in the past.
"""

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, Callable, Iterator
from contextlib import aclosing
from dataclasses import dataclass, field
from heapq import heapify, heappop, heapreplace
from typing import NamedTuple

from ..state.errors import HullNotFoundError, NotStoredError, PositionForgottenError
from ..state.records import CommitStamp, Record
from .feed import HullFeeds
from .live_hull import LiveHull
from .positions import Standing, encode_standings
from .roster import Roster, RosterEntry

# Points and batches that are sent together, about; and more of one commit, which has no position until its end.
POINTS_TOGETHER, BATCHES_TOGETHER, POINTS_OF_A_COMMIT = 8192, 1024, 32_768
# Points that are read ahead, of all hulls together.
MOST_AHEAD = 2**17
# Names that are sent together.
NAMES_TOGETHER = 4096
BEGINNING = CommitStamp(0, 0)


class OfHull(NamedTuple):
    """A hull, and one before or after it that has the same name has another uid."""

    name: str
    uid: str


class FedBatch(NamedTuple):
    """A batch; `more` says that the next one was committed together with it."""

    hull: OfHull
    record: Record
    more: bool


class Gap(NamedTuple):
    """Batches that are kept no more. Where it is not known which of them were sent, from revision 1 on."""

    hull: OfHull
    first: int
    last: int


@dataclass(slots=True)
class ManyFeedPart:
    """What is sent at once.

    Attributes:
        batches: the batches, in order.
        gaps: the batches that are kept no more. Before the others.
        gone: the hulls that were deleted, with what was not sent of them. Before the others.
        there: hulls that there are, while the feed begins; None afterwards.
        position: that of all so far; empty in the middle of a commit, and while the feed begins.
    """

    batches: list[FedBatch] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    gone: list[OfHull] = field(default_factory=list)
    there: list[OfHull] | None = None
    position: bytes = b""
    points: int = 0

    def __bool__(self) -> bool:
        return bool(self.batches or self.gaps or self.gone)


@dataclass(slots=True, eq=False)
class _Source:
    """A hull that is followed: its revision that was sent last, None until that is looked for; and what is next."""

    live: LiveHull
    after: int | None = None
    ahead: deque[Record] = field(default_factory=deque)

    @property
    def hull(self) -> OfHull:
        return OfHull(self.live.name, self.live.uid)


class PrefixFeed:
    """The feed of one reader.

    Args:
        feeds: reads the batches of each hull.
        get: finds a hull by its name; raises HullNotFoundError.
        roster: the hulls.
        incarnation: that of the present data.
    """

    def __init__(self, feeds: HullFeeds, get: Callable[[str], LiveHull], roster: Roster, incarnation: int) -> None:
        self._feeds = feeds
        self._get = get
        self._roster = roster
        self._incarnation = incarnation
        self._sources: dict[str, _Source] = {}
        self._sent = BEGINNING
        self._part = ManyFeedPart()
        self._erasures = feeds.erasures
        self._begun = False

    async def follow(
        self, start: Standing | None, progress_interval: float | None = None
    ) -> AsyncGenerator[ManyFeedPart, None]:
        """The batches after a standing, those that are kept and then new ones; None for those that are new.

        Args:
            start: how far the reader is; number 0 for the beginning, whatever the incarnation.
            progress_interval: seconds without a batch after which an empty part comes; None for never.

        Raises:
            PositionForgottenError: the standing is of other data.
            NotStoredError: the storage cannot be read.
        """
        with self._roster.following() as key:
            async with aclosing(self._follow(key, start, progress_interval)) as parts:
                async for part in parts:
                    yield part

    async def _follow(
        self, key: object, start: Standing | None, progress_interval: float | None
    ) -> AsyncGenerator[ManyFeedPart, None]:
        settled = await self._feeds.settled()
        self._begin(start, settled)
        roster = self._roster
        version, waiting = roster.version, {entry.name for entry in roster.entries() if self._is_news(entry)}
        there = [self._source(entry.name).hull for entry in roster.entries()]
        self._begun = True
        for first in range(0, max(len(there), 1), NAMES_TOGETHER):
            last = first + NAMES_TOGETHER >= len(there)
            yield ManyFeedPart(there=there[first : first + NAMES_TOGETHER], position=self._position() if last else b"")
        while True:
            failure: NotStoredError | None = None
            async with aclosing(self._merged(waiting, settled)) as parts:
                try:
                    async for part in parts:
                        yield part
                except NotStoredError as error:
                    failure = error
            if failure is not None:
                await self._without_erased()
                for part in self._before_a_hole():
                    yield part
                raise failure
            self._sent = settled
            await self._without_erased()
            if self._part:
                self._part.position = self._position()
                yield self._part
            self._part = ManyFeedPart()
            roster.heard(key, version)
            # Those whose newest batch came after what was settled come again: by now it is.
            waiting = {name for name in waiting if (entry := roster.get(name)) is not None and self._is_news(entry)}
            while not waiting and roster.version <= version:
                try:
                    async with asyncio.timeout(progress_interval):
                        await roster.beyond(version, roster.generation)
                except TimeoutError:
                    yield ManyFeedPart(position=self._position())
            settled = await self._feeds.settled()
            changed, version = roster.after(version), roster.version
            waiting |= {entry.name for entry in changed if entry.gone or entry.new or self._is_news(entry)}

    def _begin(self, start: Standing | None, settled: CommitStamp) -> None:
        """Begin there; raises PositionForgottenError."""
        if start is None:
            self._sent = settled
        elif start.number:
            if start.incarnation != self._incarnation or start.number > settled.number:
                raise PositionForgottenError
            self._sent = CommitStamp(start.number, start.time)

    def _is_news(self, entry: RosterEntry) -> bool:
        """Whether a hull has a batch that was not sent."""
        if entry.commit is None:  # of formats that did not store it
            return self._sent.number == 0 and not entry.new
        return not entry.new and entry.commit.number > self._sent.number

    def _position(self) -> bytes:
        return encode_standings([Standing(self._incarnation, *self._sent)])

    def _source(self, name: str) -> _Source:
        """The hull of a name, as it is followed; raises HullNotFoundError."""
        live = self._get(name)
        known = self._sources.get(name)
        if known is None or known.live.number != live.number:
            if known is not None:
                self._end(known)
            known = self._sources[name] = _Source(live, 0 if self._begun else None)
        return known

    def _end(self, source: _Source) -> None:
        """Say that a hull is gone."""
        del self._sources[source.live.name]
        self._part.gone.append(source.hull)

    async def _merged(self, names: set[str], settled: CommitStamp) -> AsyncGenerator[ManyFeedPart, None]:
        """The batches of some hulls up to a commit, in the order of their commits; the last part stays."""
        share = MOST_AHEAD // max(len(names), 1)
        order: list[tuple[int, str]] = []
        for name in sorted(names):
            number = await self._following(name, share)
            if number is not None and number <= settled.number:
                order.append((number, name))
        heapify(order)
        while order:
            await self._without_erased()
            number, name = order[0]
            source = self._sources.get(name)
            if source is not None and not source.ahead:
                await self._following(name, None)
                source = self._sources.get(name)
            if source is None or not source.ahead:  # it is gone, or what there was is
                heappop(order)
                continue
            record = source.ahead.popleft()
            source.after = record.revision
            try:
                following = await self._following(name, share)
            except NotStoredError:  # which may have more of this commit
                self._part.batches.append(FedBatch(source.hull, record, more=True))
                raise
            if following is not None and following <= settled.number:
                heapreplace(order, (following, name))
            else:
                heappop(order)
            more = bool(order) and order[0][0] == number
            part = self._part
            part.batches.append(FedBatch(source.hull, record, more))
            part.points += 1 + len(record.rows)
            if not more and record.committed is not None:
                self._sent = record.committed
            enough = part.points >= POINTS_TOGETHER or len(part.batches) >= BATCHES_TOGETHER
            if part.points >= POINTS_OF_A_COMMIT or (enough and not more):
                await self._without_erased()
                part.position = b"" if more else self._position()
                self._part = ManyFeedPart()
                yield part
        for name in names & self._sources.keys():
            self._sources[name].ahead.clear()  # it is read again

    async def _without_erased(self) -> None:
        """Read again what was read before keys were erased from the past of a hull. Raises NotStoredError."""
        while self._erasures != self._feeds.erasures:
            self._erasures = self._feeds.erasures
            for source in self._sources.values():
                source.ahead.clear()
            batches, self._part.batches = self._part.batches, []
            try:
                found = [each for batch in batches for each in await self._again(batch)]
            except NotStoredError:
                self._part = ManyFeedPart()  # the reader begins again after the one before
                raise
            after = [*(_number(each.record) for each in found[1:]), None]
            if batches and batches[-1].more:
                after[-1] = _number(batches[-1].record)
            self._part.batches = [
                each._replace(more=_number(each.record) == number) for each, number in zip(found, after, strict=False)
            ]

    async def _again(self, batch: FedBatch) -> list[FedBatch]:
        """The batch as it is now; none if the hull is gone."""
        source = self._sources.get(batch.hull.name)
        if source is None or source.hull != batch.hull:
            return []
        try:
            record = await self._feeds.batch(source.live, batch.record.revision)
        except HullNotFoundError:
            return []
        return [batch._replace(record=record)]

    def _before_a_hole(self) -> Iterator[ManyFeedPart]:
        """What has been read: whole commits, and without a position those batches of one of which there may be more."""
        part, self._part = self._part, ManyFeedPart()
        whole = next((place for place in range(len(part.batches), 0, -1) if not part.batches[place - 1].more), 0)
        rest = ManyFeedPart(part.batches[whole:])
        del part.batches[whole:]
        part.position = self._position()
        yield from (each for each in (part, rest) if each)

    async def _following(self, name: str, share: int | None) -> int | None:
        """The number of the commit of the next batch of a hull, None for none; `share` as in `_read`."""
        try:
            source = self._source(name)
            if not source.ahead:
                return await self._read(source, share)
        except HullNotFoundError:
            if name in self._sources:
                self._end(self._sources[name])
            return None
        return _number(source.ahead[0])

    async def _read(self, source: _Source, share: int | None) -> int | None:
        """Read what is next of a hull, as many points as its share has; without one, a batch at least."""
        live = source.live
        if source.after is None:
            source.after, lost = await self._feeds.sent_until(live, self._sent)
            if lost:
                self._part.gaps.append(Gap(source.hull, 1, source.after))
        if live.counts.revision <= source.after:
            return None
        found = await self._feeds.next(live, source.after)
        if found.lost is not None:
            self._part.gaps.append(Gap(source.hull, *found.lost))
            source.after = found.revision
            return await self._read(source, share)
        points = 0
        for record in found.records:
            points += 1 + len(record.rows)
            if points > MOST_AHEAD if share is None else points > share:
                break
            source.ahead.append(record)
        if share is None and not source.ahead:
            source.ahead.append(found.records[0])
        return _number(found.records[0])


def _number(record: Record) -> int:
    return 0 if record.committed is None else record.committed.number
