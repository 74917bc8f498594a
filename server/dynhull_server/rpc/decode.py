"""Conversion of messages to checked values; InvalidFieldError for invalid ones."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points, packed_points, plain_points
from dynhull_proto.v1 import alarm_service_pb2, feed_pb2, fence_service_pb2, hull_service_pb2, points_pb2

from ..engine.layers import MOST_LAYERS
from ..engine.positions import Position, decode_position
from ..engine.rosters import Choice
from ..settings import NAME_CHARACTERS
from ..state.contents.deadlines import Key
from ..state.frames import off_globe
from .readings import Reading

NAME = re.compile(r"[A-Za-z0-9._/-]{1,200}")
NAME_WORDS = '1 to 200 of the letters a to z and A to Z, digits and "._-/"'
DEFAULT_PAGE = 100
LARGEST_PAGE = 1000
DEFAULT_SAMPLE = 1000
LARGEST_SAMPLE = 100_000
LARGEST_SKETCH = 1000
LONGEST_INTERVAL = 24 * 3600
BYTES_PER_POINT = 16
LARGEST_INTEGER = 2**63 - 1
LEAST_PARTS, MOST_PARTS = 2, 16


class InvalidFieldError(Exception):
    """A field of a request has an invalid value.

    Attributes:
        field: the path of the field in the request.
        row: the row of the invalid point, None if the field as a whole is invalid.
        value: the value.
        problem: the reason why it is invalid.
    """

    def __init__(self, field: str, value: object, problem: str, row: int | None = None) -> None:
        super().__init__(field, value, problem, row)
        self.field = field
        self.row = row
        self.value = value
        self.problem = problem


def decode_name(name: str, field: str = "name") -> str:
    """The name of a hull."""
    if not NAME.fullmatch(name):
        raise InvalidFieldError(field, name, f"a hull's name is {NAME_WORDS}")
    return name


def decode_producer(producer: str) -> str:
    """The name of a producer, or an empty one."""
    if producer and not NAME.fullmatch(producer):
        raise InvalidFieldError("producer", producer, f"a producer's name is {NAME_WORDS}")
    return producer


def decode_sequence(producer: str, sequence: int) -> int:
    """The sequence number of a producer, 0 without a producer."""
    if not producer and sequence:
        raise InvalidFieldError("sequence", sequence, "a sequence number needs a producer")
    if producer and not 1 <= sequence <= LARGEST_INTEGER:
        raise InvalidFieldError("sequence", sequence, f"a sequence number is from 1 to {LARGEST_INTEGER}")
    return sequence


def decode_may_skip(producer: str, may_skip: bool) -> bool:
    """Whether numbers of the producer may be skipped."""
    if may_skip and not producer:
        raise InvalidFieldError("may_skip", may_skip, "only numbers of a producer can be skipped")
    return may_skip


def decode_after(may_skip: bool, request: Any) -> int:
    """The number of the batch that must be the producer's last one."""
    after = int(request.after_sequence)
    if not may_skip:
        raise InvalidFieldError("after_sequence", after, "it is for numbers that may skip: give may_skip")
    if after >= request.sequence:
        raise InvalidFieldError("after_sequence", after, f"it must be less than sequence, {request.sequence}")
    return after


def require_prefix(prefix: str) -> None:
    """Raise InvalidFieldError if no name begins with this."""
    if not NAME_CHARACTERS.fullmatch(prefix):
        raise InvalidFieldError("prefix", prefix, 'names consist of letters, digits and "._-/"')


def decode_page(
    request: hull_service_pb2.ListHullsRequest
    | fence_service_pb2.ListFencesRequest
    | alarm_service_pb2.ListAlarmsRequest,
) -> tuple[str, str, int]:
    """The prefix, the name before the page, and the size of the page."""
    require_prefix(request.prefix)
    if request.page_token and not (
        NAME.fullmatch(request.page_token) and request.page_token.startswith(request.prefix)
    ):
        raise InvalidFieldError("page_token", request.page_token, "not a page token of a call with this prefix")
    return request.prefix, request.page_token, page_size(request.page_size)


def decode_held_page(request: hull_service_pb2.ListHeldRequest, *, strings: bool) -> tuple[Key | None, int]:
    """The key before the page, and the size of the page."""
    size, token = page_size(request.page_size), request.page_token
    if strings or not token:
        return token or None, size
    if not (token.isascii() and token.isdecimal() and int(token) < 2**64):
        raise InvalidFieldError("page_token", token, "not a page token of a call about this hull")
    return int(token), size


def page_size(size: int) -> int:
    """The number of entries of a page."""
    if size < 0:
        raise InvalidFieldError("page_size", size, "must not be negative")
    return min(size or DEFAULT_PAGE, LARGEST_PAGE)


