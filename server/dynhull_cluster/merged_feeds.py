"""Feeds at a gateway: that of one hull is passed on, and those of a prefix are merged from all workers.

Each worker sends its batches in the order of their commits. The position of a caller is that of each worker, so nothing
of another worker comes between the batches of one commit.
"""

import asyncio
from collections.abc import Sequence
from contextlib import AsyncExitStack
from functools import partial

from dynhull_proto.v1 import feed_pb2
from dynhull_server.engine.positions import BEGINNING, Standing, decode_standings, encode_standings
from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.decode_feed import decode_feed_choice, decode_feed_standings
from dynhull_server.rpc.methods import DESCRIPTOR
from dynhull_server.rpc.metrics import Metrics
from dynhull_server.rpc.status import RelayedError
from dynhull_server.state.errors import PositionForgottenError

from .callers import metadata_of
from .relay import Relay
from .upstream import Upstream, lost_status, one_request
from .worker_link import Patience, RetiredError, WorkerLink

FEED = f"/{DESCRIPTOR.full_name}/Feed"


class MergedFeeds:
    """The feeds of a gateway.

    Args:
        relay: the workers.
        metrics: counts those who read.
    """

    def __init__(self, relay: Relay, metrics: Metrics) -> None:
        self._relay = relay
        self._metrics = metrics

    async def feed(self, call: Call) -> None:
        """The method `Feed`."""
        with call.stream(), self._metrics.watcher() as watcher:
            with call.cutoff():
                message = await call.receive()
            request = feed_pb2.FeedRequest.FromString(message)
            choice = decode_feed_choice(request)
            if choice is None or len(self._relay.links) == 1:
                link = self._relay.route(message, call)
                await self._relay.read_from(link, FEED, call, message, partial(self._metrics.sending, watcher, "feed"))
                return
            assert choice.prefix is not None  # see `decode_feed_choice`
            call.access.require_past(choice.prefix)
            while True:
                try:
                    await self._merge(call, request, self._relay.links, watcher)
                except RetiredError:  # the names are divided among others
                    if call.begun:
                        raise PositionForgottenError from None

    async def _merge(
        self, call: Call, request: feed_pb2.FeedRequest, links: Sequence[WorkerLink], watcher: object
    ) -> None:
        starts = _starts(request, len(links))
        async with AsyncExitStack() as stack:
            upstreams: list[Upstream] = []
            for link, start in zip(links, starts, strict=True):
                with call.cutoff():
                    await link.arrive(Patience())
                stream = link.stream(FEED, metadata_of(call))
                begun = one_request(stream, start.SerializeToString(), call.cutoff())
                upstreams.append(await stack.enter_async_context(begun))
            standings: list[Standing] = []
            for number, upstream in enumerate(upstreams):
                while len(standings) == number:
                    response = await _read(call, upstream)
                    part = feed_pb2.FeedResponse.FromString(response)
                    if part.position:
                        standings += decode_standings(part.position)
                        part.position = encode_standings(standings) if len(standings) == len(upstreams) else b""
                    await self._send(call, part.SerializeToString(), watcher)
            await self._pass_on(call, upstreams, standings, watcher)

    async def _pass_on(self, call: Call, upstreams: list[Upstream], standings: list[Standing], watcher: object) -> None:
        """Send what each worker sends next, whole commits at a time."""
        coming = {asyncio.ensure_future(each.read()): number for number, each in enumerate(upstreams)}
        try:
            while True:
                with call.cutoff():
                    done, _ = await asyncio.wait(coming, return_when=asyncio.FIRST_COMPLETED)
                for read in done:
                    number = coming.pop(read)
                    response = _there(read.result())
                    while not (position := feed_pb2.FeedResponse.FromString(response).position):
                        await self._send(call, response, watcher)
                        response = await _read(call, upstreams[number])
                    (standings[number],) = decode_standings(position)
                    ours = feed_pb2.FeedResponse(position=encode_standings(standings))
                    await self._send(call, response + ours.SerializeToString(), watcher)  # the last position counts
                    coming[asyncio.ensure_future(upstreams[number].read())] = number
        finally:
            for read in coming:
                read.cancel()
            await asyncio.gather(*coming, return_exceptions=True)

    async def _send(self, call: Call, response: bytes, watcher: object) -> None:
        with self._metrics.sending(watcher, "feed"):
            await self._relay.send(call, response)


def _starts(request: feed_pb2.FeedRequest, workers: int) -> list[feed_pb2.FeedRequest]:
    """The request to each worker; raises PositionForgottenError for a position of other workers."""
    standings = decode_feed_standings(request)
    starts = []
    for _ in range(workers):
        start = feed_pb2.FeedRequest()
        start.CopyFrom(request)
        starts.append(start)
    if standings is None or standings == [BEGINNING]:
        return starts
    if len(standings) != workers:
        raise PositionForgottenError
    for start, standing in zip(starts, standings, strict=True):
        start.position = encode_standings([standing])
    return starts


async def _read(call: Call, upstream: Upstream) -> bytes:
    with call.cutoff():
        return _there(await upstream.read())


def _there(response: bytes | None) -> bytes:
    """A response; a worker that ends a feed without an error is lost."""
    if response is None:
        raise RelayedError(lost_status())
    return response
