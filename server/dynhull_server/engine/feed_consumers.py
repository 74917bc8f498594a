"""The consumers of feeds: where each begins, what it acknowledges, and how far it is behind."""

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from ..state.changes import FeedChange
from ..state.core import not_stored
from ..state.errors import (
    ConsumerNotFoundError,
    HullNotFoundError,
    HullReplacedError,
    LimitExceededError,
    NotStoredError,
    OutcomeUnknownError,
    PositionForgottenError,
    RevisionForgottenError,
    words_for_callers,
)
from ..state.feed_consumers import ConsumerId, DropFeedConsumer, FedBy, FeedConsumer, PutFeedConsumer
from ..storage.port import NotCommittedError, Storage
from .driver import Driver
from .feed import HullFeeds
from .live_hull import LiveHull
from .outliving import Outliving
from .positions import BEGINNING, Standing
from .recalls import UNREADABLE

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class ConsumerState:
    """A consumer, and how far it is behind.

    Attributes:
        consumer: the consumer.
        backlog: of a hull, the batches that it has not acknowledged; of a prefix, the commits since then.
        lost: of a hull, those of the backlog that are kept no more.
        replaced: whether what it has acknowledged is of another hull, or of other data.
    """

    consumer: FeedConsumer
    backlog: int = 0
    lost: int = 0
    replaced: bool = False


