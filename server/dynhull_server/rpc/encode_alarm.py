"""Conversion of alarms and their events to messages."""

from collections.abc import Mapping
from math import isfinite

from dynhull_proto.v1 import alarm_pb2, alarm_service_pb2

from ..engine.fences import LiveFence
from ..engine.watch_fence import Sent
from ..state.alarms.rule import AlarmRule, unmarked
from ..state.alarms.status import AlarmStatus
from ..state.fences.model.records import Cause, EventType, FenceEvent
from ..state.records import NO_TIME
from .encode import encode_keys
from .encode_fence import PACKED, encode_consumer

# An alarm that is raised for a hull is kept as a hull that begins to be near.
TYPES = {
    EventType.BEGIN: alarm_pb2.ALARM_EVENT_TYPE_RAISED,
    EventType.CEASE: alarm_pb2.ALARM_EVENT_TYPE_CLEARED,
    EventType.SNAPSHOT: alarm_pb2.ALARM_EVENT_TYPE_SNAPSHOT,
    EventType.CLOSED: alarm_pb2.ALARM_EVENT_TYPE_CLOSED,
}
CAUSES = {
    Cause.MOVED: alarm_pb2.ALARM_CAUSE_BATCH,
    Cause.APPEARED: alarm_pb2.ALARM_CAUSE_BATCH,
    Cause.EXPIRED: alarm_pb2.ALARM_CAUSE_EXPIRED,
    Cause.REMOVED: alarm_pb2.ALARM_CAUSE_HULL_DELETED,
    Cause.CREATED: alarm_pb2.ALARM_CAUSE_ALARM_CREATED,
    Cause.TIME: alarm_pb2.ALARM_CAUSE_TIME_PASSED,
    Cause.AREA: alarm_pb2.ALARM_CAUSE_OTHER_HULL,
    Cause.CHANGED: alarm_pb2.ALARM_CAUSE_RECENTERED,
}
OF_OTHER = Cause.AREA, Cause.AREA | Cause.TIME  # the other hull alone has changed


def encode_alarm(alarm: LiveFence, oldest: Mapping[str, int]) -> alarm_pb2.Alarm:
    """An alarm; `oldest` are the times of the oldest events that consumers have not acknowledged."""
    fence = alarm.fence
    message = alarm_pb2.Alarm(
        name=unmarked(fence.name),
        rule=encode_rule(fence.row.config.subjects, rule_of(alarm), of_prefix=fence.row.config.kind == "prefix"),
        uid=fence.row.uid,
        last_sequence=fence.last,
        first_sequence=fence.first,
        hull_count=0 if fence.watched is None else len(fence.watched),
        raised_count=fence.inside,
        consumers=[
            encode_consumer(fence, consumer, oldest.get(name)) for name, consumer in sorted(fence.consumers.items())
        ],
    )
    message.create_time.FromDatetime(alarm.created)
    message.rule.max_events = fence.row.config.max_events
    if fence.row.config.max_event_age:
        message.rule.max_event_age.FromMicroseconds(fence.row.config.max_event_age)
    return message


def rule_of(alarm: LiveFence) -> AlarmRule:
    """The rule of an alarm."""
    rule = alarm.fence.row.config.rule
    assert rule is not None  # it is no fence
    return rule


def encode_rule(hulls: str, rule: AlarmRule, *, of_prefix: bool) -> alarm_pb2.AlarmRule:
    """What raises and clears an alarm for a hull, or for hulls with a prefix."""
    message = alarm_pb2.AlarmRule(when=rule.when, clear=rule.clear)
    if of_prefix:
        message.prefix = hulls
    else:
        message.hull = hulls
    if rule.hold:
        message.hold.FromMicroseconds(rule.hold)
    return message


def encode_status(status: AlarmStatus) -> alarm_pb2.AlarmStatus:
    """An alarm at a hull."""
    message = alarm_pb2.AlarmStatus(
        hull=status.hull, raised=status.raised, revision=status.revision, value=status.value
    )
    times = (
        (message.since, status.since),
        (message.acknowledge_time, status.acknowledged),
        (message.mute_time, status.muted),
    )
    for field, time in times:
        if time != NO_TIME:
            field.FromMicroseconds(time)
    return message


def encode_sent_alarm(sent: Sent, uid: str, rule: AlarmRule) -> alarm_service_pb2.WatchAlarmResponse:
    """A response of a watch."""
    message = alarm_service_pb2.WatchAlarmResponse(
        sequence=sent.sequence, uid=uid, events=[encode_alarm_event(event, rule) for event in sent.events]
    )
    if sent.lost is not None:
        message.lost.first_sequence, message.lost.last_sequence = sent.lost
    return message


def encode_alarm_event(event: FenceEvent, rule: AlarmRule) -> alarm_pb2.AlarmEvent:
    """One event."""
    message = alarm_pb2.AlarmEvent(
        sequence=event.sequence,
        type=TYPES[event.type],
        hull=event.hull,
        revision=event.subject_revision,
        causes=sorted({CAUSES[each] for each in Cause if each & event.causes and each in CAUSES}),
        cause_revision=event.area_revision,
    )
    if event.type in (EventType.BEGIN, EventType.CEASE):
        other = rule.other if event.causes in OF_OTHER else None
        message.cause_hull = event.hull if other is None else other
        for members in event.inside:
            message.keys.CopyFrom(encode_keys(members.keys, PACKED))
        message.bound = (rule.raises if event.type is EventType.BEGIN else rule.clears).limit
        if not event.causes & Cause.REMOVED and event.distance is not None and isfinite(event.distance):
            message.value = event.distance
    else:
        message.raised.extend(each.hull for each in event.inside)
    if event.previous is not None:
        message.previous_value = event.previous[0]
    if event.event_time != NO_TIME:
        message.cause_time.FromMicroseconds(event.event_time)
    message.time.FromMicroseconds(event.time)
    return message