def decode_points(points: points_pb2.Points, field: str) -> Points:
    """An (n, 2) array of finite doubles without negative zeros."""
    packed, coordinates = points.packed, points.coordinates
    if packed:
        if coordinates:
            raise InvalidFieldError(field, "packed and coordinates", "use one encoding or the other")
        if len(packed) % BYTES_PER_POINT:
            problem = f"a point has {BYTES_PER_POINT} bytes, so the number of bytes must be a multiple of that"
            raise InvalidFieldError(f"{field}.packed", f"{len(packed)} bytes", problem)
        xy = packed_points(packed)
    else:
        if len(coordinates) % 2:
            problem = "a point has two coordinates, so their number must be even"
            raise InvalidFieldError(f"{field}.coordinates", f"{len(coordinates)} coordinates", problem)
        xy = plain_points(np.array(coordinates, float).reshape(-1, 2))
    if xy is None:
        given = np.array(np.frombuffer(packed, "<f8") if packed else coordinates, float).reshape(-1, 2)
        raise _bad_row(~np.isfinite(given).all(axis=1), field, given, "coordinates must be finite")
    return xy


def require_places(lonlat: Points, field: str) -> None:
    """Refuse (n, 2) pairs unless all are a longitude and a latitude."""
    misplaced = off_globe(lonlat)
    if misplaced is not None:
        raise InvalidFieldError(field, misplaced.place, misplaced.problem, misplaced.row)


def decode_directions(directions: points_pb2.Points) -> Points:
    """An (n, 2) array of non-zero vectors."""
    vectors = decode_points(directions, "directions")
    _refuse_rows((vectors == 0).all(axis=1), "directions", vectors, "has no direction")
    return vectors


def decode_lines(request: hull_service_pb2.IntersectLinesRequest) -> tuple[Points, Points]:
    """Equally many origins and targets, each origin different from its target."""
    origins = decode_points(request.origins, "origins")
    targets = decode_points(request.targets, "targets")
    if len(origins) != len(targets):
        problem = f"must be as many as the origins, {len(origins)}"
        raise InvalidFieldError("targets", f"{len(targets)} points", problem)
    _refuse_rows(
        (origins == targets).all(axis=1), "targets", targets, "is the same point as the origin, so there is no line"
    )
    return origins, targets


def decode_subjects(request: hull_service_pb2.LocateRequest | hull_service_pb2.DistanceRequest) -> bool:
    """Whether the request is about keys, rather than points."""
    if not request.HasField("keys"):
        for field in ("keys_of", "keys_min_revision"):
            if getattr(request, field):
                raise InvalidFieldError(field, getattr(request, field), "only for a request with keys")
        return False
    if request.HasField("points"):
        raise InvalidFieldError("keys", "points and keys", "use one or the other")
    return True


def decode_read(points: points_pb2.Points, field: str, reading: Reading) -> Points:
    """An (n, 2) array of points that suit the reading."""
    xy = decode_points(points, field)
    _refuse_rows(reading.misfits(xy), field, xy, reading.rule)
    return xy


def decode_rates(rates: Sequence[float]) -> list[float]:
    """Finite rates."""
    for row, rate in enumerate(rates):
        if not math.isfinite(rate):
            raise InvalidFieldError("rates", rate, "a rate must be finite", row)
    return list(rates)


def _refuse_rows(bad: npt.NDArray[np.bool_], field: str, xy: Points, problem: str) -> None:
    if bad.any():
        raise _bad_row(bad, field, xy, problem)


def _bad_row(bad: npt.ArrayLike, field: str, xy: Points, problem: str) -> InvalidFieldError:
    row = int(np.argmax(bad))
    return InvalidFieldError(field, tuple(xy[row].tolist()), problem, row)


def decode_parts(request: hull_service_pb2.ApplyTogetherRequest) -> list[str]:
    """The names of the hulls of a request to several of them, all different."""
    if not LEAST_PARTS <= len(request.batches) <= MOST_PARTS:
        problem = f"must be {LEAST_PARTS} to {MOST_PARTS}, each of another hull"
        raise InvalidFieldError("batches", f"{len(request.batches)} batches", problem)
    names: dict[str, int] = {}
    for index, part in enumerate(request.batches):
        name = decode_name(part.name, f"batches[{index}].name")
        if name in names:
            problem = f"batches[{names[name]}] is of the same hull"
            raise InvalidFieldError(f"batches[{index}].name", name, problem)
        if not part.HasField("batch"):
            raise InvalidFieldError(f"batches[{index}].batch", "", "a batch is required")
        names[name] = index
    return list(names)


def decode_encoding(encoding: points_pb2.PointEncoding) -> points_pb2.PointEncoding:
    """A supported encoding."""
    if encoding not in points_pb2.PointEncoding.values():
        raise InvalidFieldError("encoding", encoding, "not an encoding that this server supports")
    return encoding


def decode_view(view: hull_service_pb2.HullView) -> bool:
    """Whether the view includes vertices and measures."""
    if view not in hull_service_pb2.HullView.values():
        raise InvalidFieldError("view", view, "not a view that this server supports")
    return view != hull_service_pb2.HULL_VIEW_BASIC


def decode_layer(request: Any, field: str = "layer") -> int:
    """The number of the convex layer that a request is about, from 1."""
    if request.layer > MOST_LAYERS:
        raise InvalidFieldError(field, request.layer, f"must be at most {MOST_LAYERS}")
    return int(request.layer) or 1


