"""Watches of fences at a gateway: many callers cost the worker one watch.

A watch begins as one of its caller's own, which the worker checks and answers. Once the caller has all events up to one
at which the fence's feed has been lately, it gets the responses of the feed. A caller that is so slow that the feed has
forgotten the next one gets a watch of its own again. So nobody waits for a slow caller, and there are no queues.
Consumers and watches that are limited or conflated stay their callers' own.
"""

from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from functools import partial
from typing import NamedTuple

from dynhull_proto.v1 import fence_service_pb2 as pb
from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.decode_fence import decode_fence_name
from dynhull_server.rpc.methods import FENCES
from dynhull_server.rpc.metrics import Metrics

from .callers import metadata_of
from .feeds import Feeds, WatchFeed, require_allowed, tokens_have_changed
from .relay import Relay
from .upstream import one_request
from .worker_link import WorkerLink

WATCH_FENCE = f"/{FENCES.full_name}/WatchFence"
GET_FENCE = f"/{FENCES.full_name}/GetFence"
# The last responses of a feed, at which watches can join it, and their bytes, at most.
RECENT, RECENT_BYTES = 64, 2**22

Sending = Callable[[], AbstractContextManager[None]]


class SharedFences:
    """The watches of fences of a gateway.

    Args:
        relay: the workers.
        metrics: counts the watchers.
    """

    def __init__(self, relay: Relay, metrics: Metrics) -> None:
        self._relay = relay
        self._metrics = metrics
        self._feeds: Feeds[FenceFeed] = Feeds()

    async def watch(self, call: Call) -> None:
        """The method `WatchFence`."""
        with call.stream(), self._metrics.watcher() as watcher, ExitStack() as joined:
            with call.cutoff():
                message = await call.receive()
            request = pb.WatchFenceRequest.FromString(message)
            call.access.require_read(decode_fence_name(request.name))
            link = self._relay.link(request.name)
            sending = partial(self._metrics.sending, watcher, "fence")
            if request.HasField("consumer") or request.conflate or request.max_responses_per_second:
                await self._relay.read_from(link, WATCH_FENCE, call, message, sending)
            else:
                work = partial(self._share, call, link, request, joined, sending)
                await link.answer(WATCH_FENCE, call, message, work)

    async def _share(
        self, call: Call, link: WorkerLink, request: pb.WatchFenceRequest, joined: ExitStack, sending: Sending
    ) -> None:
        """Pass on a watch of the caller's own and the feed by turns, until the watch ends."""
        feed: FenceFeed | None = None
        while True:
            found = await self._catch_up(call, link, request, feed, joined, sending)
            if found is None:
                return
            feed, number = found
            await require_allowed(call, link, GET_FENCE, pb.GetFenceRequest(name=request.name))
            sequence = await self._follow(call, feed, number, sending)
            if sequence is None:
                return
            request.uid, request.after_sequence = feed.uid, sequence
            if feed.over:  # the tokens of the worker have changed
                joined.close()
                feed = self._feed(link, request, feed.uid, joined)

    async def _catch_up(
        self,
        call: Call,
        link: WorkerLink,
        request: pb.WatchFenceRequest,
        feed: "FenceFeed | None",
        joined: ExitStack,
        sending: Sending,
    ) -> "tuple[FenceFeed, int] | None":
        """Pass on a watch of the caller's own, until the caller has what the feed had at one of its last responses.

        Returns the feed and the number of that response; None if the watch has ended.
        """
        resumed = feed is not None
        upstream = link.stream(WATCH_FENCE, metadata_of(call))
        async with one_request(upstream, request.SerializeToString(), call.cutoff()):
            while True:
                with call.cutoff():
                    message = await upstream.read()
                if message is None:
                    return None
                response = pb.WatchFenceResponse.FromString(message)
                if not resumed:  # otherwise it says that the watch has begun, which the caller knows
                    with sending():
                        await self._relay.send(call, message)
                resumed = False
                if feed is None:
                    feed = self._feed(link, request, response.uid, joined)
                with call.cutoff():
                    await feed.begun()
                number = feed.number_at(response.sequence)
                if number is not None:
                    return feed, number

    def _feed(self, link: WorkerLink, request: pb.WatchFenceRequest, uid: str, joined: ExitStack) -> "FenceFeed":
        """The feed for watches like this one, of the fence with this uid."""
        kind = pb.WatchFenceRequest()
        kind.CopyFrom(request)
        kind.uid, kind.only_new = uid, True
        begin = partial(FenceFeed, link, kind)
        return joined.enter_context(self._feeds.use(kind.SerializeToString(deterministic=True), begin))

    async def _follow(self, call: Call, feed: "FenceFeed", number: int, sending: Sending) -> int | None:
        """Pass on the feed from the response after that with this number.

        Returns the sequence that the caller has, if the feed has forgotten the next response, or the tokens of the
        worker have changed; None if the watch has ended.
        """
        sequence = feed.at(number).sequence
        while True:
            with call.cutoff():
                await feed.beyond(number)
            if feed.latest == number:
                return sequence if tokens_have_changed(feed.failure) else None
            number += 1
            if not feed.keeps(number):
                return sequence
            message, sequence = feed.at(number)
            with sending():
                await self._relay.send(call, message)


class Response(NamedTuple):
    """A response, and the sequence that it leads to."""

    message: bytes
    sequence: int


class FenceFeed(WatchFeed):
    """One watch of a worker, for all watches of a fence; its responses are numbered from 1.

    Args:
        link: the worker.
        request: the watch.

    Attributes:
        uid: that of the fence.
        latest: the number of the last response.
    """

    def __init__(self, link: WorkerLink, request: pb.WatchFenceRequest) -> None:
        super().__init__(link, WATCH_FENCE, request, request.name)
        self.uid = request.uid
        self.latest = 0
        self._recent: deque[Response] = deque()
        self._bytes = 0

    def number_at(self, sequence: int) -> int | None:
        """The number of the last response that leads to a sequence, None if it is not kept or the feed has ended."""
        if self.over:
            return None
        numbers = range(self.latest, self.latest - len(self._recent), -1)
        return next((number for number in numbers if self.at(number).sequence == sequence), None)

    def keeps(self, number: int) -> bool:
        """Whether a response that was received is kept."""
        return self.latest - number < len(self._recent)

    def at(self, number: int) -> Response:
        """A response that is kept."""
        return self._recent[number - self.latest - 1]

    async def begun(self) -> None:
        """Wait for the first response, or for the end."""
        while not self.latest and not self.over:
            await self._moved.wait()

    async def beyond(self, number: int) -> None:
        """Wait for a response after that with this number, or for the end. Raises what the feed has failed with."""
        while self.latest == number and not self.over:
            await self._moved.wait()
        if self.latest == number and self.failure is not None and not tokens_have_changed(self.failure):
            raise self.failure

    async def _take(self, message: bytes) -> None:
        self._recent.append(Response(message, pb.WatchFenceResponse.FromString(message).sequence))
        self._bytes += len(message)
        self.latest += 1
        while len(self._recent) > RECENT or (self._bytes > RECENT_BYTES and len(self._recent) > 1):
            self._bytes -= len(self._recent.popleft().message)
        self._wake()
