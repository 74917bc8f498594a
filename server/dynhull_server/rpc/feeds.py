"""Sending the batches of hulls to a caller."""

from collections.abc import AsyncGenerator, Callable
from typing import TypeVar

from dynhull_proto.v1 import feed_pb2

from ..engine.feed_many import OfHull
from ..engine.hulls import Hulls
from ..engine.live_hull import LiveHull
from ..engine.positions import BEGINNING, Standing
from ..engine.roster import Roster, RosterLimits
from ..engine.rosters import Choice
from ..state.errors import HullReplacedError, PositionForgottenError
from ..state.feed_consumers import ConsumerId
from . import decode
from .calls import Call
from .decode_feed import (
    decode_acknowledged,
    decode_acknowledged_standings,
    decode_consumers_page,
    decode_fed_by,
    decode_feed_consumer,
    decode_feed_standings,
    decode_feed_start,
)
from .decode_fence import decode_consumer
from .encode_feed import encode_feed, encode_feed_consumer, encode_many_feed, token_of
from .many import HullStates
from .metrics import Metrics
from .outgoing import Counted, send_each
from .places import Places

T = TypeVar("T")


class BatchFeeds:
    """The feeds of a server.

    Args:
        hulls: the hulls.
        places: limits their number.
        limits: the limits on the hulls of one feed.
        metrics: counts those who read.
        max_lag: the seconds that a reader may take to receive a message.
    """

    def __init__(self, hulls: Hulls, places: Places, limits: RosterLimits, metrics: Metrics, max_lag: float) -> None:
        self._hulls = hulls
        self._places = places
        self._limits = limits
        self._metrics = metrics
        self._max_lag = max_lag

    async def send(self, request: feed_pb2.FeedRequest, hull: LiveHull, call: Call) -> None:
        """Send the batches of a hull, whose past the caller may read."""
        if request.uid and request.uid != hull.uid:
            raise HullReplacedError(hull.name, hull.uid, "uid")
        encoding, of = decode.decode_encoding(request.encoding), OfHull(hull.name, hull.uid)
        interval, consumer = decode.decode_interval(request), decode_feed_consumer(request)
        with self._places.take(call.owner):
            if consumer is None:
                after = decode_feed_start(request)
            else:
                with call.cutoff():
                    after = await self._hulls.feed_consumers.revision(hull, consumer)
            parts = self._hulls.feeds.follow(hull, after, interval)
            await self._send(call, parts, lambda part: encode_feed(part, of, encoding))

    async def send_many(self, request: feed_pb2.FeedRequest, choice: Choice, call: Call) -> None:
        """Send the batches of all hulls with a prefix."""
        assert choice.prefix is not None  # see `decode_feed_choice`
        call.access.require_past(choice.prefix)
        self._hulls.feeds.require_kept(f"{choice.prefix}*")
        encoding, interval = decode.decode_encoding(request.encoding), decode.decode_interval(request)
        start = await self._start(request, choice.prefix, call)
        # The roster of who watches summaries of the same hulls: a feed asks it for no states.
        states, kind = HullStates(self._hulls, encoding, outline=False, most=0), (encoding, False, 0)
        rosters = self._hulls.rosters
        with self._places.take(call.owner), rosters.use(kind, choice, lambda: Roster(states, self._limits)) as roster:
            parts = self._hulls.feed(roster).follow(start, interval)
            await self._send(call, parts, lambda part: encode_many_feed(part, encoding))

    async def _start(self, request: feed_pb2.FeedRequest, prefix: str, call: Call) -> Standing | None:
        consumer = decode_feed_consumer(request)
        if consumer is not None:
            with call.cutoff():
                return await self._hulls.feed_consumers.place(prefix, consumer)
        start = decode_feed_standings(request)
        if start is not None and len(start) != 1:
            raise PositionForgottenError
        return None if start is None else start[0]

    async def acknowledge(self, request: feed_pb2.AckFeedRequest, call: Call) -> feed_pb2.AckFeedResponse:
        """Acknowledge batches for a consumer."""
        feed, name = decode_fed_by(request), decode_consumer(request.consumer)
        call.access.require_past(feed.name)
        consumers = self._hulls.feed_consumers
        if feed.prefix:
            standings = decode_acknowledged_standings(request) or [BEGINNING]
            if len(standings) != 1:
                raise PositionForgottenError
            state = await consumers.acknowledge_many(name, feed.name, standings[0])
        else:
            state = await consumers.acknowledge(name, feed.name, request.uid, decode_acknowledged(request))
        return feed_pb2.AckFeedResponse(consumer=encode_feed_consumer(state))

    async def listed(
        self, request: feed_pb2.ListFeedConsumersRequest, call: Call
    ) -> feed_pb2.ListFeedConsumersResponse:
        """A page of the consumers whose feeds the caller may read."""
        prefix, after, size = decode_consumers_page(request)
        found, more = self._hulls.feed_consumers.page(prefix, after, size, call.access.may_read_past)
        states = [encode_feed_consumer(await self._hulls.feed_consumers.state(each)) for each in found]
        token = token_of(found[-1].id) if more else ""
        return feed_pb2.ListFeedConsumersResponse(consumers=states, next_page_token=token)

    async def delete(self, request: feed_pb2.DeleteFeedConsumerRequest, call: Call) -> None:
        """Delete a consumer."""
        feed, name = decode_fed_by(request), decode_consumer(request.consumer)
        call.access.require_past(feed.name)
        await self._hulls.feed_consumers.delete(ConsumerId(feed, name))

    async def _send(
        self, call: Call, parts: AsyncGenerator[T, None], encoded: Callable[[T], feed_pb2.FeedResponse]
    ) -> None:
        async def message(part: T) -> feed_pb2.FeedResponse:
            return encoded(part)

        await send_each(call, parts, message, self._max_lag, Counted(self._metrics, "feed"))