def decode_layer_count(count: int) -> int:
    """A number of convex layers."""
    if not 1 <= count <= MOST_LAYERS:
        raise InvalidFieldError("layer_count", count, f"must be from 1 to {MOST_LAYERS}")
    return count


def _require_sketch(most: int) -> None:
    if most > LARGEST_SKETCH:
        raise InvalidFieldError("max_vertices", most, f"must be at most {LARGEST_SKETCH}")


def decode_max_vertices(request: Any, others: Sequence[str] = ("directions",)) -> int:
    """The most vertices of a sketch, 0 for all vertices; `others` are fields that do not go with it."""
    _require_sketch(request.max_vertices)
    for field in ("layer", "max_vertices"):
        for other in others:
            if getattr(request, field) and request.HasField(other):
                problem = f"cannot be combined with {other}"
                raise InvalidFieldError(field, getattr(request, field), problem)
    return int(request.max_vertices)


def decode_many(request: hull_service_pb2.WatchManyRequest) -> Choice:
    """The hulls of a request about many."""
    if not request.names:
        require_prefix(request.prefix)
        return Choice(request.prefix)
    if request.prefix:
        raise InvalidFieldError("names", f"{len(request.names)} names", "cannot be combined with prefix")
    for row, name in enumerate(request.names):
        if not NAME.fullmatch(name):
            raise InvalidFieldError("names", name, f"a hull's name is {NAME_WORDS}", row)
    return Choice(None, frozenset(request.names))


def decode_many_contents(request: hull_service_pb2.WatchManyRequest) -> tuple[bool, int]:
    """Whether vertices are wanted, and the most of each hull, 0 for all."""
    if request.contents not in hull_service_pb2.HullContents.values():
        raise InvalidFieldError("contents", request.contents, "not contents that this server knows")
    outline = request.contents == hull_service_pb2.HULL_CONTENTS_OUTLINE
    if request.max_vertices and not outline:
        problem = "only with HULL_CONTENTS_OUTLINE: a summary has no vertices"
        raise InvalidFieldError("max_vertices", request.max_vertices, problem)
    _require_sketch(request.max_vertices)
    return outline, request.max_vertices


def decode_many_position(request: hull_service_pb2.WatchManyRequest) -> Position | None:
    """The position to go on from, None for the beginning."""
    if not request.position:
        return None
    try:
        return decode_position(request.position)
    except ValueError as error:
        raise InvalidFieldError("position", f"{len(request.position)} bytes", str(error)) from None


def decode_sample_size(size: int) -> int:
    """The largest number of points."""
    if size < 0:
        raise InvalidFieldError("sample_size", size, "must not be negative")
    return min(size or DEFAULT_SAMPLE, LARGEST_SAMPLE)


@dataclass(frozen=True, slots=True)
class Resume:
    """The state that a watcher already holds."""

    uid: str
    revision: int


def decode_resume(request: hull_service_pb2.WatchRequest) -> Resume | None:
    """The state that the watcher already holds, None if it holds none."""
    if not request.HasField("resume"):
        return None
    if request.HasField("directions"):
        raise InvalidFieldError(
            "resume", "resume and directions", "a sketch is always sent as a whole, so it cannot be resumed"
        )
    if not request.resume.uid:
        raise InvalidFieldError("resume.uid", "", "a uid is required: use that of the snapshot")
    return Resume(request.resume.uid, request.resume.revision)


def decode_rate(events_per_second: float, field: str = "max_events_per_second") -> float:
    """The least number of seconds between events."""
    if events_per_second == 0:
        return 0.0
    if not 1 / LONGEST_INTERVAL <= events_per_second < math.inf:
        problem = f"must be finite, and at least 1/{LONGEST_INTERVAL} (one a day), or 0 for no limit"
        raise InvalidFieldError(field, events_per_second, problem)
    return 1 / events_per_second


def decode_last(request: hull_service_pb2.GetSeriesRequest) -> float | None:
    """The seconds of a series that a caller asks for, None for all."""
    if not request.HasField("last"):
        return None
    seconds = request.last.seconds + request.last.nanos / 1e9
    if not 0 < seconds <= LONGEST_INTERVAL:
        raise InvalidFieldError("last", f"{seconds} s", f"must be positive and at most {LONGEST_INTERVAL} s")
    return seconds


def decode_interval(
    request: hull_service_pb2.WatchRequest
    | hull_service_pb2.ReplayRequest
    | fence_service_pb2.WatchFenceRequest
    | alarm_service_pb2.WatchAlarmRequest
    | feed_pb2.FeedRequest,
) -> float | None:
    """Seconds without an event before a progress mark, None for no marks."""
    if not request.HasField("progress_interval"):
        return None
    interval = request.progress_interval
    seconds = interval.seconds + interval.nanos / 1e9
    if not 0 < seconds <= LONGEST_INTERVAL:
        raise InvalidFieldError(
            "progress_interval", f"{seconds} s", f"must be positive and at most {LONGEST_INTERVAL} s"
        )
    return seconds
