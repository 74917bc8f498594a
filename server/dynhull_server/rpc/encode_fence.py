"""Conversion of fences and their events to messages."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from dynhull.keys import PackedKeys
from dynhull_proto.v1 import fence_pb2, fence_service_pb2, points_pb2

from ..engine.fences import LiveFence
from ..engine.watch_fence import Sent
from ..state.fences.model.config import CircleArea, FenceConfig, HullArea, Initial, PolygonArea
from ..state.fences.model.fence import Fence
from ..state.fences.model.records import Consumer, EventType, FenceEvent, Members
from ..state.records import NO_TIME, Keys
from .encode import encode_keys

INITIALS: dict[Initial, fence_pb2.FenceInitial] = {
    "snapshot": fence_pb2.FENCE_INITIAL_SNAPSHOT,
    "events": fence_pb2.FENCE_INITIAL_EVENTS,
    "none": fence_pb2.FENCE_INITIAL_NONE,
}

ALL_CAUSES: tuple[fence_pb2.FenceCause, ...] = (
    fence_pb2.FENCE_CAUSE_SUBJECT_MOVED,
    fence_pb2.FENCE_CAUSE_AREA_MOVED,
    fence_pb2.FENCE_CAUSE_SUBJECT_APPEARED,
    fence_pb2.FENCE_CAUSE_SUBJECT_REMOVED,
    fence_pb2.FENCE_CAUSE_SUBJECT_EXPIRED,
    fence_pb2.FENCE_CAUSE_FENCE_CREATED,
    fence_pb2.FENCE_CAUSE_FENCE_CHANGED,
    fence_pb2.FENCE_CAUSE_TIME_PASSED,
)
# The causes of each set of them: the bit n stands for the nth of ALL_CAUSES.
CAUSES = [[cause for bit, cause in enumerate(ALL_CAUSES) if causes >> bit & 1] for causes in range(256)]
TYPES: dict[EventType, Any] = {
    kind: fence_pb2.FenceEventType.Value(f"FENCE_EVENT_TYPE_{kind.name}") for kind in EventType
}
PACKED = points_pb2.POINT_ENCODING_PACKED


def encode_config(config: FenceConfig) -> fence_pb2.FenceConfig:
    """The settings of a fence."""
    message = fence_pb2.FenceConfig(
        boundary=fence_pb2.FENCE_BOUNDARY_CLOSED if config.closed else fence_pb2.FENCE_BOUNDARY_OPEN,
        margin=config.margin,
        near_distance=config.near,
        initial=INITIALS[config.initial],
        report_crosses=config.crosses,
        confirmations=config.confirmations,
        max_events=config.max_events,
        by_accuracy=config.by_accuracy,
    )
    if config.expected:
        strings = [key for key in config.expected if isinstance(key, str)]
        keys: Keys = PackedKeys.pack(strings) if strings else np.array(config.expected, np.uint64)
        message.expected.CopyFrom(encode_keys(keys, PACKED))
    if config.expected_by:
        message.expected_by = config.expected_by
    area = config.area
    if isinstance(area, HullArea):
        message.hull_area.name = area.name
        message.hull_area.without_self = area.without_self
        message.hull_area.layer = area.layer if area.layer > 1 else 0
    elif isinstance(area, CircleArea):
        message.circle_area.center_x, message.circle_area.center_y = area.x, area.y
        message.circle_area.radius = area.radius
    elif isinstance(area, PolygonArea):
        for exterior, *holes in area.polygons:
            polygon = message.polygon_area.polygons.add(exterior=points_pb2.Points(packed=exterior))
            polygon.holes.extend(points_pb2.Points(packed=hole) for hole in holes)
    if config.kind == "hull":
        message.subject_hull = config.subjects
    elif config.kind == "prefix":
        message.subject_prefix = config.subjects
    else:
        message.other_hull = config.subjects
    for field, duration in (
        ("dwell", config.dwell),
        ("min_dwell", config.min_dwell),
        ("max_event_age", config.max_event_age),
        ("expected_within", config.expected_within),
    ):
        if duration:
            getattr(message, field).FromMicroseconds(duration)
    return message


def encode_fence(live: LiveFence, oldest: "dict[str, int]") -> fence_pb2.Fence:
    """A fence with its counts; `oldest` has the time of the oldest event in the backlog of each consumer."""
    fence = live.fence
    message = fence_pb2.Fence(
        name=fence.name,
        config=encode_config(fence.row.config),
        uid=live.uid,
        last_sequence=fence.last,
        first_sequence=fence.first,
        inside_count=fence.inside,
        subject_count=fence.subject_count,
        consumers=[
            encode_consumer(fence, consumer, oldest.get(name)) for name, consumer in sorted(fence.consumers.items())
        ],
    )
    message.create_time.FromDatetime(live.created)
    return message


def encode_consumer(fence: Fence, consumer: Consumer, oldest: int | None) -> fence_pb2.FenceConsumer:
    """A consumer; `oldest` is the time of the oldest event in its backlog, None if there is none."""
    message = fence_pb2.FenceConsumer(
        name=consumer.name,
        acknowledged_sequence=consumer.acknowledged,
        backlog=max(fence.backlog(consumer), 0),
        lost=consumer.lost,
    )
    if oldest is not None:
        message.oldest_event_time.FromMicroseconds(oldest)
    return message


def encode_members(members: Iterable[Members]) -> list[fence_pb2.FenceSubjects]:
    """Subjects, by hull."""
    return [
        fence_pb2.FenceSubjects(hull=each.hull, keys=encode_keys(each.keys, PACKED), revision=each.revision)
        for each in members
    ]


def encode_sent(sent: Sent, uid: str) -> fence_service_pb2.WatchFenceResponse:
    """A response of a watch."""
    message = fence_service_pb2.WatchFenceResponse(
        conflated=sent.conflated, sequence=sent.sequence, uid=uid, events=map(encode_fence_event, sent.events)
    )
    if sent.lost is not None:
        message.lost.first_sequence, message.lost.last_sequence = sent.lost
    return message


def encode_fence_event(event: FenceEvent) -> fence_pb2.FenceEvent:
    """One event."""
    message = fence_pb2.FenceEvent(
        sequence=event.sequence,
        type=TYPES[event.type],
        causes=CAUSES[event.causes],
        subject_hull=event.hull,
        subject_revision=event.subject_revision,
        area_revision=event.area_revision,
        inside=encode_members(event.inside),
    )
    if isinstance(event.key, str):
        message.string_key = event.key
    elif event.key is not None:
        message.integer_key = event.key
    if event.position is not None:
        message.position.x, message.position.y = event.position
    if event.previous is not None:
        message.previous_position.x, message.previous_position.y = event.previous
    if event.origin is not None:
        message.previous_hull, message.previous_hull_revision = event.origin
    if event.distance is not None:
        message.distance = event.distance
    message.time.FromMicroseconds(event.time)
    if event.event_time != NO_TIME:
        message.event_time.FromMicroseconds(event.event_time)
    if event.first_time != NO_TIME:
        message.first_time.FromMicroseconds(event.first_time)
    return message
