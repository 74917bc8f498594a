"""What a caller wants to follow of a hull, live or in its past."""

from typing import Any

from dynhull_proto.v1 import hull_service_pb2 as pb

from ..engine.live_hull import LiveHull
from ..engine.replay import Pace
from ..engine.views import FewView, SketchView, VerticesView, View
from .decode import (
    InvalidFieldError,
    decode_directions,
    decode_interval,
    decode_layer,
    decode_max_vertices,
    decode_rate,
)
from .decode_settings import decode_duration

# Times as fast as it was: a year in half a minute.
FASTEST = 1_000_000


def decode_view(request: Any, hull: LiveHull) -> View:
    """The part of a hull that a watch or a replay follows, from its beginning."""
    keys, measures = request.include_keys, request.include_measures
    if keys:
        hull.require_keys("include_keys")
    layer, most = decode_layer(request), decode_max_vertices(request)
    if request.HasField("directions"):
        return SketchView(hull, decode_directions(request.directions), vertices=measures, keys=keys)
    if most:
        return FewView(hull, most, vertices=measures, keys=keys, layer=layer)
    return VerticesView(hull, keys=keys, layer=layer)


def decode_pace(request: pb.ReplayRequest) -> Pace:
    """How fast the past goes by."""
    if not (request.speed == 0 or 1 / FASTEST <= request.speed <= FASTEST):
        problem = f"must be from 1/{FASTEST} to {FASTEST}, or 0 for as fast as the events are read"
        raise InvalidFieldError("speed", request.speed, problem)
    return Pace(
        request.speed,
        decode_duration(request.every, "every", 1) if request.HasField("every") else 0,
        decode_rate(request.max_events_per_second),
        decode_interval(request),
    )
