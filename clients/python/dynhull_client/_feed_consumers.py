"""Calls about the consumers of feeds, made as those in `calls`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dynhull_proto.v1 import feed_pb2

from ._arguments import text, whole
from ._calls import Call
from ._feed_messages import FeedConsumer, decode_feed_consumer

if TYPE_CHECKING:
    from ._calls import Pages


def ack_feed(
    name: str | None = None,
    *,
    consumer: str,
    after: int | bytes,
    prefix: str | None = None,
    uid: str = "",
    timeout: float | None = None,
) -> Call[FeedConsumer]:
    """Acknowledge the batches of a feed, for a durable consumer. What is before that acknowledged changes nothing.

    >>> for batch in client.feed("fleet", consumer="index"):  # doctest: +SKIP
    ...     print(batch.revision, batch.keys)
    ...     client.ack_feed("fleet", consumer="index", after=batch.after, uid=batch.uid)

    Args:
        name: the hull.
        consumer: the name of the consumer, which is created if it is new.
        after: the attribute `after` of the last batch that has been processed: a revision; of many hulls a position.
            0 for the beginning.
        prefix: in place of a name, that of the feed.
        uid: the uid of the hull that has the revision: HullReplacedError if it was created again or restored since
            then. By default that of the consumer.
        timeout: seconds, instead of the client's.
    """
    request = feed_pb2.AckFeedRequest(consumer=text("consumer", consumer), uid=text("uid", uid))
    _write_feed(request, name, prefix)
    if prefix is None:
        request.revision = whole("after", after)
    elif isinstance(after, bytes):
        request.position = after
    elif after != 0:
        raise ValueError(f"after is {after!r}: of many hulls it is 0, or the attribute `after` of a batch")
    return Call("AckFeed", request, lambda response: decode_feed_consumer(response.consumer), timeout)


def list_feed_consumers(prefix: str = "", *, timeout: float | None = None) -> Pages[FeedConsumer]:
    """The durable consumers of feeds, fetched page by page: by what they read, then by name.

    Args:
        prefix: only those that read a hull, or a prefix, which begins with this.
        timeout: seconds, instead of the client's.
    """
    text("prefix", prefix)

    def decode(response: feed_pb2.ListFeedConsumersResponse) -> tuple[list[FeedConsumer], str]:
        return [decode_feed_consumer(each) for each in response.consumers], response.next_page_token

    return lambda token: Call(
        "ListFeedConsumers", feed_pb2.ListFeedConsumersRequest(prefix=prefix, page_token=token), decode, timeout
    )


def delete_feed_consumer(
    name: str | None = None, *, consumer: str, prefix: str | None = None, timeout: float | None = None
) -> Call[None]:
    """Delete a durable consumer of a feed, or raise ConsumerNotFoundError.

    Args:
        name: the hull.
        consumer: the name of the consumer.
        prefix: in place of a name, that of the feed.
        timeout: seconds, instead of the client's.
    """
    request = feed_pb2.DeleteFeedConsumerRequest(consumer=text("consumer", consumer))
    _write_feed(request, name, prefix)
    return Call("DeleteFeedConsumer", request, lambda _: None, timeout, repeatable=False)


def _write_feed(
    request: feed_pb2.AckFeedRequest | feed_pb2.DeleteFeedConsumerRequest, name: str | None, prefix: str | None
) -> None:
    if (name is None) == (prefix is None):
        raise ValueError("give either name or prefix")
    if name is not None:
        request.name = text("name", name)
    if prefix is not None:
        request.prefix = text("prefix", prefix)
