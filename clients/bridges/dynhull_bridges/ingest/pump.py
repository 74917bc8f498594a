"""Moves the messages of one feed into hulls."""

import asyncio
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from time import monotonic
from typing import Any

import structlog

from dynhull_cli.counts import Counts
from dynhull_client import Applied, AsyncHullClient, DeadlineError, HullNotFoundError, UnavailableError

from ..waiting import Absence, unless
from .bad import BadMessages
from .chunk import Taken, chunks_of
from .feed import Beginning, DoubtfulError, Feed, FeedError, Message
from .figures import IngestFigures
from .identity import ANSWER, LogIdentity
from .lane import ChunkLane
from .mapping import Mapping, Row

log = structlog.get_logger("dynhull_ingest")
UNDER_WAY = 64  # reads that are not settled
KEEP_EVERY = 1.0  # seconds between notes of the place in a log
FIRST_PAUSE, LONGEST_PAUSE = 0.2, 30.0
DOUBT = 3.0  # seconds for which a broker may deny what is to be read: while it recovers it does
BROKER_AWAY = "no messages from the broker, trying again"


@dataclass(frozen=True, slots=True)
class Settings:
    """What an ingest does with messages.

    Attributes:
        mapping: reads rows from them.
        create: settings of hulls that do not exist; None to create none.
        to_end: whether to end once no message is left.
        patience: the seconds after which a broker that does not answer is given up; None for never.
        accept_gaps: whether to go on where the broker has removed messages before they were read.
        conditions: which keys are put, and when they leave: arguments of a put.
    """

    mapping: Mapping
    create: dict[str, Any] | None
    to_end: bool
    patience: float | None
    accept_gaps: bool = False
    conditions: dict[str, Any] = field(default_factory=dict)


class GapError(Exception):
    """The broker has removed messages before they were read."""


