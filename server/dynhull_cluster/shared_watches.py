"""Watches of hulls at a gateway: many callers cost the worker one watch.

A watch begins as one of its caller's own, which the worker checks and answers. As soon as the gateway knows what the
caller holds, the caller gets its events from the feed of all watches of the same kind: the next event as it arrived, or
the change since the last one that it took. So nobody waits for a caller that is slow, and there are no queues. A watch
that is resumed without a snapshot stays one of its own until the feed has been at its revision, and one that gets
sketches always does.
"""

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.decode import decode_name, decode_rate
from dynhull_server.rpc.methods import DESCRIPTOR
from dynhull_server.rpc.metrics import Metrics
from dynhull_server.rpc.status import RelayedError
from dynhull_server.state.errors import HullNotFoundError

from .callers import metadata_of
from .feeds import Feeds, WatchFeed, require_allowed, tokens_have_changed
from .held import WatcherHull
from .relay import Relay
from .upstream import lost_status, one_request
from .worker_link import WorkerLink

WATCH = f"/{DESCRIPTOR.full_name}/Watch"
LOCATE = f"/{DESCRIPTOR.full_name}/Locate"
# Vertices that are compared and edited on the event loop, at most.
FEW = 256
# The last revisions of a feed, at which watches can join it, and the bytes of their vertices.
RECENT, RECENT_BYTES = 16, 2**22

T = TypeVar("T")


class SharedWatches:
    """The watches of a gateway.

    Args:
        relay: the workers.
        metrics: counts the watchers.
    """

    def __init__(self, relay: Relay, metrics: Metrics) -> None:
        self._relay = relay
        self._metrics = metrics
        self._feeds: Feeds[HullFeed] = Feeds()

    async def watch(self, call: Call) -> None:
        """The method `Watch`."""
        with call.stream(), self._metrics.watcher() as watcher, ExitStack() as joined:
            with call.cutoff():
                message = await call.receive()
            request = pb.WatchRequest.FromString(message)
            call.access.require_read(decode_name(request.name))
            link = self._relay.link(request.name)
            begin = partial(self._begin, call, link, request, message, watcher, joined)
            found = await link.answer(WATCH, call, message, begin)
            if found is not None:
                await self._follow(call, link, request, watcher, joined, *found)

    async def _begin(
        self,
        call: Call,
        link: WorkerLink,
        request: pb.WatchRequest,
        message: bytes,
        watcher: object,
        joined: ExitStack,
    ) -> "tuple[HullFeed, WatcherHull] | None":
        """Pass on a watch of the caller's own, until what the caller holds is known; None if it ends before."""
        revision = request.resume.revision
        # Otherwise the first event has to come before the next one of the feed, or after it, or names all vertices.
        may_join = not (request.min_revision > revision or request.max_events_per_second or request.include_keys)
        feed: HullFeed | None = None
        if request.resume.uid:
            feed = joined.enter_context(self._feed(link, request, request.resume.uid))
            if may_join and (held := feed.recent.get(revision)) is not None:
                return feed, held
        async with one_request(link.stream(WATCH, metadata_of(call)), message, call.cutoff()) as upstream:
            while True:
                reading = asyncio.ensure_future(upstream.read())
                meeting = asyncio.ensure_future(feed.at(revision)) if feed is not None and may_join else None
                try:
                    with call.cutoff():
                        if meeting is not None:
                            await asyncio.wait({reading, meeting}, return_when=asyncio.FIRST_COMPLETED)
                            if not reading.done() and (held := meeting.result()) is not None:
                                assert feed is not None
                                return feed, held
                        response = await reading
                finally:
                    _drop(reading, meeting)
                if response is None:
                    return None
                event = pb.WatchResponse.FromString(response)
                with self._metrics.sending(watcher, event.WhichOneof("event")):
                    await self._relay.send(call, response)
                revision, may_join = event.revision, True
                if event.HasField("snapshot"):
                    if feed is None or feed.uid != event.snapshot.uid:
                        feed = joined.enter_context(self._feed(link, request, event.snapshot.uid))
                    return feed, WatcherHull.of(event, keys=request.include_keys)

    async def _follow(
        self,
        call: Call,
        link: WorkerLink,
        request: pb.WatchRequest,
        watcher: object,
        joined: ExitStack,
        feed: "HullFeed",
        held: WatcherHull,
    ) -> None:
        """Pass on the feed to a caller, and the next one when the tokens of the worker have changed."""
        loop = asyncio.get_running_loop()
        interval = decode_rate(request.max_events_per_second)
        sent = loop.time()
        number: int | None = None
        while True:
            with call.cutoff():
                if number is None:
                    await feed.at(held.revision)
                    await require_allowed(call, link, LOCATE, pb.LocateRequest(name=request.name))
                await feed.beyond(number, held.revision)
                await feed.pause(sent + interval - loop.time())
                event: Event | None = None
                if (failure := feed.failure) is None:
                    number, held, event = await feed.since(number, held)
                elif tokens_have_changed(failure):
                    joined.close()
                    feed, number = joined.enter_context(self._feed(link, request, feed.uid)), None
                else:
                    raise failure
            if event is not None:
                sent = loop.time()
                with self._metrics.sending(watcher, event.kind):
                    await self._relay.send(call, event.message)

    def _feed(self, link: WorkerLink, request: pb.WatchRequest, uid: str) -> "AbstractContextManager[HullFeed]":
        """The feed for watches like this one, of the hull with this uid."""
        kind = pb.WatchRequest()
        kind.CopyFrom(request)
        kind.ClearField("resume")
        kind.ClearField("min_revision")
        return self._feeds.use((uid, kind.SerializeToString(deterministic=True)), partial(HullFeed, link, kind, uid))


