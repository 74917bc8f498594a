"""Consumers of feeds at a gateway: each worker has those of its hulls, and of each prefix what it has sent of it."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from google.rpc import code_pb2

from dynhull_proto.v1 import feed_pb2
from dynhull_server.engine.positions import BEGINNING, decode_standings, encode_standings
from dynhull_server.rpc.calls import Call, Work
from dynhull_server.rpc.decode_feed import decode_acknowledged_standings, decode_consumers_page, decode_fed_by
from dynhull_server.rpc.encode_feed import token_of
from dynhull_server.rpc.methods import DESCRIPTOR
from dynhull_server.rpc.status import RelayedError
from dynhull_server.state.errors import PositionForgottenError
from dynhull_server.state.feed_consumers import ConsumerId, FedBy

from .composed import together
from .relay import Relay
from .worker_link import WorkerLink

SERVICE = f"/{DESCRIPTOR.full_name}"
ACK, LIST, DELETE = (f"{SERVICE}/{each}" for each in ("AckFeed", "ListFeedConsumers", "DeleteFeedConsumer"))


class MergedConsumers:
    """The consumers of a gateway.

    Args:
        relay: the workers.

    Attributes:
        works: what the methods do, by their paths.
    """

    def __init__(self, relay: Relay) -> None:
        self._relay = relay
        self.works: Mapping[str, Work] = {
            ACK: partial(self._changing, feed_pb2.AckFeedRequest, self._acknowledge),
            DELETE: partial(self._changing, feed_pb2.DeleteFeedConsumerRequest, self._delete),
            LIST: self._list,
        }

    async def _changing(self, kind: Any, work: Any, call: Call) -> bytes:
        with call.cutoff():
            message = await call.receive()
        call.finish()
        return await self._relay.found(lambda: work(kind.FromString(message), message, call))

    async def _acknowledge(self, request: feed_pb2.AckFeedRequest, message: bytes, call: Call) -> bytes:
        links = self._links(request)
        if len(links) == 1:
            return await links[0].ask(ACK, call, message)
        call.access.require_past(request.prefix)
        standings = decode_acknowledged_standings(request) or [BEGINNING] * len(links)
        if len(standings) != len(links):
            raise PositionForgottenError
        parts = []
        for standing in standings:
            part = feed_pb2.AckFeedRequest()
            part.CopyFrom(request)
            part.position = b"" if standing == BEGINNING else encode_standings([standing])
            parts.append(part.SerializeToString())
        answers = await together(link.ask(ACK, call, part) for link, part in zip(links, parts, strict=True))
        found = [feed_pb2.AckFeedResponse.FromString(answer).consumer for answer in answers]
        return call.serialize(feed_pb2.AckFeedResponse(consumer=_merged(found, len(links))))

    async def _delete(self, request: feed_pb2.DeleteFeedConsumerRequest, message: bytes, call: Call) -> bytes:
        """Delete a consumer wherever it is; the first worker that does not have it says so if none has."""
        links = self._links(request)
        answers, missing = [], []
        for link in links:
            try:
                answers.append(await link.ask(DELETE, call, message))
            except RelayedError as error:
                if error.status.code != code_pb2.NOT_FOUND:
                    raise
                missing.append(error)
        if not answers:
            raise missing[0]
        return answers[0]

    async def _list(self, call: Call) -> bytes:
        with call.cutoff():
            message = await call.receive()
            return await self._relay.found(lambda: self._listed(message, call))

    async def _listed(self, message: bytes, call: Call) -> bytes:
        """A page of all workers: a consumer of a prefix that is on a page is on that of each worker that has it."""
        links = self._relay.links
        pages = await together(link.ask(LIST, call, message) for link in links)
        if len(pages) == 1:
            return pages[0]
        _, _, size = decode_consumers_page(feed_pb2.ListFeedConsumersRequest.FromString(message))
        parsed = [feed_pb2.ListFeedConsumersResponse.FromString(page) for page in pages]
        found: dict[ConsumerId, list[feed_pb2.FeedConsumer]] = {}
        for page in parsed:
            for each in page.consumers:
                found.setdefault(_id(each), []).append(each)
        shown = sorted(found)[:size]
        more = len(found) > size or any(page.next_page_token for page in parsed)
        merged = feed_pb2.ListFeedConsumersResponse(next_page_token=token_of(shown[-1]) if more else "")
        merged.consumers.extend(_merged(found[ident], len(links)) for ident in shown)
        return call.serialize(merged)

    def _links(self, request: feed_pb2.AckFeedRequest | feed_pb2.DeleteFeedConsumerRequest) -> Sequence[WorkerLink]:
        """The workers that have a consumer."""
        feed = decode_fed_by(request)
        return self._relay.links if feed.prefix else [self._relay.link(feed.name)]


def _id(consumer: feed_pb2.FeedConsumer) -> ConsumerId:
    of_prefix = consumer.HasField("prefix")
    return ConsumerId(FedBy(consumer.prefix if of_prefix else consumer.hull, of_prefix), consumer.name)


def _merged(parts: Sequence[feed_pb2.FeedConsumer], workers: int) -> feed_pb2.FeedConsumer:
    """A consumer as all workers have it that know it; without a position unless all do."""
    merged = feed_pb2.FeedConsumer()
    merged.CopyFrom(parts[0])
    if not merged.HasField("prefix"):
        return merged
    merged.backlog = sum(each.backlog for each in parts)
    merged.replaced = any(each.replaced for each in parts)
    standings = [standing for each in parts for standing in decode_standings(each.position) or [BEGINNING]]
    known = len(standings) == workers and standings != [BEGINNING] * workers
    merged.position = encode_standings(standings) if known else b""
    return merged
