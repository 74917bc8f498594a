"""Sending the ways of keys through the past of a hull."""

import numpy as np

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2

from ..engine.hulls import Hulls
from ..engine.live_hull import LiveHull
from ..engine.past import PastHulls
from ..engine.tracks import require_tracks, tracks
from ..state.records import NO_TIME
from ..state.tracks import Moves
from ..storage.past import Moment
from . import decode, encode
from .calls import Call
from .decode_batch import decode_keys
from .decode_moment import decode_end
from .decode_settings import decode_duration
from .outgoing import send_each
from .places import Places
from .replays import ends


class Tracks:
    """The tracks that a server sends.

    Args:
        hulls: the hulls.
        places: limits the reads of the past at a time.
        max_lag: the seconds that a reader may take to receive a part.
    """

    def __init__(self, hulls: Hulls, places: Places, max_lag: float) -> None:
        self._hulls = hulls
        self._places = places
        self._max_lag = max_lag

    async def send(self, request: pb.TrackRequest, live: LiveHull, call: Call) -> None:
        """Send the ways of keys of a hull, whose past the caller may read."""
        encoding = decode.decode_encoding(request.encoding)
        every = decode_duration(request.every, "every", 1) if request.HasField("every") else 0
        keys = live.keys(decode_keys(request.keys, "keys"))
        require_tracks(live)
        pasts = self._hulls.pasts
        with self._places.take(call.owner):
            with call.cutoff():
                first, last = await ends(request, live, pasts)
                begin = await self._begin(request, live, first)

            async def encoded(moves: Moves) -> pb.TrackResponse:
                return encode_moves(moves, encoding)

            parts = tracks(pasts, live, keys, first.revision, last, begin, every)
            await send_each(call, parts, encoded, self._max_lag)

    async def _begin(self, request: pb.TrackRequest, live: LiveHull, first: Moment) -> int | None:
        """The time at which a track begins: that which is asked for, or that of the commit of its first revision."""
        start = decode_end(request, "start")
        if start is not None and start[0] is None:
            return start[1]
        return await time_of(self._hulls.pasts, live, first)


async def time_of(pasts: PastHulls, live: LiveHull, moment: Moment) -> int | None:
    """When a revision was committed; None where that is not known."""
    committed = moment.committed
    if committed is None and moment.revision:
        oldest = await pasts.oldest(live)
        if oldest.revision == moment.revision:
            committed = oldest.committed
        else:
            committed = (await pasts.batches(live, moment.revision - 1, moment.revision))[0].committed
    elif committed is None:
        return round(live.created.timestamp() * 1_000_000)
    return None if committed is None else committed.time


def encode_moves(moves: Moves, encoding: points_pb2.PointEncoding) -> pb.TrackResponse:
    """A part of the rows of tracks."""
    timed = bool((moves.event_times != NO_TIME).any())
    return pb.TrackResponse(
        key_indices=moves.rows.tolist(),
        times=encode.encode_times(moves.times, encoding),
        positions=encode.encode_points(np.ascontiguousarray(moves.points), encoding),
        event_times=encode.encode_times(moves.event_times, encoding) if timed else None,
        revisions=moves.revisions.tolist(),
        accuracies=encode.encode_accuracies(moves.accuracies, encoding) if moves.accuracies.any() else None,
    )
