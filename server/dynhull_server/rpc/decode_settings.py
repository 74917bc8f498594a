"""Conversion of the settings of a hull."""

import math

import numpy as np
from google.protobuf.duration_pb2 import Duration

from dynhull.globe import as_center
from dynhull_proto.v1 import hull_pb2

from ..state.admission import GREATEST_TIME
from ..state.frames import off_globe
from ..state.records import FOREVER, Center, Clock, Frame, HullSettings, Identity, QuarantineRules, Window
from . import encode
from .decode import LARGEST_INTEGER, InvalidFieldError

IDENTITIES: dict[int, Identity] = {
    hull_pb2.IDENTITY_UNSPECIFIED: "multiset",
    **{number: identity for identity, number in encode.IDENTITIES.items()},
}
CLOCKS: dict[int, Clock] = {
    hull_pb2.CLOCK_UNSPECIFIED: "server",
    hull_pb2.CLOCK_SERVER: "server",
    hull_pb2.CLOCK_DATA: "data",
}
FRAMES: dict[int, Frame] = {
    hull_pb2.FRAME_UNSPECIFIED: "plane",
    **{number: frame for frame, number in encode.FRAMES.items()},
}
MICROSECONDS = 1_000_000
NANOSECONDS = 1_000  # in a microsecond
MOST_CONFIRMATIONS = 1000
MOST_SHARDS = 1024


def decode_settings(config: hull_pb2.HullConfig) -> HullSettings:
    """The settings of a new hull."""
    identity = IDENTITIES.get(config.identity)
    if identity is None:
        raise InvalidFieldError("config.identity", config.identity, "not an identity that this server supports")
    if config.max_points > LARGEST_INTEGER:
        raise InvalidFieldError("config.max_points", config.max_points, f"must be at most {LARGEST_INTEGER}")
    if config.ordering not in hull_pb2.Ordering.values():
        raise InvalidFieldError("config.ordering", config.ordering, "not an ordering that this server supports")
    by_event_time = config.ordering == hull_pb2.ORDERING_EVENT_TIME
    if by_event_time and identity == "multiset":
        raise InvalidFieldError("config.ordering", "ORDERING_EVENT_TIME", "points without keys have no order")
    window = _decode_window(config.window, by_event_time=by_event_time) if config.HasField("window") else None
    frame = FRAMES.get(config.frame)
    if frame is None:
        raise InvalidFieldError("config.frame", config.frame, "not a frame that this server supports")
    center = decode_center(config.center, "config.center") if config.HasField("center") else None
    if center is not None and frame == "plane":
        raise InvalidFieldError("config.center", center, "only a geographic hull has a centre")
    quarantine = None
    if config.HasField("quarantine"):
        if identity == "multiset":
            raise InvalidFieldError("config.quarantine", "present", "only a keyed hull has a quarantine")
        quarantine = decode_quarantine(config.quarantine, "config.quarantine")
    shards = decode_shards(config.shards, "config.shards") if config.shards else 0
    history, most = decode_history(config.history, "config.history") if config.HasField("history") else (0, 0)
    of_points = identity, config.max_points, window, by_event_time, frame, center, quarantine
    return HullSettings(*of_points, shards=shards, history=history, history_bytes=most)


def decode_history(message: hull_pb2.History, field: str) -> tuple[int, int]:
    """For how many microseconds, and in how many bytes, what the journal drops is kept."""
    if message.max_bytes > LARGEST_INTEGER:
        raise InvalidFieldError(f"{field}.max_bytes", message.max_bytes, f"must be at most {LARGEST_INTEGER}")
    if not message.HasField("max_age"):
        return FOREVER, message.max_bytes
    return decode_duration(message.max_age, f"{field}.max_age", least=1), message.max_bytes


def decode_shards(shards: int, field: str) -> int:
    """A number of shards."""
    if not 1 <= shards <= MOST_SHARDS:
        problem = f"must be at most {MOST_SHARDS}" if shards else "must be at least 1"
        raise InvalidFieldError(field, shards, problem)
    return shards


def decode_quarantine(message: hull_pb2.Quarantine, field: str) -> QuarantineRules:
    """The rules of a quarantine."""
    speed = message.max_speed if message.HasField("max_speed") else None
    if speed is not None and not 0 < speed < math.inf:
        raise InvalidFieldError(f"{field}.max_speed", speed, "must be positive and finite, or unset for no such rule")
    growth = message.max_growth if message.HasField("max_growth") else None
    if growth is not None and not 1 <= growth < math.inf:
        raise InvalidFieldError(
            f"{field}.max_growth", growth, "must be at least 1 and finite, or unset for no such rule"
        )
    if not message.HasField("confirmations"):
        return QuarantineRules(speed, growth)
    if message.confirmations > MOST_CONFIRMATIONS:
        problem = f"must be at most {MOST_CONFIRMATIONS}"
        raise InvalidFieldError(f"{field}.confirmations", message.confirmations, problem)
    return QuarantineRules(speed, growth, message.confirmations)


def decode_center(place: hull_pb2.LonLat, field: str) -> Center:
    """The centre of a hull, with a longitude from -180 to below 180."""
    center = place.longitude, place.latitude
    if not np.isfinite(center).all():
        raise InvalidFieldError(field, center, "longitude and latitude must be finite")
    misplaced = off_globe(np.array([center]))
    if misplaced is not None:
        raise InvalidFieldError(field, center, misplaced.problem)
    return as_center(center)


def _decode_window(window: hull_pb2.Window, *, by_event_time: bool) -> Window:
    clock = CLOCKS.get(window.clock)
    if clock is None:
        raise InvalidFieldError("config.window.clock", window.clock, "not a clock that this server supports")
    if window.ahead not in hull_pb2.AheadPolicy.values():
        raise InvalidFieldError("config.window.ahead", window.ahead, "not a policy that this server supports")
    if window.max_points > LARGEST_INTEGER:
        raise InvalidFieldError("config.window.max_points", window.max_points, f"must be at most {LARGEST_INTEGER}")
    max_age, max_skew = 0, None
    if window.HasField("max_age"):
        max_age = decode_duration(window.max_age, "config.window.max_age", least=1)
    elif not window.max_points:
        if not (by_event_time and window.HasField("max_skew")):
            problem = "needs max_age or max_points or, in a hull by event time, max_skew"
            raise InvalidFieldError("config.window", "empty", problem)
        if clock != "server":
            raise InvalidFieldError("config.window.clock", "CLOCK_DATA", "needs max_age or max_points")
    if window.HasField("max_skew"):
        max_skew = decode_duration(window.max_skew, "config.window.max_skew", least=0)
    clamps = window.ahead == hull_pb2.AHEAD_POLICY_CLAMP
    return Window(max_age, window.max_points, clock, max_skew, clamps)


def decode_duration(duration: Duration, field: str, least: int) -> int:
    """A duration of `least` microseconds or more, in microseconds."""
    microseconds, rest = divmod(duration.nanos, NANOSECONDS)
    total = duration.seconds * MICROSECONDS + microseconds
    value = f"{duration.seconds} s and {duration.nanos} ns"
    if rest:
        raise InvalidFieldError(field, value, "must be in whole microseconds")
    if not least <= total <= GREATEST_TIME:
        sign = "positive" if least else "not negative"
        raise InvalidFieldError(field, value, f"must be {sign} and at most {GREATEST_TIME} microseconds")
    return total
