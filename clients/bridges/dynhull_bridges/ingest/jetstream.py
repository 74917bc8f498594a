"""A stream of NATS JetStream as a log: the number of a message is its sequence in the stream."""

import asyncio
import json
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from datetime import timedelta
from time import monotonic
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

from nats.aio.msg import Msg
from nats.errors import Error
from nats.js.api import AckPolicy, ConsumerConfig, DeliverPolicy, KeyValueConfig, StreamConfig, StreamInfo
from nats.js.errors import BadRequestError, BucketNotFoundError, KeyNotFoundError
from nats.js.kv import KeyValue

from dynhull_cli.reading.times import EPOCH

from ..nats_connection import closed, connected
from ..refusals.nats import NATS, code_of
from ..refusals.table import Meaning
from ..urls import check_subject, options_of, without_secrets
from .feed import PING_INTERVAL, Beginning, FeedError, Message, feed_error, producer_name, refusal
from .identity import adopted, made_again
from .topics import captures_of

if TYPE_CHECKING:
    from nats.aio.client import Client
    from nats.js.client import JetStreamContext

POSITIONS = "dynhull-ingest"  # the bucket that keeps the places in logs
TIMEOUT = 10.0  # seconds for an answer
PULLED = 8192  # messages asked for at a time
MOST = 4096  # messages of one read
WAIT = 1.0  # seconds that a read waits for messages
NO_MESSAGES, REQUEST_EXPIRED = "404", "408"
NOT_IN_STREAM, NO_STREAM = 10093, 10059  # codes of errors
# The reply subject of a message: $JS.ACK.STREAM.CONSUMER.attempts.sequence.delivered.time.pending
SHORT_REPLY, SEQUENCE = 9, 5