class Pump:
    """Reads a feed, sends the rows to their hulls, and notes at the broker what the server has acknowledged.

    A message is taken when all of its rows are acknowledged, or when it is kept aside as bad. Whatever is killed, the
    next pump begins at the first message that may not be taken; hulls drop what they have already, by its number.
    """

    def __init__(
        self,
        client: AsyncHullClient,
        server_away: Absence,
        feed: Feed,
        settings: Settings,
        bad: BadMessages,
        figures: IngestFigures,
    ) -> None:
        self.reached = 0  # the number of the last message read
        self.points = 0  # acknowledged
        self.counts = Counts()  # what became of them
        self.lost = 0  # messages, at most, that the broker removed before they were read
        self.at_end = False  # whether no message was left, and all were taken
        self.begun = self.ended = monotonic()  # when the first message was read, and the last point acknowledged
        self._client = client
        self._feed = feed
        self._settings = settings
        self._figures = figures
        self._bad = bad
        self._server_away = server_away
        self._broker_away = Absence(BROKER_AWAY, settings.patience, feed=feed.name)
        self._doubt = Absence(BROKER_AWAY, DOUBT, feed=feed.name)
        self._read_so_far = 0  # messages
        self._identity = LogIdentity(client, feed)
        self._was_there = False  # what the feed reads, now or for an ingest before
        self._lanes: dict[str, ChunkLane] = {}
        self._sending: list[asyncio.Task[None]] = []
        self._under_way: deque[Taken] = deque()
        self._news = asyncio.Event()
        self._room = asyncio.Event()
        self._noting = asyncio.Lock()
        figures.add(feed.name)

    @property
    def under_way(self) -> int:
        """The number of messages that are read and not settled."""
        return sum(len(each.messages) for each in self._under_way)

    @property
    def known(self) -> int:
        """The number of rows that the hulls had already."""
        return sum(each.known for each in self._lanes.values())

    async def run(self, stop: asyncio.Event) -> None:
        """Read until `stop`, or until no message is left if that is asked for; then wait for what is under way.

        Raises:
            ExceptionGroup: messages cannot be sent, or the feed is not what it was.
        """
        try:
            async with asyncio.TaskGroup() as group:
                self._group = group
                keeping = group.create_task(self._keeping())
                await self._read(stop)
                keeping.cancel()
                for each in self._sending:
                    each.cancel()
        finally:
            await self._feed.close()

    async def _read(self, stop: asyncio.Event) -> None:
        """One connection to the broker after another."""
        pause = FIRST_PAUSE
        while not stop.is_set():
            read = self._read_so_far
            try:
                await self._connection(stop)
            except FeedError as error:
                failure: Exception = error
                away = self._broker_away
                self._figures.restarts.labels(self._feed.name).inc()
                if isinstance(error, DoubtfulError) and not self._was_there:
                    away = self._doubt
                else:
                    self._doubt.ends()
            except (UnavailableError, DeadlineError) as error:
                failure = error
                away = self._server_away
            else:
                return
            pause = FIRST_PAUSE if self._read_so_far > read else min(2 * pause, LONGEST_PAUSE)
            away.lasts(failure, pause)
            await self._feed.close()
            await unless(stop, asyncio.sleep(away.pause(pause)))

    async def _connection(self, stop: asyncio.Event) -> None:
        feed = self._feed
        beginning = await unless(stop, self._begin())
        if beginning is None:
            return
        begun = beginning.after
        log.info("reading", feed=feed.name, **({} if feed.producer is None else {"after": begun}))
        if begun and not self.reached:
            log.info("goes on where it stopped; --producer NAME reads all again, as if nothing had been taken")
        if begun and beginning.oldest > begun + 1:
            self._lose(begun + 1, beginning.oldest - 1)
        self.reached = max(self.reached, begun, beginning.oldest - 1)
        at_end = False
        while not stop.is_set():
            messages = await feed.read()
            if messages:
                await self._take(messages)
            elif self._settings.to_end and await feed.lag() == 0:
                at_end = True
                break
            while len(self._under_way) >= UNDER_WAY:
                self._room.clear()
                await self._room.wait()
        while self._under_way:
            self._room.clear()
            await self._room.wait()
        await self._keep()
        self.at_end = at_end

    async def _begin(self) -> Beginning:
        known = self.reached or await self._known()
        self._was_there |= bool(known)
        self._broker_away.begins()
        beginning = await self._feed.begin(known)
        self._broker_away.ends()
        self._doubt.ends()
        self._was_there = True
        self._identity.is_now(beginning.identity)
        if known and not self.reached and (hull := self._settings.mapping.hull) is not None:
            await self._identity.require_in(hull)
        return beginning

    async def _known(self) -> int | None:
        """The number of the last message that the hull has, if all messages are for one hull."""
        hull = self._settings.mapping.hull
        if hull is None or self._feed.producer is None:
            return None
        self._server_away.begins()
        try:
            known = await self._client.last_sequence(hull, self._feed.producer, timeout=ANSWER)
        except HullNotFoundError:
            known = 0
        self._server_away.ends()
        return known

    async def _take(self, messages: Sequence[Message]) -> None:
        """Hand the rows of some messages to the lanes of their hulls."""
        self._figures.messages.labels(self._feed.name).inc(len(messages))
        for each in messages:
            if each.lost:
                self._lose(each.number - each.lost, each.number - 1)
        self._read_so_far += len(messages)
        if not self.reached and not self.points and not self._under_way:
            self.begun = monotonic()
        taken = Taken(messages)
        self._under_way.append(taken)
        for hull, chunk in chunks_of(taken, self._rows(messages)):
            lane = self._lanes.get(hull)
            if lane is None:
                lane = self._lanes[hull] = self._lane(hull)
            await lane.put(chunk)
        self._tell()
        taken.whole = True
        self._news.set()
        self.reached = max(self.reached, messages[-1].number)

    def _lose(self, first: int, last: int) -> None:
        """Count messages that were removed before they were read; GapError unless that is accepted."""
        count = last - first + 1
        if not self._settings.accept_gaps:
            raise GapError(
                f"{self._feed.name}: messages {first} to {last}, {count} at most, were removed before they were read: "
                "--accept-gaps goes on without them"
            )
        log.warning("messages were removed before they were read", feed=self._feed.name, first=first, last=last)
        self.lost += count
        self._figures.lost.labels(self._feed.name).inc(count)

    def _tell(self) -> None:
        """Log, once, how the first time was read."""
        mapping = self._settings.mapping
        for each in (mapping.times, mapping.ends):
            if each.note is not None:
                log.info(each.note)
                each.note = None
        if mapping.warning is not None:
            log.warning(mapping.warning)
            mapping.warning = None

    def _rows(self, messages: Sequence[Message]) -> Iterator[tuple[Message, list[Row]]]:
        rows = self._settings.mapping.rows
        for message in messages:
            try:
                found = rows(message)
                _require_keys_once(found)
            except ValueError as error:
                self._set_aside(message, error)
                continue
            yield message, found

    def _set_aside(self, message: Message, error: Exception) -> None:
        self._figures.bad.labels(self._feed.name).inc()
        self._bad.add(message, error)

    def _lane(self, hull: str) -> ChunkLane:
        settings = self._settings
        lane = ChunkLane(
            self._client,
            hull,
            self._feed.producer,
            self._identity,
            keyed=settings.mapping.keyed,
            degrees=settings.mapping.degrees,
            create=settings.create,
            conditions=settings.conditions,
            bad=self._set_aside,
            settled=self._settled,
            away=self._server_away,
            named_by_messages=settings.mapping.hull is None,
        )
        self._sending.append(self._group.create_task(lane.run(), name=f"ingest into {hull}"))
        return lane

    def _settled(self, rows: int, applied: Applied | None) -> None:
        self.points += rows
        if applied is not None:
            self.counts.add(applied)
            self._figures.add_counts(self._feed.name, applied)
        self.ended = monotonic()
        self._figures.points.labels(self._feed.name).inc(rows)
        self._news.set()

    async def _keeping(self) -> None:
        """Note at the broker what has been taken, at once where it resends the rest, else now and then."""
        while True:
            await self._news.wait()
            self._news.clear()
            await self._keep()
            if self._feed.producer is not None:
                await asyncio.sleep(KEEP_EVERY)

    async def _keep(self) -> None:
        async with self._noting:
            messages: list[Message] = []
            while self._under_way and self._under_way[0].settled:
                messages.extend(self._under_way.popleft().messages)
            self._room.set()
            try:
                if messages:
                    await self._feed.keep(messages)
                lag = await self._feed.lag()
            except FeedError as error:  # reading fails too, and begins again
                log.debug("the place in the log was not kept", feed=self._feed.name, error=str(error))
                return
            if lag is not None:
                self._figures.lag.labels(self._feed.name).set(lag + self.under_way)


def _require_keys_once(rows: Sequence[Row]) -> None:
    if len(rows) < 2 or rows[0].key is None:
        return
    keys = set()
    for row in rows:
        if (row.hull, row.key) in keys:
            raise ValueError(f"the key {row.key!r} is in the message twice")
        keys.add((row.hull, row.key))
