"""Messages to arrays and back."""

import math
import re

import numpy as np

from dynhull import measure
from dynhull.arrays import Points
from dynhull_proto.v1 import batch_pb2, hull_pb2, hull_service_pb2, points_pb2

from ..engine.batch import Applied, Batch
from ..engine.live_hull import Counts, LiveHull
from ..engine.verification import Verification
from ..engine.watch import Change, Event, Snapshot

NAME = re.compile(r"[A-Za-z0-9._/-]{1,200}")
NAME_CHARACTERS = re.compile(r"[A-Za-z0-9._/-]{0,200}")
DEFAULT_PAGE = 100
LARGEST_PAGE = 1000
BYTES_PER_POINT = 16


class InvalidFieldError(Exception):
    """A field of a request holds what it cannot hold.

    Attributes:
        field: its path in the request.
        row: the row of the points at fault, None where the field as a whole is.
        value: what it holds.
        problem: what is wrong with it.
    """

    def __init__(self, field: str, value: object, problem: str, row: int | None = None) -> None:
        super().__init__(field, value, problem, row)
        self.field = field
        self.row = row
        self.value = value
        self.problem = problem


def decode_name(name: str) -> str:
    """A hull's name."""
    if not NAME.fullmatch(name):
        raise InvalidFieldError("name", name, 'a hull\'s name is 1 to 200 letters, digits and "._-/"')
    return name


def decode_config(config: hull_pb2.HullConfig) -> None:
    """The configuration of a hull to be; as yet there is one kind."""
    if config.identity not in (hull_pb2.IDENTITY_UNSPECIFIED, hull_pb2.IDENTITY_MULTISET):
        raise InvalidFieldError("config.identity", config.identity, "not an identity this server knows")


def decode_page(request: hull_service_pb2.ListHullsRequest) -> tuple[str, str, int]:
    """The prefix, the name to begin after, and the size of a page."""
    if not NAME_CHARACTERS.fullmatch(request.prefix):
        raise InvalidFieldError("prefix", request.prefix, 'names consist of letters, digits and "._-/"')
    if request.page_token and not (
        NAME.fullmatch(request.page_token) and request.page_token.startswith(request.prefix)
    ):
        raise InvalidFieldError("page_token", request.page_token, "not a token of a call with this prefix")
    if request.page_size < 0:
        raise InvalidFieldError("page_size", request.page_size, "must not be negative")
    return request.prefix, request.page_token, min(request.page_size or DEFAULT_PAGE, LARGEST_PAGE)


def decode_points(points: points_pb2.Points, field: str) -> Points:
    """An (n, 2) array of finite doubles without negative zeros."""
    if points.packed and points.coordinates:
        raise InvalidFieldError(field, "packed and coordinates", "use one encoding or the other")
    if len(points.packed) % BYTES_PER_POINT:
        problem = f"{BYTES_PER_POINT} bytes a point, so the number of bytes must be a multiple of that"
        raise InvalidFieldError(f"{field}.packed", f"{len(points.packed)} bytes", problem)
    if len(points.coordinates) % 2:
        problem = "two coordinates a point, so their number must be even"
        raise InvalidFieldError(f"{field}.coordinates", f"{len(points.coordinates)} coordinates", problem)
    values = np.frombuffer(points.packed, "<f8") if points.packed else np.array(points.coordinates, np.float64)
    xy = values.reshape(-1, 2)
    finite = np.isfinite(xy)
    if not finite.all():
        row = int(np.argmin(finite.all(axis=1)))
        raise InvalidFieldError(field, tuple(xy[row].tolist()), "coordinates must be finite", row)
    # Adding zero turns -0.0 into 0.0, and any byte order into the machine's.
    return np.asarray(xy + 0.0, np.float64)


def decode_batch(batch: batch_pb2.Batch) -> Batch:
    """A batch whose moves have as many destinations as origins."""
    if batch.missing_points not in batch_pb2.MissingPointPolicy.values():
        raise InvalidFieldError("batch.missing_points", batch.missing_points, "not a policy this server knows")
    origins = decode_points(batch.moves.origins, "batch.moves.origins")
    destinations = decode_points(batch.moves.destinations, "batch.moves.destinations")
    if len(origins) != len(destinations):
        problem = f"there must be as many as there are origins, {len(origins)}"
        raise InvalidFieldError("batch.moves.destinations", f"{len(destinations)} points", problem)
    return Batch(
        inserts=decode_points(batch.inserts, "batch.inserts"),
        deletes=decode_points(batch.deletes, "batch.deletes"),
        origins=origins,
        destinations=destinations,
        count_missing=batch.missing_points == batch_pb2.MISSING_POINT_POLICY_COUNT,
    )


