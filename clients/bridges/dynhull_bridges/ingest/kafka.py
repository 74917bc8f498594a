"""A partition of a Kafka topic as a log: the number of a message is its offset, plus one."""

from collections.abc import Mapping, Sequence
from time import monotonic
from typing import Any
from urllib.parse import unquote, urlsplit

from aiokafka import AIOKafkaConsumer, TopicPartition
from aiokafka.admin import AIOKafkaAdminClient
from aiokafka.errors import KafkaConnectionError, KafkaError, UnknownTopicOrPartitionError, for_code

from ..refusals.kafka import KAFKA
from ..urls import options_of, without_secrets
from .feed import PING_INTERVAL, Beginning, FeedError, Message, feed_error, producer_name, refusal
from .identity import made_again
from .topic_id import topic_id

WAIT = 1000  # milliseconds that a read waits for messages
MOST = 4096  # messages of one read
GROUP = "dynhull-ingest"
ASK_EVERY = 30.0  # seconds after which a topic is asked again for its id


class Kafka:
    """Reads one partition of kafka://HOST[:PORT][,HOST...]/TOPIC.

    Args:
        servers: the hosts.
        topic: the name of the topic.
        partition: the number of the partition.
        producer: the name under which hulls count the offsets; None for one of topic and partition.
        group: the group that keeps the offset.
        settings: what aiokafka needs to reach the hosts beside their names.
        ping_interval: seconds. The broker answers twice a second while nothing comes; the connection is lost when it
            has been silent for half as long again. Other requests may take three times as long.
    """

    def __init__(
        self,
        servers: str,
        topic: str,
        partition: int,
        producer: str | None,
        group: str,
        settings: Mapping[str, Any] | None = None,
        ping_interval: float = PING_INTERVAL,
    ) -> None:
        self._reached = _reached(servers, settings, ping_interval)
        self._silence = 1.5 * ping_interval
        self._wait = min(WAIT, round(250 * ping_interval))
        self._heard = 0.0  # when the broker was heard last
        self._answered: int | None = None  # when it was, by a clock that may be set
        self.name = f"kafka/{topic}/{partition}"
        self.producer: str | None = producer or producer_name("kafka", topic, str(partition))
        self._group = group
        self._partition = TopicPartition(topic, partition)
        self._captures = (topic,)
        self._consumer: AIOKafkaConsumer | None = None
        self._identity = 0
        self._asked = 0.0  # when the topic was asked for its id
        self._keeps = False

    async def begin(self, known: int | None) -> Beginning:
        """Connect; see `Feed.begin`."""
        consumer = AIOKafkaConsumer(
            **self._reached,
            group_id=self._group,  # only keeps the offset: the partition is not shared with other members
            enable_auto_commit=False,
            auto_offset_reset="none",
            isolation_level="read_committed",
        )
        self._consumer = consumer
        partition = self._partition
        try:
            await consumer.start()
            consumer.assign([partition])
            self._keeps |= known is None
            after = (await consumer.committed(partition) or 0) if known is None else known
            oldest = (await consumer.beginning_offsets([partition]))[partition]
            end = (await consumer.end_offsets([partition]))[partition]
            self._identity = await self._id()
        except (KafkaError, OSError) as error:
            raise _failure(error) from None
        if after > end:
            raise made_again(f"{self.name} ends at offset {end}, but {after} offsets of it have been taken")
        consumer.seek(partition, max(after, oldest))
        self._asked = self._heard = monotonic()
        return Beginning(after, self._identity, oldest + 1)

    async def _id(self) -> int:
        """The id of the topic as a number of a batch: 63 of its bits, most of them random; 0 if it has none."""
        found = await topic_id(self._partition.topic, self._reached)
        return 0 if found is None else int.from_bytes(found[:8]) >> 1

    async def read(self) -> Sequence[Message]:
        """The next messages; see `Feed.read`.

        aiokafka goes on at its offset in a topic that was made again, if that is as long already.
        """
        same = True
        try:
            found = await self._connected.getmany(self._partition, timeout_ms=self._wait, max_records=MOST)
            if monotonic() - self._asked > ASK_EVERY:
                self._asked = monotonic()
                same = await self._id() == self._identity
        except (KafkaError, OSError) as error:
            raise _failure(error) from None
        if not same:
            raise FeedError("Kafka: the topic has another id")
        records = found.get(self._partition, ())
        self._listen(bool(records))
        topic, captures = self._partition.topic, self._captures
        return [Message(topic, captures, each.value, each.offset + 1, key=each.key) for each in records]

    def _listen(self, heard: bool) -> None:
        """Raise FeedError if the broker has been silent for too long: aiokafka would ask again, without a word."""
        answered = self._connected.last_poll_timestamp(self._partition)
        if heard or answered != self._answered:
            self._heard, self._answered = monotonic(), answered
        elif (silent := monotonic() - self._heard) > self._silence:
            raise FeedError(f"Kafka: the broker has said nothing for {silent:.0f} s")

    async def keep(self, messages: Sequence[Message]) -> None:
        """Commit the offset after the last one, unless the hull keeps it."""
        if not self._keeps:
            return
        try:
            await self._connected.commit({self._partition: messages[-1].number})
        except (KafkaError, OSError) as error:
            raise feed_error("Kafka", error) from None

    async def lag(self) -> int | None:
        """The number of messages that are not read yet."""
        end = self._connected.highwater(self._partition)
        if end is None:
            return None
        try:
            # Beyond the last record, as the mark that ends a transaction has an offset, too.
            position = await self._connected.position(self._partition)
        except KafkaError as error:
            raise feed_error("Kafka", error) from None
        return max(0, int(end - position))

    async def close(self) -> None:
        """Disconnect."""
        consumer, self._consumer = self._consumer, None
        if consumer is not None:
            await consumer.stop()

    @property
    def _connected(self) -> AIOKafkaConsumer:
        if self._consumer is None:
            raise FeedError("Kafka: not connected")
        return self._consumer


