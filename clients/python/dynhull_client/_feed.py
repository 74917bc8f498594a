"""The feed of batches: what it asks for, and its state between messages and connections. No I/O."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dynhull_proto.v1 import feed_pb2

from ._arguments import text, whole
from ._feed_messages import FeedBatch, decode_feed_batch
from ._place import Place
from ._times import encode_duration

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from datetime import timedelta

    from ._errors import DynhullError


@dataclass(frozen=True, slots=True)
class Feeding:
    """A feed to begin."""

    request: feed_pb2.FeedRequest
    reconnect: bool
    timeout: float | None


def feed(
    name: str | None = None,
    *,
    prefix: str | None = None,
    after: int | bytes | None = None,
    consumer: str | None = None,
    uid: str = "",
    progress_interval: float | timedelta | str | None = None,
    reconnect: bool = True,
    timeout: float | None = None,
) -> Feeding:
    """Every batch of a hull, or of many, each once and in order: an iterator of `FeedBatch`, which never ends.

    >>> from dynhull_client import HullClient
    >>> client = HullClient()  # doctest: +SKIP
    >>> for batch in client.feed("fleet", after=0):  # doctest: +SKIP
    ...     print(batch.revision, batch.keys, batch.points)

    It begins with the next batch, unless `after` or a consumer says where. Batches that the server keeps no more come
    as one of the type "lost", which names their revisions. A program that reads slowly is sent them later, from where
    they are kept. It needs the right to read the past of the hulls.

    Batches of many hulls come in the order of their commits, those of a server of several workers in the order of each.

    Args:
        name: the hull.
        prefix: in place of a name, all hulls whose names begin with this, those to come, too; "" for all.
        after: the revision after which to begin; of many hulls the attribute `after` of an earlier batch. 0 for all
            batches that are kept.
        consumer: the name of a durable consumer: the feed begins after what it acknowledged, and for a new consumer at
            the oldest batch that is kept. The consumer outlives clients and servers; `ack_feed` acknowledges. If what
            it acknowledged is of a hull that was created again or restored since then, HullReplacedError, and
            RevisionForgottenError where that is so of the data of a prefix, until it is deleted, or acknowledges what
            the caller has of the present hull.
        uid: the uid of the hull whose revisions the caller has: HullReplacedError if it was created again or restored
            from a backup since then.
        progress_interval: seconds without a batch after which one of the type "progress" comes; None for never.
        reconnect: whether the feed continues after a lost connection, however long that takes, without loss or
            repetition. Without it, UnavailableError ends the feed. Until it has begun it is tried again as other reads
            are (`retries` of the client), in both cases.
        timeout: seconds after which the feed ends with DeadlineError; None for never.
    """
    if (name is None) == (prefix is None):
        raise ValueError("give either name or prefix")
    if consumer is not None and after is not None:
        raise ValueError("give either consumer, which knows its place, or after, not both")
    if prefix is not None and uid:
        raise ValueError("uid is for one hull: a position says of which data it is")
    request = feed_pb2.FeedRequest(uid=text("uid", uid))
    if name is not None:
        request.name = text("name", name)
    if prefix is not None:
        request.prefix = text("prefix", prefix)
    if consumer is not None:
        request.consumer = text("consumer", consumer)
    elif after is None:
        request.only_new = True
    elif prefix is not None and isinstance(after, bytes):
        request.position = after
    elif prefix is not None and after != 0:
        raise ValueError(f"after is {after!r}: of many hulls it is 0, or the attribute `after` of an earlier batch")
    else:
        request.after_revision = whole("after", after)
    if progress_interval is not None:
        request.progress_interval.CopyFrom(encode_duration(progress_interval, "progress_interval"))
    return Feeding(request, reconnect, timeout)


class FeedPlace(Place[FeedBatch]):
    """What a feed has received, and what it requests next."""

    method = "Feed"
    request: feed_pb2.FeedRequest

    def __init__(self, feeding: Feeding, retries: int) -> None:
        super().__init__(feeding.timeout, feeding.reconnect, retries)
        self.request = feed_pb2.FeedRequest()
        self.request.CopyFrom(feeding.request)
        self._reports_progress = feeding.request.HasField("progress_interval")
        self._many = feeding.request.HasField("prefix")
        self._there: dict[str, str] | None = {}  # while the feed begins
        self._unplaced: set[tuple[str, int]] = set()  # what has come since the last position

    @property
    def subject(self) -> str:
        """What is followed, for people."""
        return f"{self.request.prefix}*" if self._many else repr(self.request.name)

    def take(self, message: feed_pb2.FeedResponse) -> Sequence[FeedBatch]:
        """The batches of a message. The next connection continues after them."""
        cause = self._cause
        self._connected()
        batches = list(self._began(message)) if self._many and self._there is not None else []
        after: int | bytes | None = (message.position or None) if self._many else message.revision
        batches += [FeedBatch("deleted", each.name, 0, each.uid, after=None) for each in message.gone]
        for gap in message.lost:
            first, last = gap.first_revision, gap.last_revision
            batches.append(FeedBatch("lost", gap.hull, last, gap.uid, first=first, last=last, after=None))
        for each in message.batches:
            if (each.uid, each.revision) not in self._unplaced:  # sent again, as a part of one commit
                self._unplaced.add((each.uid, each.revision))
                batches.append(decode_feed_batch(each, None if self._many else each.revision))
        if self._reports_progress and not batches and after is not None:
            batches.append(FeedBatch("progress", self.request.name, message.revision, message.uid, after=after))
        if not message.batches:  # what follows may be what could not be read before
            self._cause = cause
        if after is not None:
            self._unplaced.clear()
            self._go_on_from(message, after)
            if batches:
                batches[-1] = replace(batches[-1], after=after)
        return batches

    def end(self, error: DynhullError) -> Sequence[FeedBatch]:
        """Prepare the next connection after one has ended; raises the error if there is none."""
        self.lost = error
        self._there = {}
        self._continue_later(error)
        return ()

    def _began(self, message: feed_pb2.FeedResponse) -> Iterator[FeedBatch]:
        """The hulls that there are, once all of them are known, for who goes on and may have others."""
        assert self._there is not None  # the feed begins
        self._there.update((each.name, each.uid) for each in message.hulls)
        if message.position:
            if self.request.WhichOneof("start") in ("position", "consumer"):
                yield FeedBatch("hulls", "", 0, hulls=self._there, after=None)
            self._there = None

    def _go_on_from(self, message: feed_pb2.FeedResponse, after: int | bytes) -> None:
        if isinstance(after, bytes):
            self.request.position = after
        else:
            self.request.after_revision = after
            self.request.uid = message.uid or self.request.uid
