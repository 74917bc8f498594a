"""Delivery to Kafka, each event once: a transaction has the records and the sequence of the last one.

Who reads the topic with isolation.level=read_committed sees no event twice and none before its predecessor, also where
the relay was killed. What has arrived is kept as the offset of a consumer group of the same name as the transactions.
"""

import asyncio
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any
from urllib.parse import unquote, urlsplit

from aiokafka import AIOKafkaProducer, TopicPartition
from aiokafka.admin import AIOKafkaAdminClient
from aiokafka.errors import KafkaError, UnknownTopicOrPartitionError

from .bodies.body import CLOUD_EVENTS, Body
from .letters import Letter
from .refusals.kafka import RECORDS
from .target import NotDeliveredError, RefusedError, filled, not_delivered
from .urls import options_of, without_secrets

TOPIC = "dynhull.{kind}s"
LEGAL = re.compile(r"[A-Za-z0-9._-]{1,249}")
MOST_LETTERS = 500
IDENTITY = "dynhull-relay"
LONGEST_END = 5.0  # seconds to close connections


class KafkaTarget:
    """Sends to the topic in kafka://HOST[:PORT][,HOST...][/TOPIC].

    {kind} and {name} in the topic are filled in; a "/" in a name becomes a dot. All events of a source have the same
    key, so that they are in one partition, in their order.

    Args:
        url: the URL.
        timeout: the seconds that a delivery may take.
        consumer: the name of the relay's consumer, for that of its transactions; None for no transactions, where
            letters are sent out of their order.
        body: makes the values.
        settings: how the brokers are reached.
    """

    most = MOST_LETTERS

    def __init__(
        self,
        url: str,
        timeout: float,
        consumer: str | None,
        body: Body = CLOUD_EVENTS,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        parts = urlsplit(url, allow_fragments=False)
        if not parts.netloc:
            raise ValueError(f"--to {without_secrets(url)} has no host")
        if "@" in parts.netloc:
            raise ValueError(f"--to {without_secrets(url)}: user and password are settings of --kafka-config")
        options_of(url)
        self._topic = unquote(parts.path).strip("/") or TOPIC
        if "{type}" in self._topic:
            raise ValueError("--to has {type}, but all events of a source go to one topic, where they keep their order")
        if not LEGAL.fullmatch(re.sub(r"\{\w+\}", "x", self._topic)):
            raise ValueError(f"{self._topic!r} is no topic of Kafka: letters, digits, and ._-")
        self._servers = parts.netloc
        self._timeout = timeout
        self._consumer = consumer
        self._body = body
        self._settings = dict(settings or {})
        self._ways: dict[str, _Way] = {}  # by the uid of the source
        self._ending: set[asyncio.Task[None]] = set()

    async def deliver(self, letters: Sequence[Letter]) -> None:
        """Send the letters in one transaction; where a broker refuses one of them, in one for each."""
        try:
            await self._send(letters)
        except RefusedError as error:
            if len(letters) == 1 or error.letter is not None:
                raise
            for each in letters:
                await self._send([each])

    def place(self, letter: Letter) -> str:
        """The brokers and the topic."""
        return f"kafka://{self._servers}/{self._topic_of(letter)}"

    async def close(self) -> None:
        """Disconnect."""
        for uid in list(self._ways):
            self._give_up(uid)
        if self._ending:
            await asyncio.wait(self._ending, timeout=LONGEST_END)

    def _topic_of(self, letter: Letter) -> str:
        return filled(self._topic, letter).replace("/", ".")

    async def _send(self, letters: Sequence[Letter]) -> None:
        first = letters[0]
        topic = self._topic_of(first)
        if not LEGAL.fullmatch(topic):
            raise RefusedError(f"Kafka: {topic!r} is no topic")
        try:
            values = [self._record(each) for each in letters]
            async with asyncio.timeout(self._timeout):
                way = await self._way(first, topic)
                await way.send(topic, [each for each in values if each[0].sequence > way.done or way.group is None])
        except UnknownTopicOrPartitionError:
            self._give_up(first.uid)
            raise NotDeliveredError(f"Kafka has no topic {topic!r}: create it") from None
        except (KafkaError, OSError, TimeoutError) as error:
            self._give_up(first.uid)
            said = str(error) or type(error).__name__
            refused = not_delivered(RECORDS.meaning(type(error)), f"Kafka: {said}")
            if isinstance(refused, RefusedError) and len(letters) == 1:
                refused.letter = first
            raise refused from None
        except BaseException:  # cancelled, or nobody has foreseen it
            self._give_up(first.uid)
            raise

    def _record(self, letter: Letter) -> tuple[Letter, bytes]:
        try:
            return letter, self._body.text(letter).encode()
        except RefusedError as error:
            error.letter = letter
            raise

    async def _way(self, letter: Letter, topic: str) -> "_Way":
        way = self._ways.get(letter.uid)
        if way is None:
            group = None if self._consumer is None else f"{IDENTITY}.{self._consumer}.{letter.uid}"
            settings = {"bootstrap_servers": self._servers, "request_timeout_ms": round(500 * self._timeout)}
            way = self._ways[letter.uid] = _Way(group, self._body.content_type, {**settings, **self._settings})
            await way.begin(topic)
        return way

    def _give_up(self, uid: str) -> None:
        """End connections, in the background: what is under way in them may end only after the timeout."""
        if way := self._ways.pop(uid, None):
            task = asyncio.create_task(way.end())
            self._ending.add(task)
            task.add_done_callback(self._ending.discard)


def _note(sent: asyncio.Future[Any]) -> None:
    """The first error is raised; the others of the same transaction need no words."""
    if not sent.cancelled():
        sent.exception()


class _Way:
    """The transactions of one source. After an error it is of no use: nobody knows what has arrived; the next one asks.

    Attributes:
        group: the name of its transactions, and of the group that keeps how far they are; None without transactions.
        done: the sequence of the last event that has arrived.
    """

    def __init__(self, group: str | None, content_type: str, settings: dict[str, Any]) -> None:
        self.group = group
        self.done = 0
        self._content_type = content_type.encode()
        self._settings = settings
        self._producer = AIOKafkaProducer(transactional_id=group, enable_idempotence=True, **settings)

    async def begin(self, topic: str) -> None:
        """Connect. An earlier one, also of another relay that still runs, can send nothing any more."""
        await self._producer.start()
        if self.group is None:
            return
        admin = AIOKafkaAdminClient(**self._settings)
        try:
            await admin.start()
            place = TopicPartition(topic, 0)
            found = await admin.list_consumer_group_offsets(self.group, partitions=[place])
        finally:
            await admin.close()
        self.done = max(0, found[place].offset) if place in found else 0

    async def send(self, topic: str, records: Sequence[tuple[Letter, bytes]]) -> None:
        """Send records, all or none."""
        if not records:
            return
        if self.group is None:
            await self._put(topic, records)
            return
        last = records[-1][0].sequence
        await self._producer.begin_transaction()
        await self._put(topic, records)
        await self._producer.send_offsets_to_transaction({TopicPartition(topic, 0): last}, self.group)
        await self._producer.commit_transaction()
        self.done = last

    async def _put(self, topic: str, records: Sequence[tuple[Letter, bytes]]) -> None:
        """Send records, and wait until the broker has them."""
        sent: list[asyncio.Future[Any]] = []
        for letter, value in records:
            source = f"/{letter.source.kind}s/{letter.source.name}"
            headers = [("content-type", self._content_type), ("id", letter.id.encode())]
            future = await self._producer.send(topic, value, key=source.encode(), headers=headers)
            future.add_done_callback(_note)
            sent.append(future)
        await asyncio.gather(*sent)

    async def end(self) -> None:
        """Disconnect, as far as there is anybody."""
        with suppress(KafkaError, OSError, asyncio.CancelledError):
            await self._producer.stop()