class JetStreamSource:
    """Reads nats://[USER:PASSWORD@]HOST[:PORT]/STREAM[/SUBJECT], or tls:// for TLS; the subject may have wildcards.

    Args:
        url: the URL.
        producer: the name under which hulls count the numbers of messages; None for one of stream and subject.
        mapping: the digest of the mapping. Each has its own place in the stream.
        ping_interval: seconds. The server ends a request after half of it, and says so; the connection is lost when it
            has said nothing for half as long again.
    """

    def __init__(self, url: str, producer: str | None, mapping: str, ping_interval: float = PING_INTERVAL) -> None:
        self._expires, self._silence = 0.5 * ping_interval, 1.5 * ping_interval
        parts = urlsplit(url, allow_fragments=False)
        stream, _, subject = unquote(parts.path).strip("/").partition("/")
        if not parts.hostname or not stream:
            raise ValueError(f"{without_secrets(url)}: give nats://HOST/STREAM or nats://HOST/STREAM/SUBJECT")
        options_of(url)
        check_subject(stream)
        if set(".*>\\") & set(stream):
            raise ValueError(f"no stream of NATS is called {stream!r}: names have no . * > or \\")
        if subject:
            check_subject(subject)
            if ">" in subject.split(".")[:-1]:
                raise ValueError(f"the subject {subject!r} goes on after >, which stands for all words from there on")
        self.name = without_secrets(url)
        self.producer: str | None = producer or producer_name("nats", stream, *([subject] if subject else []))
        # As a key of a bucket, which may not begin or end with a dot; no producer has an equals sign.
        self._key = f"p-{self.producer}={mapping}-p"
        self._server = parts._replace(path="").geturl()
        self._stream = stream
        self._subject = subject or ">"
        self._captures = captures_of(self._subject, ".", "*", ">")
        self._client: Client | None = None
        self._context: JetStreamContext
        self._inbox = ""
        self._pull = ""
        self._arrived: deque[Msg] = deque()
        self._news = asyncio.Event()
        self._heard = 0.0  # the time of the last word from the server
        self._asked = 0  # messages asked for that have not come
        self._delivered = 0  # by the consumer
        self._left = 0  # messages after the last one read
        self._identity = 0
        self._keeps = False
        self._next = 1  # the number of the next message, if there is no gap
        self._without_gaps = False

    async def begin(self, known: int | None) -> Beginning:
        """Connect; see `Feed.begin`."""
        try:
            return await self._begin(known)
        except (Error, OSError, TimeoutError) as error:
            raise self._failure(error) from None

    def _failure(self, error: Exception) -> Exception:
        code = code_of(error)
        meaning = NATS.meaning(code)
        if code == NO_STREAM:
            return refusal(meaning, f"NATS has no stream {self._stream!r}")
        if isinstance(code, str):
            return refusal(meaning, f"the broker refuses the connection: {error}")
        return feed_error("NATS", error) if meaning is Meaning.PASSES else refusal(meaning, f"NATS: {error}")

    async def _begin(self, known: int | None) -> Beginning:
        self._client = await connected(self._server, TIMEOUT)
        self._context = self._client.jetstream(timeout=TIMEOUT)
        stream = await self._context.stream_info(self._stream)
        config, oldest = stream.config, stream.state.first_seq
        self._identity = _microseconds(stream)
        self._keeps |= known is None
        after = await self._kept() if known is None else known
        if after > (end := stream.state.last_seq):
            raise made_again(f"the stream {self._stream!r} ends at {end}, but {after} messages of it have been taken")
        wanted = ConsumerConfig(
            ack_policy=AckPolicy.NONE,
            deliver_policy=DeliverPolicy.BY_START_SEQUENCE,
            opt_start_seq=after + 1,
            filter_subject=self._subject,
            inactive_threshold=60.0,
            mem_storage=True,
        )
        try:
            consumer = await self._context.add_consumer(self._stream, wanted)
        except BadRequestError as error:
            if error.err_code != NOT_IN_STREAM:
                raise
            there = ", ".join(config.subjects or ())
            raise ValueError(
                f"the stream {self._stream!r} stores nothing of {self._subject!r}: its subjects are {there}"
            ) from None
        self._left = consumer.num_pending or 0
        self._next = max(after + 1, oldest)
        self._without_gaps = config.max_msgs_per_subject <= 0 and self._subject in (">", *_only(config.subjects))
        self._pull = f"$JS.API.CONSUMER.MSG.NEXT.{self._stream}.{consumer.name}"
        self._arrived.clear()
        self._asked = self._delivered = 0
        self._heard = monotonic()
        inbox = self._client.new_inbox()
        await self._client.subscribe(inbox, cb=self._arrive)
        self._inbox = inbox
        await self._ask()
        return Beginning(after, self._identity, 0 if _only_replaces(config) else oldest)

    async def _arrive(self, message: Msg) -> None:
        self._arrived.append(message)
        self._news.set()

    async def read(self) -> Sequence[Message]:
        """The next messages; see `Feed.read`."""
        if not self._arrived:
            self._news.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout(WAIT):
                    await self._news.wait()
        messages: list[Message] = []
        while self._arrived and len(messages) < MOST:
            self._heard = monotonic()
            self._take(self._arrived.popleft(), messages)
        if self._client is None or self._client.is_closed:
            raise FeedError("NATS: the connection is lost")
        if monotonic() - self._heard > self._silence:
            raise FeedError(f"NATS: the server has said nothing for {self._silence:g} s")
        if self._asked <= PULLED // 2:
            await self._ask()
        if messages:
            await self._look_for_gaps(messages)
        return messages

    def _take(self, message: Msg, messages: list[Message]) -> None:
        if not message.reply:  # a word about a request
            headers = message.headers or {}
            status = headers.get("Status")
            if status not in (REQUEST_EXPIRED, NO_MESSAGES):
                raise FeedError(f"NATS: {status} {headers.get('Description', '')}")
            self._asked -= int(headers.get("Nats-Pending-Messages", self._asked))
            return
        # Msg.metadata reads the same, five times slower.
        words = message.reply.split(".")
        first = SEQUENCE if len(words) == SHORT_REPLY else SEQUENCE + 2  # longer ones have a domain and an account
        number, delivered, self._left = int(words[first]), int(words[first + 1]), int(words[first + 3])
        self._asked -= 1
        self._delivered += 1
        if delivered != self._delivered:
            raise FeedError(f"NATS: message {self._delivered} of the consumer is missing")
        messages.append(Message(message.subject, self._captures(message.subject), message.data or None, number))

    async def _look_for_gaps(self, messages: Sequence[Message]) -> None:
        """Note what the stream has removed between messages, where its numbers have no other gaps."""
        if self._without_gaps and messages[-1].number - self._next >= len(messages):
            try:
                oldest = (await self._context.stream_info(self._stream)).state.first_seq
            except (Error, OSError, TimeoutError) as error:
                raise self._failure(error) from None
            for each in messages:
                each.lost = max(0, min(each.number, oldest) - self._next)
                self._next = each.number + 1
        self._next = messages[-1].number + 1

    async def _ask(self) -> None:
        """Ask for more messages, so that some are always under way."""
        assert self._client is not None
        request = {"batch": PULLED, "expires": int(self._expires * 1e9)}
        try:
            await self._client.publish(self._pull, json.dumps(request).encode(), reply=self._inbox)
        except (Error, OSError) as error:
            raise feed_error("NATS", error) from None
        self._asked += PULLED

    async def keep(self, messages: Sequence[Message]) -> None:
        """Keep the number of the last one, with the identity of the stream, in the bucket, unless the hull does."""
        if not self._keeps:
            return
        try:
            await self._put(messages[-1].number)
        except (Error, OSError, TimeoutError) as error:
            raise feed_error("NATS", error) from None

    async def _put(self, number: int) -> None:
        await (await self._positions()).put(self._key, f"{number} {self._identity}".encode())

    async def _kept(self) -> int:
        try:
            entry = await (await self._context.key_value(POSITIONS)).get(self._key)
        except (BucketNotFoundError, KeyNotFoundError):
            return 0
        number, _, identity = (entry.value or b"0").decode().partition(" ")
        if not identity:
            adopted(self.name)
            await self._put(int(number))
        elif int(identity) != self._identity:
            raise made_again(f"the stream {self._stream!r} is another one than that of which {number} have been taken")
        return int(number)

    async def _positions(self) -> KeyValue:
        try:
            return await self._context.key_value(POSITIONS)
        except BucketNotFoundError:
            return await self._context.create_key_value(KeyValueConfig(bucket=POSITIONS))

    async def lag(self) -> int | None:
        """The number of messages that are not read yet."""
        return self._left + len(self._arrived)

    async def close(self) -> None:
        """Disconnect."""
        client, self._client = self._client, None
        if client is not None:
            await closed(client)


def _only(subjects: Sequence[str] | None) -> Sequence[str]:
    return subjects if subjects is not None and len(subjects) == 1 else ()


def _only_replaces(config: StreamConfig) -> bool:
    """Whether a stream removes a message only when it has newer ones of the same subject."""
    limits = config.max_age, config.max_msgs, config.max_bytes
    return config.max_msgs_per_subject > 0 and all(each is None or each <= 0 for each in limits)


def _microseconds(stream: StreamInfo) -> int:
    """When a stream was created, in microseconds since 1970; 0 if its server does not say."""
    return 0 if stream.created is None else (stream.created - EPOCH) // timedelta(microseconds=1)
