"""Alarms and their events, as values."""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Literal

from dynhull.keys import key_list
from dynhull_proto.v1 import alarm_pb2, alarm_service_pb2

from ._fence_messages import FenceConsumer, decode_consumer, words_of
from ._keys import decode_keys
from ._times import decode_time

AlarmEventType = Literal["raised", "cleared", "snapshot", "closed", "lost", "progress", "unknown"]
AlarmCause = Literal["batch", "expired", "hull_deleted", "alarm_created", "time_passed", "other_hull", "recentered"]

TYPES: dict[int, AlarmEventType] = words_of(alarm_pb2.AlarmEventType.items(), "ALARM_EVENT_TYPE_")
CAUSES: dict[int, AlarmCause] = words_of(alarm_pb2.AlarmCause.items(), "ALARM_CAUSE_")


@dataclass(frozen=True, slots=True)
class AlarmStatus:
    """An alarm at one hull.

    Attributes:
        hull: the name of the hull.
        raised: whether the alarm is raised for it.
        revision: the revision of the hull.
        value: its measure there; of "silent", the seconds since its last change; of "near", the distance, infinite if
            one of the hulls is empty; of "vertex in", the number of vertices in the area; of "vertex", 1 or 0.
        since: since when the condition holds, while the alarm is raised or waits for its time to hold; otherwise None.
        acknowledged: when somebody has acknowledged the alarm that is raised; None if nobody has.
        muted_until: until when the alarm is muted for this hull; None if it is not.
    """

    hull: str
    raised: bool
    revision: int
    value: float
    since: datetime | None
    acknowledged: datetime | None
    muted_until: datetime | None


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm with its rule, its counts and its consumers.

    Attributes:
        name: its name.
        hull: the name of the hull that it watches; None for an alarm over a prefix.
        prefix: what the names of the hulls that it watches begin with; None for an alarm about one hull.
        when: the condition that raises it, in its shortest form.
        clear: the condition that clears it; empty for an alarm about silence, which a change of the hull clears.
        for_: how long the first must hold before the alarm is raised; None for no time.
        max_events: the number of events to keep; 0 for the limit of the server.
        max_event_age: how long events are kept; None for no limit.
        created: when it was created.
        uid: differs from that of an earlier or later alarm of the same name.
        last_sequence: the sequence of the last event; 0 before the first.
        first_sequence: the sequence of the oldest event that is kept; last_sequence + 1 if none is.
        hulls: the number of hulls that it watches.
        raised: the number of hulls for which it is raised.
        consumers: its durable consumers, by name.
        statuses: the hulls for which it is raised, waits, or is muted, by name; empty in lists.
    """

    name: str
    hull: str | None
    prefix: str | None
    when: str
    clear: str
    for_: timedelta | None
    max_events: int
    max_event_age: timedelta | None
    created: datetime
    uid: str
    last_sequence: int
    first_sequence: int
    hulls: int
    raised: int
    consumers: tuple[FenceConsumer, ...]
    statuses: tuple[AlarmStatus, ...] = ()


@dataclass(frozen=True, slots=True)
class AlarmEvent:
    """An event of an alarm.

    Attributes:
        type: what happened. "raised" and "cleared" for a hull, which alternate; "snapshot": the hulls for which the
            alarm was raised when it was restored from a backup; "closed": it was deleted. "lost": events were dropped
            before they could be sent; "progress": nothing has happened for a while. "unknown": a type that this version
            of the client does not know.
        sequence: counted per alarm from 1, without gaps; of "lost" and "progress", the sequence that they lead to.
        alarm: the name of the alarm.
        uid: the uid of the alarm; with `sequence` it identifies the event.
        hull: the name of the hull; empty if there is no single one.
        revision: the revision of the hull at which the event was made.
        value: the measure there, rounded; of "silent", the seconds since the last change; of "near", the distance; of
            "vertex in", the number of vertices in the area; of "vertex", 1 or 0. None if the hull is deleted, or the
            distance is that from an empty hull.
        bound: what it was compared with, on the globe in metres or square metres.
        cause: why it happened.
        cause_revision: the revision with which the condition began to hold, which with `for_` is before `revision`.
        cause_hull: the hull whose revision that is: the other one that the condition names if that alone had changed.
        cause_time: the time of that revision; of "silent", that of the last change.
        previous: the measure at the revision before that one; None where there was none.
        time: when the server made the event; None for "lost" and "progress".
        keys: of "raised" and "vertex in", the keys of the vertices in the area, at most 100; of "vertex", that key.
        raised: of "snapshot" and "closed", the names of the hulls for which the alarm was raised.
        first: of "lost", the first sequence that was dropped; 0 otherwise.
        last: of "lost", the last sequence that was dropped; 0 otherwise.
    """

    type: AlarmEventType
    sequence: int
    alarm: str = ""
    uid: str = ""
    hull: str = ""
    revision: int = 0
    value: float | None = None
    bound: float | None = None
    cause: frozenset[AlarmCause] = frozenset()
    cause_revision: int = 0
    cause_hull: str = ""
    cause_time: datetime | None = None
    previous: float | None = None
    time: datetime | None = None
    keys: tuple[str | int, ...] = ()
    raised: tuple[str, ...] = ()
    first: int = 0
    last: int = 0


def decode_alarm(message: alarm_pb2.Alarm) -> Alarm:
    """An alarm."""
    rule = message.rule
    return Alarm(
        name=message.name,
        hull=rule.hull if rule.HasField("hull") else None,
        prefix=rule.prefix if rule.HasField("prefix") else None,
        when=rule.when,
        clear=rule.clear,
        for_=rule.hold.ToTimedelta() if rule.HasField("hold") else None,
        max_events=rule.max_events,
        max_event_age=rule.max_event_age.ToTimedelta() if rule.HasField("max_event_age") else None,
        created=decode_time(message.create_time),
        uid=message.uid,
        last_sequence=message.last_sequence,
        first_sequence=message.first_sequence,
        hulls=message.hull_count,
        raised=message.raised_count,
        consumers=tuple(map(decode_consumer, message.consumers)),
    )


def decode_whole_alarm(response: alarm_service_pb2.GetAlarmResponse) -> Alarm:
    """An alarm, with what it says about hulls."""
    return replace(decode_alarm(response.alarm), statuses=tuple(map(decode_status, response.statuses)))


def decode_status(message: alarm_pb2.AlarmStatus) -> AlarmStatus:
    """An alarm at one hull."""
    return AlarmStatus(
        hull=message.hull,
        raised=message.raised,
        revision=message.revision,
        value=message.value,
        since=decode_time(message.since) if message.HasField("since") else None,
        acknowledged=decode_time(message.acknowledge_time) if message.HasField("acknowledge_time") else None,
        muted_until=decode_time(message.mute_time) if message.HasField("mute_time") else None,
    )


def decode_alarm_event(message: alarm_pb2.AlarmEvent, alarm: str, uid: str) -> AlarmEvent:
    """An event of an alarm."""
    of_hull = message.type in (alarm_pb2.ALARM_EVENT_TYPE_RAISED, alarm_pb2.ALARM_EVENT_TYPE_CLEARED)
    return AlarmEvent(
        type=TYPES.get(message.type, "unknown"),
        sequence=message.sequence,
        alarm=alarm,
        uid=uid,
        hull=message.hull,
        revision=message.revision,
        value=message.value if message.HasField("value") else None,
        bound=message.bound if of_hull else None,
        cause=frozenset(CAUSES[each] for each in message.causes if each in CAUSES),
        cause_revision=message.cause_revision,
        cause_hull=message.cause_hull,
        cause_time=decode_time(message.cause_time) if message.HasField("cause_time") else None,
        previous=message.previous_value if message.HasField("previous_value") else None,
        time=decode_time(message.time),
        keys=tuple(key_list(decode_keys(message.keys))) if message.HasField("keys") else (),
        raised=tuple(message.raised),
    )