class FeedConsumers:
    """The consumers of the feeds of a server.

    Each changes in its turn, also for callers that go away. After a commit with an unknown outcome a consumer is read
    from the storage before anybody relies on it.

    Args:
        driver: commits.
        storage: keeps them.
        feeds: knows what is kept of hulls.
        get: finds a hull by its name; raises HullNotFoundError.
        newest: how far what is published has come, and the number of the last commit with a batch.
    """

    def __init__(
        self,
        driver: Driver,
        storage: Storage,
        feeds: HullFeeds,
        get: Callable[[str], LiveHull],
        newest: Callable[[], tuple[Standing, int]],
    ) -> None:
        self._driver = driver
        self._storage = storage
        self._feeds = feeds
        self._get = get
        self._newest = newest
        self._there: dict[ConsumerId, FeedConsumer] = {}
        self._creating = 0
        self._unsure: set[ConsumerId] = set()
        self._turns: dict[ConsumerId, tuple[asyncio.Lock, list[None]]] = {}
        self._working = Outliving()

    def __len__(self) -> int:
        return len(self._there)

    def restore(self, consumers: Iterable[FeedConsumer]) -> None:
        """Begin with those that the storage has kept."""
        self._there = {each.id: each for each in consumers}

    async def revision(self, hull: LiveHull, name: str) -> int:
        """The revision after which a consumer reads a hull. A new one is created, with all that is kept.

        Raises:
            HullReplacedError: what it has acknowledged is of another hull.
        """
        self._feeds.require_fed(hull)
        ident = ConsumerId(FedBy(hull.name), name)
        known = await self._in_turn(ident, lambda: self._known_or_put(FeedConsumer(ident, hull.uid, 0)))
        if known.uid != hull.uid:
            raise HullReplacedError(hull.name, hull.uid, "consumer")
        return known.acknowledged

    async def place(self, prefix: str, name: str) -> Standing:
        """How far a consumer is in the feed of a prefix. A new one is created, at the beginning.

        Raises:
            PositionForgottenError: what it has acknowledged is of other data.
        """
        self._feeds.require_kept(f"{prefix}*")
        ident = ConsumerId(FedBy(prefix, True), name)
        now, _ = self._newest()
        known = await self._in_turn(ident, lambda: self._known_or_put(_at(ident, BEGINNING, now)))
        if known.uid != str(now.incarnation):
            raise PositionForgottenError
        return standing_of(known)

    async def acknowledge(self, name: str, of: str, uid: str, revision: int) -> ConsumerState:
        """Acknowledge the batches of a hull up to a revision, for a consumer, which is created if it is new.

        Args:
            name: the consumer.
            of: the hull.
            uid: that of the hull with the revision; empty for that of the consumer.
            revision: the revision.

        Raises:
            HullNotFoundError: there is no such hull.
            HullReplacedError: the revision is of another one.
            RevisionForgottenError: the hull has not reached the revision.
        """
        hull = self._get(of)
        self._feeds.require_fed(hull)
        ident = ConsumerId(FedBy(of), name)

        async def put() -> FeedConsumer:
            known = self._there.get(ident)
            mine = uid or (hull.uid if known is None else known.uid)
            if mine != hull.uid:
                raise HullReplacedError(of, hull.uid, "uid" if uid else "consumer")
            if revision > hull.counts.revision:
                raise RevisionForgottenError(revision, 0, hull.counts.revision, field="revision")
            return await self._advance(FeedConsumer(ident, hull.uid, revision))

        return await self.state(await self._in_turn(ident, put))

    async def acknowledge_many(self, name: str, prefix: str, standing: Standing) -> ConsumerState:
        """Acknowledge the batches of a prefix up to a standing, for a consumer, which is created if it is new.

        Raises:
            PositionForgottenError: the standing is of other data.
        """
        self._feeds.require_kept(f"{prefix}*")
        settled = await self._feeds.settled()
        now, _ = self._newest()
        if standing.number and (standing.incarnation != now.incarnation or standing.number > settled.number):
            raise PositionForgottenError
        ident = ConsumerId(FedBy(prefix, True), name)
        consumer = _at(ident, standing, now)
        return await self.state(await self._in_turn(ident, lambda: self._advance(consumer)))

    async def delete(self, ident: ConsumerId) -> None:
        """Delete a consumer, or raise ConsumerNotFoundError."""

        async def drop() -> None:
            if ident not in self._there:
                raise ConsumerNotFoundError(shown(ident.feed), ident.name, "feed of")
            await self._commit(ident, DropFeedConsumer(ident))
            del self._there[ident]

        await self._in_turn(ident, drop)

    def page(
        self, prefix: str, after: ConsumerId | None, size: int, may: Callable[[str], bool]
    ) -> tuple[list[FeedConsumer], bool]:
        """Consumers in order, of what begins with a prefix and may be read, and whether there are more."""
        idents = sorted(
            each
            for each in self._there
            if each.feed.name.startswith(prefix) and may(each.feed.name) and (after is None or each > after)
        )
        return [self._there[each] for each in idents[:size]], len(idents) > size

    async def state(self, consumer: FeedConsumer) -> ConsumerState:
        """How far a consumer is behind, or raise NotStoredError."""
        backlog = self.backlog(consumer)
        if backlog is None:
            return ConsumerState(consumer, replaced=True)
        lost = 0
        if backlog and not consumer.id.feed.prefix:
            try:
                oldest = await self._feeds.oldest(self._get(consumer.id.feed.name))
            except HullNotFoundError:
                return ConsumerState(consumer, replaced=True)
            lost = max(oldest.revision - consumer.acknowledged, 0)
        return ConsumerState(consumer, backlog, lost)

    def backlog(self, consumer: FeedConsumer) -> int | None:
        """What a consumer has not acknowledged; None if what it has is of another hull, or of other data. O(1)."""
        if consumer.id.feed.prefix:
            now, newest = self._newest()
            return None if consumer.uid != str(now.incarnation) else max(newest - consumer.acknowledged, 0)
        try:
            hull = self._get(consumer.id.feed.name)
        except HullNotFoundError:
            return None
        return None if consumer.uid != hull.uid else max(hull.counts.revision - consumer.acknowledged, 0)

    def backlogs(self) -> Sequence[tuple[ConsumerId, int]]:
        """The consumers that have a backlog, or none at present, with its size."""
        found = [(ident, self.backlog(consumer)) for ident, consumer in self._there.items()]
        return [(ident, backlog) for ident, backlog in found if backlog is not None]

    async def _known_or_put(self, new: FeedConsumer) -> FeedConsumer:
        return self._there.get(new.id) or await self._put(new)

    async def _advance(self, consumer: FeedConsumer) -> FeedConsumer:
        """Put a consumer, unless it has acknowledged that already, of the same hull or data."""
        known = self._there.get(consumer.id)
        if known is not None and known.uid == consumer.uid and known.acknowledged >= consumer.acknowledged:
            return known
        return await self._put(consumer)

    async def _put(self, consumer: FeedConsumer) -> FeedConsumer:
        new = consumer.id not in self._there
        most = self._driver.limits.max_feed_consumers
        if new and len(self._there) + self._creating >= most:
            raise LimitExceededError("max_feed_consumers", most)
        self._creating += new
        try:
            await self._commit(consumer.id, PutFeedConsumer(consumer))
        finally:
            self._creating -= new
        self._there[consumer.id] = consumer
        return consumer

    async def _commit(self, ident: ConsumerId, change: FeedChange) -> None:
        try:
            await self._driver.commit([change])
        except NotCommittedError as error:
            raise not_stored(error) from error
        except Exception as error:
            self._unsure.add(ident)
            raise OutcomeUnknownError(words_for_callers(error)) from error

    async def _in_turn(self, ident: ConsumerId, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Do work on a consumer that nothing else changes meanwhile. A caller that goes away does not end it."""
        return await self._working.run(self._work(ident, work))

    async def _work(self, ident: ConsumerId, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        async with self._turn(ident):
            if ident in self._unsure:
                await self._read(ident)
            return await work()

    async def _read(self, ident: ConsumerId) -> None:
        try:
            stored = await self._driver.on_disk(self._storage.feed_consumers)
        except UNREADABLE as error:
            raise NotStoredError(words_for_callers(error)) from error
        self._there.pop(ident, None)
        self._there.update((each.id, each) for each in stored if each.id == ident)
        self._unsure.discard(ident)

    @asynccontextmanager
    async def _turn(self, ident: ConsumerId) -> AsyncIterator[None]:
        lock, users = self._turns.setdefault(ident, (asyncio.Lock(), []))
        users.append(None)
        try:
            async with lock:
                yield
        finally:
            users.pop()
            if not users:
                del self._turns[ident]


def shown(feed: FedBy) -> str:
    """A hull, or a prefix, for people."""
    return f"{feed.name}*" if feed.prefix else feed.name


def standing_of(consumer: FeedConsumer) -> Standing:
    """What a consumer of a prefix has acknowledged."""
    if not consumer.acknowledged:
        return BEGINNING
    return Standing(int(consumer.uid), consumer.acknowledged, consumer.time)


def _at(ident: ConsumerId, standing: Standing, now: Standing) -> FeedConsumer:
    """A consumer of a prefix of the present data."""
    return FeedConsumer(ident, str(now.incarnation), standing.number, standing.time)
