"""The feed of a hull, or of many: every batch, each once and in order."""

from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from dynhull_cli.feed_lines import batch_members
from dynhull_client import AsyncFeed, AsyncHullClient, FeedBatch, HullReplacedError, UnavailableError

from .messages import COMMENT, last_problem, message, place
from .shared import over_restarts


@dataclass(slots=True)
class FeedReading:
    """What is read, and how far.

    Attributes:
        name: the hull; None for many.
        prefix: that of many hulls; None for one.
        uid: the uid of the hull; empty if it is not known yet, and for many.
        after: what the reader goes on after, as in a `FeedBatch`; None for new batches only, or for a consumer's place.
        consumer: a durable consumer, which knows where it begins; None for none.
    """

    name: str | None
    prefix: str | None
    uid: str
    after: int | bytes | None
    consumer: str | None = None

    def feed(self, client: AsyncHullClient, progress_interval: float) -> AsyncFeed:
        """The feed of what is left."""
        consumer = self.consumer if self.after is None else None
        return client.feed(
            self.name,
            prefix=self.prefix,
            after=self.after,
            consumer=consumer,
            uid=self.uid,
            progress_interval=progress_interval,
        )

    def follow(self, batch: FeedBatch) -> None:
        """Note what the reader has."""
        if batch.after is not None:
            self.after, self.uid = batch.after, "" if self.name is None else batch.uid


async def look(client: AsyncHullClient, reading: FeedReading) -> None:
    """Learn where the feed begins; raises the error that refuses it. While the server is away the stream waits for it.

    Another hull of the name is no error: the stream says so.
    """
    with suppress(UnavailableError, HullReplacedError):
        async with reading.feed(client, 1.0) as feed:
            async for first in feed:
                if reading.consumer is not None:
                    return  # it begins where it is
                if reading.after is None:
                    reading.follow(first)
                if reading.after is not None:
                    return


def batches(client: AsyncHullClient, reading: FeedReading, keepalive: float) -> AsyncIterator[bytes]:
    """The batches as text, over restarts of the server; a comment when there is none for long."""
    return over_restarts(partial(_read, client, reading, keepalive), reading, "hull", HullReplacedError, last_problem)


async def _read(client: AsyncHullClient, reading: FeedReading, keepalive: float) -> AsyncIterator[bytes]:
    """One feed, which continues over lost connections itself once it has begun."""
    async with reading.feed(client, keepalive) as feed:
        async for batch in feed:
            # A reader that is cut off before the first batch misses none.
            yield place(_ident(batch)) + COMMENT if batch.type == "progress" else _text(batch)
            reading.follow(batch)


def _text(batch: FeedBatch) -> bytes:
    data = {name: value for name, value in batch_members(batch).items() if name != "type"}
    return message(batch.type, _ident(batch), data)


def _ident(batch: FeedBatch) -> str:
    if batch.after is None:
        return ""
    return batch.after.hex() if isinstance(batch.after, bytes) else f"{batch.uid}:{batch.after}"
