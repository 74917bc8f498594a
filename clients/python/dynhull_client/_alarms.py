"""The calls about alarms: the request, how to read the answer, and the documentation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dynhull_proto.v1 import alarm_service_pb2 as pb

from ._alarm_messages import Alarm, AlarmStatus, decode_alarm, decode_status, decode_whole_alarm
from ._arguments import text, whole
from ._calls import Call, Pages
from ._fence_messages import FenceConsumer, decode_consumer
from ._numbered_place import encode_start
from ._times import as_microseconds, encode_duration

if TYPE_CHECKING:
    from datetime import datetime, timedelta


def create_alarm(
    name: str,
    *,
    hull: str | None = None,
    prefix: str | None = None,
    when: str,
    clear: str | None = None,
    for_: float | timedelta | str | None = None,
    max_events: int = 0,
    max_event_age: float | timedelta | str | None = None,
    timeout: float | None = None,
) -> Call[Alarm]:
    """Create an alarm: it is raised for a hull when a condition about its outline holds, and cleared when it does not.

    >>> client.create_alarm("spread", hull="fleet/north", when="area > 500 km2", for_="30s")  # doctest: +SKIP

    AlarmExistsError if an alarm has that name; HullNotFoundError if there is no such hull; InvalidRequestError if a
    condition cannot be understood: it names the field, and the position in the text.

    Args:
        name: 1 to 200 letters a to z and A to Z, digits and "._-/". A hull or a fence may have the same name.
        hull: the hull that is watched,
        prefix: or the beginning of the names of all hulls that are watched, those created later too: each has an alarm
            of its own.
        when: the condition: a measure (area, perimeter, diameter, width, count or vertices), >, >=, < or <=, a number
            and, of geographic hulls, m, km, m2 or km2: "area > 500 km2". Or "silent 5m": the hull has not changed for
            so long. Or "near fleet/south 3 km", "vertex in yard" and "vertex truck-7", each also after "not": two hulls
            are at most so far apart, without a distance they meet; a vertex is in an area: another hull, "circle(x, y,
            radius)" or "polygon(x y, x y, x y)"; a key is at a vertex.
        clear: the condition that clears the alarm, weaker than the opposite of `when`: "area < 450 km2", "not near
            fleet/south 4 km". Default: the opposite.
        for_: how long the condition must hold before the alarm is raised: seconds, a timedelta, or text such as "30s".
        max_events: the number of events to keep; 0 for the limit of the server.
        max_event_age: seconds, a timedelta, or text such as 7d for which events are kept; None for no limit.
        timeout: seconds, instead of the client's.
    """
    if (hull is None) == (prefix is None):
        raise ValueError("give either hull or prefix")
    request = pb.CreateAlarmRequest(name=text("name", name))
    rule = request.rule
    rule.when, rule.max_events = text("when", when), whole("max_events", max_events)
    if clear is not None:
        rule.clear = text("clear", clear)
    if prefix is not None:
        rule.prefix = text("prefix", prefix)
    else:
        rule.hull = text("hull", hull)
    if for_ is not None:
        rule.hold.CopyFrom(encode_duration(for_, "for_"))
    if max_event_age is not None:
        rule.max_event_age.CopyFrom(encode_duration(max_event_age, "max_event_age"))
    return Call("CreateAlarm", request, lambda response: decode_alarm(response.alarm), timeout, repeatable=False)


def delete_alarm(name: str, *, timeout: float | None = None) -> Call[None]:
    """Delete an alarm and its events. Its watches get a last event, "closed", and end."""
    request = pb.DeleteAlarmRequest(name=text("name", name))
    return Call("DeleteAlarm", request, lambda _: None, timeout, repeatable=False)


def get_alarm(name: str, *, timeout: float | None = None) -> Call[Alarm]:
    """An alarm with its rule, its counts, its consumers, and the hulls for which it is raised, waits, or is muted.

    AlarmNotFoundError if there is none of that name.
    """
    return Call("GetAlarm", pb.GetAlarmRequest(name=text("name", name)), decode_whole_alarm, timeout)


def list_alarms(prefix: str = "", *, timeout: float | None = None) -> Pages[Alarm]:
    """The alarms whose names begin with `prefix`, in the order of their names, fetched page by page."""
    text("prefix", prefix)

    def decode(response: pb.ListAlarmsResponse) -> tuple[list[Alarm], str]:
        return [decode_alarm(each) for each in response.alarms], response.next_page_token

    return lambda token: Call("ListAlarms", pb.ListAlarmsRequest(prefix=prefix, page_token=token), decode, timeout)


def acknowledge_alarm(name: str, hull: str, *, timeout: float | None = None) -> Call[AlarmStatus]:
    """Say that somebody takes care of an alarm that is raised for a hull, until it is cleared.

    Args:
        name: the alarm.
        hull: the hull; AlarmNotRaisedError if the alarm is not raised for it.
        timeout: seconds, instead of the client's.
    """
    request = pb.AcknowledgeAlarmRequest(name=text("name", name), hull=text("hull", hull))
    return Call("AcknowledgeAlarm", request, lambda response: decode_status(response.status), timeout)


def mute_alarm(
    name: str, hull: str, until: datetime | str | None, *, timeout: float | None = None
) -> Call[AlarmStatus]:
    """Mute an alarm for a hull, for those who show alarms; its events are made and sent as before.

    Args:
        name: the alarm.
        hull: the hull; HullUnsuitableError if the alarm does not watch it.
        until: a datetime or ISO 8601 with a time zone; None, or a time that has passed, for no longer.
        timeout: seconds, instead of the client's.
    """
    request = pb.MuteAlarmRequest(name=text("name", name), hull=text("hull", hull))
    if until is not None:
        (micros,) = as_microseconds([until], 1, "until").tolist()
        request.mute_time.FromMicroseconds(micros)
    return Call("MuteAlarm", request, lambda response: decode_status(response.status), timeout)


def ack_alarm(
    name: str, consumer: str, sequence: int, *, uid: str = "", timeout: float | None = None
) -> Call[FenceConsumer]:
    """Acknowledge the events of an alarm up to a sequence, for a durable consumer, as `ack_fence` does.

    Args:
        name: the alarm.
        consumer: the name of the consumer, which is created if it is new.
        sequence: the last sequence that has been processed.
        uid: the uid of the alarm that made the event: AlarmReplacedError if it was created again since then.
        timeout: seconds, instead of the client's.
    """
    request = pb.AckAlarmRequest(
        name=text("name", name),
        consumer=text("consumer", consumer),
        sequence=whole("sequence", sequence),
        uid=text("uid", uid),
    )
    return Call("AckAlarm", request, lambda response: decode_consumer(response.consumer), timeout)


def delete_alarm_consumer(name: str, consumer: str, *, timeout: float | None = None) -> Call[None]:
    """Delete a consumer of an alarm. What it has not acknowledged no longer counts as its backlog."""
    request = pb.DeleteAlarmConsumerRequest(name=text("name", name), consumer=text("consumer", consumer))
    return Call("DeleteAlarmConsumer", request, lambda _: None, timeout, repeatable=False)


@dataclass(frozen=True, slots=True)
class WatchingAlarm:
    """A watch of an alarm to begin."""

    request: pb.WatchAlarmRequest
    reconnect: bool
    timeout: float | None


def watch_alarm(
    name: str,
    consumer: str | None = None,
    after: int | None = None,
    *,
    uid: str = "",
    progress_interval: float | None = None,
    reconnect: bool = True,
    timeout: float | None = None,
) -> WatchingAlarm:
    """Follow the events of an alarm: an iterator that ends after the event "closed", when the alarm is deleted.

    >>> for event in client.watch_alarm("spread", consumer="pager"):  # doctest: +SKIP
    ...     print(event.type, event.hull, event.value, event.bound)
    ...     client.ack_alarm("spread", "pager", event.sequence)

    It begins with the next event, unless a consumer or a sequence says where.

    Args:
        name: the alarm.
        consumer: the name of a durable consumer: the watch begins after the last event that it acknowledged, and for a
            new consumer at the oldest event that is kept. The consumer outlives clients and servers; `ack_alarm`
            acknowledges.
        after: the sequence after which to begin; 0 for all events that are kept.
        uid: the uid of the alarm whose sequences the caller has: AlarmReplacedError if it was created again since then.
        progress_interval: seconds without an event after which an event "progress" is sent; None for never.
        reconnect: whether the watch continues after a lost connection, as in `watch_fence`.
        timeout: seconds after which the watch ends with DeadlineError; None for never.
    """
    if consumer is not None and after is not None:
        raise ValueError("give either consumer, which knows its place, or after, not both")
    request = pb.WatchAlarmRequest(name=text("name", name), uid=text("uid", uid))
    encode_start(request, consumer, after, progress_interval)
    return WatchingAlarm(request, reconnect, timeout)
