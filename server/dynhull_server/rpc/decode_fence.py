"""Conversion of the settings of a fence, and of what is asked of it."""

import math
from dataclasses import dataclass

import numpy as np

from dynhull.keys import key_list
from dynhull_proto.v1 import alarm_service_pb2, fence_pb2, fence_service_pb2, points_pb2

from ..settings import NAME_CHARACTERS
from ..state.fences.model.config import Area, CircleArea, FenceConfig, HullArea, Initial, PolygonArea, Ring, SubjectKind
from ..state.fences.model.expected import daily
from ..state.fences.model.records import Key
from . import encode_fence
from .decode import (
    LARGEST_INTEGER,
    NAME,
    NAME_WORDS,
    InvalidFieldError,
    decode_layer,
    decode_name,
    decode_points,
)
from .decode_batch import decode_keys
from .decode_settings import decode_duration

BOUNDARIES = {
    fence_pb2.FENCE_BOUNDARY_UNSPECIFIED: True,
    fence_pb2.FENCE_BOUNDARY_CLOSED: True,
    fence_pb2.FENCE_BOUNDARY_OPEN: False,
}
INITIALS: dict[int, Initial] = {
    fence_pb2.FENCE_INITIAL_UNSPECIFIED: "snapshot",
    **{number: initial for initial, number in encode_fence.INITIALS.items()},
}
KINDS: dict[str, SubjectKind] = {"subject_hull": "hull", "subject_prefix": "prefix", "other_hull": "other"}
BYTES_PER_POINT = 16
MOST_EXPECTED = 10_000


def decode_fence_name(name: str) -> str:
    """The name of a fence."""
    if not NAME.fullmatch(name):
        raise InvalidFieldError("name", name, f"a fence's name is {NAME_WORDS}")
    return name


def decode_consumer(consumer: str) -> str:
    """The name of a consumer."""
    if not NAME.fullmatch(consumer):
        raise InvalidFieldError("consumer", consumer, f"a consumer's name is {NAME_WORDS}")
    return consumer


def decode_fence(
    request: fence_service_pb2.CreateFenceRequest
    | fence_service_pb2.ReplaceFenceRequest
    | fence_service_pb2.FenceEventsBetweenRequest,
    most_corners: int,
) -> FenceConfig:
    """The settings of a fence, whose area has at most that many corners."""
    if not request.HasField("config"):
        raise InvalidFieldError("config", "", "the settings of the fence are required")
    config = request.config
    kind, subjects = _decode_subjects(config)
    if config.boundary not in BOUNDARIES:
        raise InvalidFieldError("config.boundary", config.boundary, "not a boundary that this server supports")
    if config.initial not in INITIALS:
        raise InvalidFieldError("config.initial", config.initial, "not a value that this server supports")
    if config.max_events > LARGEST_INTEGER:
        raise InvalidFieldError("config.max_events", config.max_events, f"must be at most {LARGEST_INTEGER}")
    decoded = FenceConfig(
        _decode_area(config, most_corners),
        kind,
        subjects,
        BOUNDARIES[config.boundary],
        _decode_length(config.margin, "config.margin"),
        _decode_length(config.near_distance, "config.near_distance"),
        INITIALS[config.initial],
        config.report_crosses,
        _decode_duration(config, "dwell"),
        config.confirmations if config.confirmations > 1 else 0,
        _decode_duration(config, "min_dwell"),
        config.max_events,
        _decode_duration(config, "max_event_age"),
        config.by_accuracy,
        _decode_expected(config),
        config.expected_by,
        _decode_within(config),
    )
    _refuse_contradictions(decoded)
    return decoded


def _decode_subjects(config: fence_pb2.FenceConfig) -> tuple[SubjectKind, str]:
    which = config.WhichOneof("subjects")
    if which is None:
        raise InvalidFieldError("config", "no subjects", "a fence needs a subject_hull, subject_prefix or other_hull")
    name, field = getattr(config, which), f"config.{which}"
    if which != "subject_prefix":
        return KINDS[which], decode_name(name, field)
    if not NAME_CHARACTERS.fullmatch(name):
        raise InvalidFieldError(field, name, 'names consist of letters, digits and "._-/"')
    return KINDS[which], name


def _decode_area(config: fence_pb2.FenceConfig, most_corners: int) -> Area:
    match config.WhichOneof("area"):
        case "hull_area":
            area = config.hull_area
            name = decode_name(area.name, "config.hull_area.name")
            return HullArea(name, area.without_self, decode_layer(area, "config.hull_area.layer"))
        case "circle_area":
            return _decode_circle(config.circle_area)
        case "polygon_area":
            return _decode_polygons(config.polygon_area, most_corners)
        case _:
            raise InvalidFieldError("config", "no area", "a fence needs a hull_area, polygon_area or circle_area")


def _decode_circle(circle: fence_pb2.CircleArea) -> CircleArea:
    for field in ("center_x", "center_y"):
        if not math.isfinite(getattr(circle, field)):
            raise InvalidFieldError(f"config.circle_area.{field}", getattr(circle, field), "must be finite")
    # Adding 0.0 makes a negative zero positive.
    radius = _decode_length(circle.radius, "config.circle_area.radius")
    return CircleArea(circle.center_x + 0.0, circle.center_y + 0.0, radius)


