"""Alarms and their events as JSON and as text."""

from datetime import datetime
from typing import Any

from dynhull_client import Alarm, AlarmEvent, AlarmStatus

from ..durations import shown
from ..json_lines import members
from ..plural import plural

LISTS = "snapshot", "closed"  # events that list the hulls for which the alarm was raised
MAY_BE_EMPTY = "alarm", "uid", "sequence", "value", "bound", "previous", "raised"  # what zero or nobody is a value of


def alarm_members(alarm: Alarm) -> dict[str, Any]:
    """An alarm as members of JSON; members without a value are null."""
    found = members(alarm)
    return {"for" if name == "for_" else name: value for name, value in found.items()}


def event_members(event: AlarmEvent) -> dict[str, Any]:
    """An event as members of JSON: those that it has."""
    found = members(event) | {"cause": sorted(event.cause)}
    found["raised"] = event.raised if event.type in LISTS else None
    return {name: value for name, value in found.items() if value or (value is not None and name in MAY_BE_EMPTY)}


def hulls_text(alarm: Alarm) -> str:
    """The hulls that an alarm watches."""
    return alarm.hull if alarm.hull is not None else f"{alarm.prefix}*"


def condition_text(alarm: Alarm) -> str:
    """What raises and clears an alarm."""
    held = f" for {shown(alarm.for_)}" if alarm.for_ else ""
    return f"{alarm.when}{held}, clear {alarm.clear}" if alarm.clear else f"{alarm.when}{held}"


def status_cells(status: AlarmStatus) -> tuple[str, ...]:
    """The hull, whether the alarm is raised, the value, since when, and who has acknowledged or muted it."""
    words = ["raised" if status.raised else "waits" if status.since else "not raised", repr(status.value)]
    if status.since is not None:
        words.append(f"since {time_text(status.since)}")
    if status.acknowledged is not None:
        words.append(f"acknowledged {time_text(status.acknowledged)}")
    if status.muted_until is not None:
        words.append(f"muted until {time_text(status.muted_until)}")
    return status.hull, *words


def event_cells(event: AlarmEvent) -> tuple[str, ...]:
    """Sequence, time, type, hull, value, bound and causes; empty where the event has none."""
    what = event.hull
    if event.type == "lost":
        what = f"{event.first}-{event.last}"
    elif event.type in LISTS:
        what = plural(len(event.raised), "hull")
    numbers = ("" if each is None else repr(each) for each in (event.value, event.bound))
    time = "" if event.time is None else event.time.isoformat(timespec="milliseconds")
    return str(event.sequence), time, event.type, what, *numbers, ",".join(sorted(event.cause))


def time_text(time: datetime) -> str:
    """A time, to the second."""
    return time.isoformat(timespec="seconds")
