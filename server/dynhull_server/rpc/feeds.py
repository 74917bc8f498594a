"""Sending the batches of hulls to a caller."""

from collections.abc import AsyncGenerator, Callable
from typing import TypeVar

from dynhull_proto.v1 import feed_pb2

from ..engine.feed_many import OfHull
from ..engine.hulls import Hulls
from ..engine.live_hull import LiveHull
from ..engine.roster import Roster, RosterLimits
from ..engine.rosters import Choice
from ..state.errors import HullReplacedError, PositionForgottenError
from . import decode
from .calls import Call
from .decode_feed import decode_feed_standings, decode_feed_start
from .encode_feed import encode_feed, encode_many_feed
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
        parts = self._hulls.feeds.follow(hull, decode_feed_start(request), decode.decode_interval(request))
        with self._places.take(call.owner):
            await self._send(call, parts, lambda part: encode_feed(part, of, encoding))

    async def send_many(self, request: feed_pb2.FeedRequest, choice: Choice, call: Call) -> None:
        """Send the batches of all hulls with a prefix."""
        assert choice.prefix is not None  # see `decode_feed_choice`
        call.access.require_past(choice.prefix)
        self._hulls.feeds.require_kept(f"{choice.prefix}*")
        encoding, interval = decode.decode_encoding(request.encoding), decode.decode_interval(request)
        start = decode_feed_standings(request)
        if start is not None and len(start) != 1:
            raise PositionForgottenError
        # The roster of who watches summaries of the same hulls: a feed asks it for no states.
        states, kind = HullStates(self._hulls, encoding, outline=False, most=0), (encoding, False, 0)
        rosters = self._hulls.rosters
        with self._places.take(call.owner), rosters.use(kind, choice, lambda: Roster(states, self._limits)) as roster:
            parts = self._hulls.feed(roster).follow(None if start is None else start[0], interval)
            await self._send(call, parts, lambda part: encode_many_feed(part, encoding))

    async def _send(
        self, call: Call, parts: AsyncGenerator[T, None], encoded: Callable[[T], feed_pb2.FeedResponse]
    ) -> None:
        async def message(part: T) -> feed_pb2.FeedResponse:
            return encoded(part)

        await send_each(call, parts, message, self._max_lag, Counted(self._metrics, "feed"))