@dataclass(frozen=True, slots=True)
class Event:
    """The message of an event, and its kind."""

    message: bytes
    kind: str


class HullFeed(WatchFeed):
    """One watch of a worker, for all watches of a kind.

    Args:
        link: the worker.
        request: the watch.
        uid: that of the hull.

    Attributes:
        uid: that of the hull.
        recent: what watchers hold at the last revisions.
    """

    def __init__(self, link: WorkerLink, request: pb.WatchRequest, uid: str) -> None:
        ending = RelayedError(lost_status())  # watches do not end by themselves
        super().__init__(link, WATCH, request, request.name, ending)
        self.uid = uid
        self.recent: OrderedDict[int, WatcherHull] = OrderedDict()
        self._request = request
        self._number = 0
        self._latest = Event(b"", "")
        self._event = pb.WatchResponse()
        self._measures = pb.WatchResponse().measures
        self._held: WatcherHull | None = None

    async def at(self, revision: int) -> WatcherHull | None:
        """Wait until the feed is at this revision or later; what watchers hold at it, None if that is not known."""
        while self.failure is None and (self._held is None or self._held.revision < revision):
            await self._moved.wait()
        return None if self.failure is not None else self.recent.get(revision)

    async def beyond(self, number: int | None, revision: int) -> None:
        """Wait for a message after that with this number, at this revision or later, or for the end of the feed."""
        while self.failure is None and (self._held is None or self._number == number or self._held.revision < revision):
            await self._moved.wait()

    async def pause(self, seconds: float) -> None:
        """Wait for a time, or for the end of the feed."""
        if seconds > 0:
            await asyncio.wait([self._running], timeout=seconds)
        else:
            await asyncio.sleep(0)

    async def since(self, number: int | None, held: WatcherHull) -> tuple[int, WatcherHull, Event | None]:
        """The number of the last message, what watchers hold after it, and what brings a watcher there, if anything.

        Args:
            number: that of the last message which the watcher has got, None for none.
            held: what the watcher holds.
        """
        now, last, event, measures = self._held, self._number, self._event, self._measures
        assert now is not None
        if number == last - 1:
            return last, now, self._latest
        if now.revision == held.revision:
            return last, now, None if number is None else self._latest
        change = await _run(held.change_to, len(held.vertices) + len(now.vertices), now, self._request.encoding)
        if change is None and self._request.outline_only and now.center == held.center:
            return last, now, None
        response = pb.WatchResponse(revision=event.revision, point_count=event.point_count, cause=event.cause)
        if event.HasField("clock_time"):
            response.clock_time.CopyFrom(event.clock_time)
        if event.HasField("center"):
            response.center.CopyFrom(event.center)
        if event.HasField("changed_time"):
            response.changed_time.CopyFrom(event.changed_time)
        if change is None:
            response.progress.SetInParent()
        else:
            response.change.CopyFrom(change)
            if self._request.include_measures:
                response.measures.CopyFrom(measures)
        return last, now, Event(response.SerializeToString(), response.WhichOneof("event"))

    async def _take(self, message: bytes) -> None:
        event = pb.WatchResponse.FromString(message)
        if self._held is None:
            if event.snapshot.uid != self.uid:  # it was deleted meanwhile, and created again
                raise HullNotFoundError(self._request.name)
            held = WatcherHull.of(event, keys=self._request.include_keys)
        else:
            held = await _run(self._held.after, len(self._held.vertices), event)
        if event.HasField("measures"):
            self._measures = event.measures
        self._held, self._event, self._latest = held, event, Event(message, event.WhichOneof("event"))
        self._number += 1
        self.recent[held.revision] = held
        while len(self.recent) > RECENT or (len(self.recent) > 1 and self._recent_bytes() > RECENT_BYTES):
            self.recent.popitem(last=False)
        self._wake()

    def _recent_bytes(self) -> int:
        return sum(each.vertices.nbytes for each in self.recent.values())


async def _run(function: Callable[..., T], rows: int, *arguments: Any) -> T:
    """Call a function: in a thread if it is about many vertices."""
    return function(*arguments) if rows <= FEW else await asyncio.to_thread(function, *arguments)


def _drop(*tasks: "asyncio.Future[Any] | None") -> None:
    """Cancel tasks, or pass over what they have raised."""
    for task in tasks:
        if task is not None and not task.cancel() and not task.cancelled():
            task.exception()
