"""The feed of a hull: every batch, in order.

A reader has no queue. It remembers the last revision that it has sent, and reads the batches after it from the past,
the newest ones, too. A slow client costs no memory.
"""

import asyncio
from collections.abc import AsyncGenerator, Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from ..state.errors import (
    HullNotFoundError,
    HullUnsuitableError,
    NotStoredError,
    RevisionForgottenError,
)
from ..state.records import CommitStamp, Record
from ..storage.past import Moment, Past
from ..storage.port import DamagedError
from .divided_hull import DividedHull
from .driver import Driver
from .live_hull import LiveHull
from .past import PastHulls
from .recalls import UNREADABLE, past_refusal


@dataclass(slots=True)
class FeedPart:
    """What is sent at once.

    Attributes:
        revision: the revision that it leads to.
        records: the batches, in order.
        lost: the first and the last revision of batches that are kept no more, or None.
    """

    revision: int
    records: list[Record] = field(default_factory=list)
    lost: tuple[int, int] | None = None


class HullFeeds:
    """Reads the batches of hulls.

    Args:
        driver: has the threads.
        past: keeps the batches.
        pasts: knows when keys are erased from them.
        keeps: whether any are kept.
    """

    def __init__(self, driver: Driver, past: Past, pasts: PastHulls, *, keeps: bool) -> None:
        self._driver = driver
        self._past = past
        self._pasts = pasts
        self._keeps = keeps

    @property
    def erasures(self) -> int:
        """How often keys were erased from the past of any hull: what was read before may have them."""
        return self._pasts.erasures

    async def follow(
        self, hull: LiveHull, after: int | None, progress_interval: float | None = None
    ) -> AsyncGenerator[FeedPart, None]:
        """The batches of a hull after a revision, those that are kept and then new ones, until it is deleted.

        Args:
            hull: the hull.
            after: the last revision that the reader has; None for the newest.
            progress_interval: seconds without a batch after which an empty part comes; None for never.

        Raises:
            HullUnsuitableError: there is no feed of this hull.
            RevisionForgottenError: the hull has not reached that revision.
            HullNotFoundError: it is deleted.
            NotStoredError: the storage cannot be read.
        """
        self.require_fed(hull)
        newest = hull.counts.revision
        after = newest if after is None else after
        if after > newest:
            oldest = await self.oldest(hull)
            raise RevisionForgottenError(after, oldest.revision, newest, field="after_revision")
        yield FeedPart(after)  # the feed has begun
        while True:
            try:
                async with asyncio.timeout(progress_interval):
                    await hull.reached(after + 1)
            except TimeoutError:
                part = FeedPart(after)
            else:
                part = await self.next(hull, after)
            after = part.revision
            yield part

    async def oldest(self, hull: LiveHull) -> Moment:
        """The oldest revision of a hull that is kept. Raises HullNotFoundError or NotStoredError."""
        found: Moment = await self._ask(hull, self._past.oldest_moment)
        return found

    def require_kept(self, name: str) -> None:
        """Raise HullUnsuitableError, with this name, if no batches are kept."""
        if not self._keeps:
            raise HullUnsuitableError(name, "has no feed: this server keeps no batches")

    def require_fed(self, hull: LiveHull) -> None:
        """Raise HullUnsuitableError if there is no feed of a hull."""
        self.require_kept(hull.name)
        if isinstance(hull, DividedHull):
            raise HullUnsuitableError(hull.name, "is divided among shards, and has no feed")

    async def settled(self) -> CommitStamp:
        """A commit that is published as a whole, with all before it: the newest one. Raises NotStoredError."""
        return await self._driver.whole()

    async def sent_until(self, hull: LiveHull, commit: CommitStamp) -> tuple[int, bool]:
        """The last revision of a hull that was committed at or before a commit, and whether some after it are lost.

        If it is not kept, the oldest one that is.
        """
        if not commit.number:
            return 0, False
        found: Moment | None = await self._ask(hull, partial(_moment, self._past, commit.time))
        later = None if found is None else found.committed
        if found is not None and (later is None or later.number <= commit.number):
            return found.revision, False
        # Before the oldest one: what is dropped meanwhile is not taken for what formats before 11 have written.
        timed: Moment = await self._ask(hull, partial(self._past.oldest_moment, timed=True))
        oldest = await self.oldest(hull)
        if found is not None and later is not None:  # some of the same time are later: the clock has been set back
            before: Moment | None = await self._ask(hull, partial(_moment, self._past, later.time - 1))
            least = oldest.revision if before is None else before.revision
            try:
                sent = await self._last_of(hull, least, found.revision, commit.number)
            except NotStoredError:
                oldest = await self.oldest(hull)
                if oldest.revision <= least:
                    raise
                return oldest.revision, True
            if before is not None or sent > least:
                return sent, False
        if timed.revision > oldest.revision:  # formats before 11 have written those before it
            return timed.revision - 1, False
        return oldest.revision, oldest.revision > 0

    async def _last_of(self, hull: LiveHull, sent: int, later: int, number: int) -> int:
        """The last revision between two whose commit has no greater number; `sent` if there is none."""
        while later - sent > 1:
            middle = (sent + later) // 2
            (record,) = await self._ask(hull, partial(_batches, self._past, middle - 1, middle))
            if record.committed is None or record.committed.number <= number:
                sent = middle
            else:
                later = middle
        return sent

    async def next(self, hull: LiveHull, after: int) -> FeedPart:
        """What follows a revision that the hull has passed. Of a divided hull nothing is kept that can be sent."""
        newest = hull.counts.revision
        if isinstance(hull, DividedHull):
            return FeedPart(newest, lost=(after + 1, newest))
        try:
            records = await self._batches(hull, after, newest)
        except NotStoredError as error:
            if not isinstance(error.__cause__, DamagedError):
                raise
            oldest = await self.oldest(hull)
            if oldest.revision <= after:
                raise
            return FeedPart(oldest.revision, lost=(after + 1, oldest.revision))
        return FeedPart(records[-1].revision, records)

    async def batch(self, hull: LiveHull, revision: int) -> Record:
        """The batch that made a revision. Raises HullNotFoundError or NotStoredError."""
        (found,) = await self._batches(hull, revision - 1, revision)
        return found

    async def _batches(self, hull: LiveHull, after: int, until: int) -> list[Record]:
        """Some batches, without the keys that were erased before this returns."""
        while True:
            erasures = self.erasures
            found: list[Record] = await self._ask(hull, partial(_batches, self._past, after, until))
            if erasures == self.erasures:
                return found

    async def _ask(self, hull: LiveHull, function: Callable[[int], Any]) -> Any:
        try:
            return await self._driver.rebuild(partial(function, hull.number))
        except KeyError:
            raise HullNotFoundError(hull.name) from None
        except UNREADABLE as error:
            raise past_refusal(error) from error


def _moment(past: Past, time: int, number: int) -> Moment | None:
    return past.moment(number, time)


def _batches(past: Past, after: int, until: int, number: int) -> list[Record]:
    return past.batches(number, after, until)