def _decode_polygons(area: fence_pb2.PolygonArea, most_corners: int) -> PolygonArea:
    if not area.polygons:
        raise InvalidFieldError("config.polygon_area.polygons", "0 polygons", "there must be at least one")
    corners = 0
    polygons = []
    for number, polygon in enumerate(area.polygons):
        field = f"config.polygon_area.polygons[{number}]"
        rings = [_decode_ring(polygon.exterior, f"{field}.exterior")]
        rings += [_decode_ring(hole, f"{field}.holes[{row}]") for row, hole in enumerate(polygon.holes)]
        corners += sum(len(ring) for ring in rings) // BYTES_PER_POINT
        if corners > most_corners:
            raise InvalidFieldError(field, f"{corners} corners", f"an area has at most {most_corners} corners")
        polygons.append(tuple(rings))
    return PolygonArea(tuple(polygons))


def _decode_ring(points: points_pb2.Points, field: str) -> Ring:
    return np.asarray(decode_points(points, field), "<f8").tobytes()


def _decode_length(length: float, field: str) -> float:
    if not 0 <= length < math.inf:
        raise InvalidFieldError(field, length, "must be finite and not negative")
    return length + 0.0


def _decode_duration(config: fence_pb2.FenceConfig, field: str) -> int:
    return decode_duration(getattr(config, field), f"config.{field}", least=0) if config.HasField(field) else 0


def _decode_expected(config: fence_pb2.FenceConfig) -> tuple[Key, ...]:
    """The keys that should be inside."""
    if not config.HasField("expected"):
        if config.WhichOneof("expected_deadline") is not None:
            raise InvalidFieldError(
                f"config.{config.WhichOneof('expected_deadline')}", "given", "without expected keys"
            )
        return ()
    keys = decode_keys(config.expected, "config.expected")
    found: list[Key] = [] if keys is None else key_list(keys)
    if not found or len(found) > MOST_EXPECTED:
        raise InvalidFieldError("config.expected", f"{len(found)} keys", f"from 1 to {MOST_EXPECTED} keys")
    if len(set(found)) < len(found):
        row = next(row for row, key in enumerate(found) if key in found[:row])
        raise InvalidFieldError("config.expected", str(found[row]), "each key is named once", row)
    if config.WhichOneof("expected_deadline") is None:
        raise InvalidFieldError("config.expected", f"{len(found)} keys", "give expected_by or expected_within, too")
    if config.HasField("expected_by"):
        try:
            daily(config.expected_by)
        except ValueError as error:
            raise InvalidFieldError("config.expected_by", config.expected_by, str(error)) from None
    return tuple(found)


def _decode_within(config: fence_pb2.FenceConfig) -> int:
    if not config.HasField("expected_within"):
        return 0
    return decode_duration(config.expected_within, "config.expected_within", least=1)


def _refuse_contradictions(config: FenceConfig) -> None:
    """Raise InvalidFieldError if settings exclude each other."""
    if config.near and config.kind != "other":
        raise InvalidFieldError("config.near_distance", config.near, "only with other_hull")
    area = config.area
    if config.kind == "other":
        _refuse_for_other_hull(config)
    if config.area_layer > 1:
        if config.kind == "other":
            raise InvalidFieldError("config.hull_area.layer", config.area_layer, "only for keys, not with other_hull")
        if isinstance(area, HullArea) and area.without_self:
            raise InvalidFieldError("config.hull_area.layer", config.area_layer, "cannot be combined with without_self")
    if isinstance(area, HullArea) and area.without_self:
        field = "config.hull_area.without_self"
        if config.kind != "hull" or area.name != config.subjects:
            raise InvalidFieldError(field, "true", "the area is then the hull of the subjects: name it as subject_hull")
        if not config.margin:
            raise InvalidFieldError("config.margin", config.margin, "must be positive with without_self")
        if not config.closed:
            raise InvalidFieldError("config.boundary", "FENCE_BOUNDARY_OPEN", "closed with without_self")


def _refuse_for_other_hull(config: FenceConfig) -> None:
    """Raise InvalidFieldError if a fence around another hull has settings for keys."""
    if not isinstance(config.area, HullArea):
        raise InvalidFieldError("config.other_hull", config.subjects, "the area is then a hull, too: a hull_area")
    if config.area.name == config.subjects:
        raise InvalidFieldError("config.other_hull", config.subjects, "must be another hull than the area")
    if not config.closed:
        raise InvalidFieldError("config.boundary", "FENCE_BOUNDARY_OPEN", "hulls that touch intersect")
    for field, value in (
        ("config.margin", config.margin),
        ("config.report_crosses", config.crosses),
        ("config.confirmations", config.confirmations),
        ("config.min_dwell", config.min_dwell),
        ("config.dwell", config.dwell),
        ("config.by_accuracy", config.by_accuracy),
        ("config.expected", len(config.expected)),
    ):
        if value:
            raise InvalidFieldError(field, value, "only for fences that compare keys")


@dataclass(frozen=True, slots=True)
class WatchStart:
    """Where a watch begins: after a sequence, after what a consumer acknowledged, or with the next event."""

    after: int | None = None
    consumer: str | None = None


def decode_start(request: fence_service_pb2.WatchFenceRequest | alarm_service_pb2.WatchAlarmRequest) -> WatchStart:
    """Where a watch begins; by default with the oldest event that is kept."""
    match request.WhichOneof("start"):
        case "consumer":
            if isinstance(request, fence_service_pb2.WatchFenceRequest) and request.conflate:
                raise InvalidFieldError("conflate", "true", "a consumer gets every event")
            return WatchStart(consumer=decode_consumer(request.consumer))
        case "only_new":
            if not request.only_new:
                raise InvalidFieldError("only_new", "false", "true, or another start")
            return WatchStart()
        case _:
            after = request.after_sequence
            if after > LARGEST_INTEGER:
                raise InvalidFieldError("after_sequence", after, f"must be at most {LARGEST_INTEGER}")
            return WatchStart(after=after)
