"""Sending the past of a hull to a caller, event by event."""

from contextlib import closing

from dynhull_proto.v1 import hull_service_pb2 as pb

from ..engine.hulls import Hulls
from ..engine.live_hull import LiveHull
from ..engine.past import PastHulls
from ..engine.replay import replay
from ..engine.steps import Run
from ..engine.views import Event
from ..state.errors import HullReplacedError
from ..storage.past import Moment
from . import decode, encode
from .calls import Call
from .decode_moment import decode_end
from .decode_replay import decode_pace, decode_view
from .outgoing import send_each
from .places import Places


class Replays:
    """The replays of a server.

    Args:
        hulls: the hulls.
        places: limits their number, because each has a hull of its own.
        aside: runs what takes long.
        max_lag: the seconds that a reader may take to receive an event.
    """

    def __init__(self, hulls: Hulls, places: Places, aside: Run, max_lag: float) -> None:
        self._hulls = hulls
        self._places = places
        self._aside = aside
        self._max_lag = max_lag

    async def send(self, request: pb.ReplayRequest, live: LiveHull, call: Call) -> None:
        """Send the events of a hull, whose past the caller may read."""
        encoding = decode.decode_encoding(request.encoding)
        pace = decode_pace(request)
        decode_view(request, live)
        with self._places.take(call.owner):
            with call.cutoff():
                first, last = await self._ends(request, live)
                hull = await self._hulls.replayed(live, first.revision, last)
            origin = None if hull.committed is None else hull.committed.time
            if (start := decode_end(request, "start")) is not None and start[0] is None:
                origin = start[1]
            events = replay(
                hull,
                decode_view(request, hull),
                pace,
                origin=origin,
                resumed=request.HasField("resume") and not first.erased,  # the reader may have keys that are no more
                outline_only=request.outline_only,
            )
            measure = hull.measures if request.include_measures else None

            async def encoded(event: Event) -> pb.ReplayResponse:
                message = await encode.encode_watched(event, encoding, self._aside, measure)
                encode.encode_changed(hull, message)
                message.erased = hull.erased_at(message.revision)
                return pb.ReplayResponse(event=message)

            with closing(hull):
                await send_each(call, events, encoded, self._max_lag)

    async def _ends(self, request: pb.ReplayRequest, live: LiveHull) -> tuple[Moment, int]:
        """The first revision and the last one."""
        if not request.HasField("resume"):
            first, last = await ends(request, live, self._hulls.pasts)
            return first, last
        if request.resume.uid != live.uid:
            raise HullReplacedError(live.name, live.uid)
        first = await self._hulls.pasts.moment(live, request.resume.revision, 0, "resume.")
        return first, await last_of(request, live, self._hulls.pasts, first.revision)


async def ends(request: pb.ReplayRequest | pb.TrackRequest, live: LiveHull, pasts: PastHulls) -> tuple[Moment, int]:
    """The first moment of a request about a part of the past, and the last revision."""
    start = decode_end(request, "start")
    first = await (pasts.oldest(live) if start is None else pasts.moment(live, *start, "start_"))
    return first, await last_of(request, live, pasts, first.revision)


async def last_of(request: pb.ReplayRequest | pb.TrackRequest, live: LiveHull, pasts: PastHulls, first: int) -> int:
    """The last revision, which is not before the first one."""
    end = decode_end(request, "end")
    last = live.counts.revision if end is None else (await pasts.moment(live, *end, "end_")).revision
    if last < first:
        problem = f"is before the start, which is revision {first}"
        raise decode.InvalidFieldError(request.WhichOneof("end") or "start", f"revision {last}", problem)
    return last