class Topic:
    """The topic that kafka://HOST[:PORT][,HOST...]/TOPIC[?partition=N&partition=M] stands for.

    Args:
        url: the URL; without partitions it is about all of them.
        producer: the name under which hulls count the offsets, followed by the partition; None for one of the topic.
        mapping: the digest of the mapping. Each has its own place in the topic.
        settings: as for `Kafka`.
        ping_interval: as for `Kafka`.

    Raises:
        ValueError: the URL names no topic, has a password, or a partition that is no number.
    """

    def __init__(
        self,
        url: str,
        producer: str | None,
        mapping: str,
        settings: Mapping[str, Any] | None = None,
        ping_interval: float = PING_INTERVAL,
    ) -> None:
        self._settings, self._ping_interval = settings, ping_interval
        parts = urlsplit(url)
        self._servers = parts.netloc
        self._name = unquote(parts.path).strip("/")
        self._producer = producer
        self._group = ".".join((GROUP, mapping, *([producer] if producer else [])))
        if not self._servers or not self._name or "/" in self._name:
            raise ValueError(f"{without_secrets(url)}: give kafka://HOST:PORT/TOPIC")
        if "@" in self._servers:
            raise ValueError(f"{without_secrets(url)}: user and password are settings of --kafka-config")
        asked = options_of(url, ("partition",)).get("partition", [])
        if wrong := [each for each in asked if not each.isdecimal()]:
            raise ValueError(f"{without_secrets(url)}: partition is {wrong[0]!r}, not a number from 0")
        self._asked = [int(each) for each in asked]

    async def partitions(self) -> list[Kafka]:
        """The partitions.

        Raises:
            DoubtfulError: the broker says that there is no such topic.
            ValueError: the topic has no such partition, or the broker refuses for good.
            FeedError: no broker answers, or it refuses for now.
        """
        admin = AIOKafkaAdminClient(**_reached(self._servers, self._settings, self._ping_interval))
        try:
            await admin.start()
            (described,) = await admin.describe_topics([self._name])
        except KafkaConnectionError:
            # aiokafka says no more where it was refused.
            more = ", or it refuses the settings of --kafka-config" if self._settings else ""
            raise FeedError(f"Kafka: no broker answers at {self._servers}{more}") from None
        except (KafkaError, OSError) as error:
            raise _failure(error) from None
        finally:
            await admin.close()
        there = sorted(each["partition"] for each in described["partitions"])
        if not there:
            refused: type[KafkaError] = for_code(described["error_code"])
            denied = f"Kafka has no topic {self._name!r}"
            unsure = f"Kafka: the topic {self._name!r}: {refused.__name__}"
            raise refusal(KAFKA.meaning(refused), denied if refused is UnknownTopicOrPartitionError else unsure)
        if missing := sorted(set(self._asked) - set(there)):
            raise ValueError(f"the topic {self._name!r} has no partition {missing[0]}: it has 0 to {max(there)}")
        return [self._partition(each) for each in self._asked or there]

    def _partition(self, number: int) -> Kafka:
        producer = f"{self._producer}/{number}" if self._producer else None
        return Kafka(self._servers, self._name, number, producer, self._group, self._settings, self._ping_interval)


def _reached(servers: str, settings: Mapping[str, Any] | None, ping_interval: float) -> dict[str, Any]:
    """How the hosts are reached, and how many milliseconds a request may take."""
    return {"bootstrap_servers": servers, "request_timeout_ms": round(3000 * ping_interval), **(settings or {})}


def _failure(error: KafkaError | OSError) -> Exception:
    kind: type[Exception] = type(error)
    return refusal(KAFKA.meaning(kind), str(feed_error("Kafka", error)))