def decode_encoding(encoding: points_pb2.PointEncoding) -> points_pb2.PointEncoding:
    """A known encoding."""
    if encoding not in points_pb2.PointEncoding.values():
        raise InvalidFieldError("encoding", encoding, "not an encoding this server knows")
    return encoding


def decode_rate(events_per_second: float) -> float:
    """The least number of seconds between two events."""
    if not 0 <= events_per_second < math.inf:
        raise InvalidFieldError("max_events_per_second", events_per_second, "must be finite and not negative")
    return 1 / events_per_second if events_per_second else 0.0


def decode_interval(request: hull_service_pb2.WatchRequest) -> float | None:
    """Seconds from an event to a progress mark, None for no marks."""
    if not request.HasField("progress_interval"):
        return None
    interval = request.progress_interval
    seconds = interval.seconds + interval.nanos / 1e9
    if seconds <= 0:
        raise InvalidFieldError("progress_interval", f"{seconds} s", "must be positive")
    return seconds


def encode_points(xy: Points, encoding: points_pb2.PointEncoding) -> points_pb2.Points:
    """Points in the encoding asked for."""
    if encoding == points_pb2.POINT_ENCODING_COORDINATES:
        return points_pb2.Points(coordinates=xy.ravel().tolist())
    return points_pb2.Points(packed=np.asarray(xy, "<f8").tobytes())


def encode_hull(hull: LiveHull, counts: Counts) -> hull_pb2.Hull:
    """A hull with its counts at one revision."""
    message = hull_pb2.Hull(
        name=hull.name,
        config=hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_MULTISET),
        revision=counts.revision,
        point_count=counts.points,
        distinct_point_count=counts.distinct,
    )
    message.create_time.FromDatetime(hull.created)
    return message


def encode_measures(vertices: Points) -> hull_pb2.Measures:
    """The measures of the hull with these vertices."""
    x, y = measure.centroid(vertices)
    min_x, min_y, max_x, max_y = measure.bounds(vertices)
    return hull_pb2.Measures(
        area=measure.area(vertices),
        perimeter=measure.perimeter(vertices),
        centroid_x=x,
        centroid_y=y,
        min_x=min_x,
        min_y=min_y,
        max_x=max_x,
        max_y=max_y,
    )


def encode_applied(applied: Applied) -> batch_pb2.BatchResult:
    """What a batch did."""
    return batch_pb2.BatchResult(
        revision=applied.revision,
        inserted=applied.inserted,
        deleted=applied.deleted,
        missing=applied.missing,
        hull_changed=applied.hull_changed,
        point_count=applied.points,
    )


def encode_event(event: Event, encoding: points_pb2.PointEncoding, measures: bool) -> hull_service_pb2.WatchResponse:
    """What a watcher is told."""
    message = hull_service_pb2.WatchResponse(revision=event.counts.revision, point_count=event.counts.points)
    if isinstance(event, Snapshot):
        message.snapshot.vertices.CopyFrom(encode_points(event.vertices, encoding))
    elif isinstance(event, Change):
        removed, added = event.difference.removed, event.difference.added
        message.change.CopyFrom(
            hull_service_pb2.HullChange(
                removed=encode_points(event.before[removed], encoding),
                removed_indices=removed.tolist(),
                added=encode_points(event.vertices[added], encoding),
                added_indices=added.tolist(),
                rotation=event.difference.rotation,
            )
        )
    else:
        message.progress.SetInParent()
        return message
    if measures:
        message.measures.CopyFrom(encode_measures(event.vertices))
    return message


def encode_verification(
    counts: Counts, verification: Verification, encoding: points_pb2.PointEncoding
) -> hull_service_pb2.VerifyResponse:
    """The outcome of a verification."""
    message = hull_service_pb2.VerifyResponse(
        revision=counts.revision,
        equal=verification.difference is None,
        point_count=verification.points,
        vertex_count=verification.vertices,
        rounds=[
            hull_service_pb2.ChanRound(
                guess=each.guess, groups=each.groups, steps=each.steps, cost=each.cost, closed=each.closed
            )
            for each in verification.rounds
        ],
    )
    if verification.difference is not None:
        message.first_difference.index = verification.difference.index
        message.first_difference.live.CopyFrom(encode_points(verification.difference.live, encoding))
        message.first_difference.recomputed.CopyFrom(encode_points(verification.difference.recomputed, encoding))
    return message
