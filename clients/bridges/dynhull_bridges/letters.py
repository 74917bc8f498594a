"""Events of fences and alarms as CloudEvents 1.0 in the structured JSON form."""

import json
from dataclasses import dataclass
from typing import Any

from dynhull_cli.alarms.shown import event_members as alarm_event_members
from dynhull_cli.fences.shown import event_members as fence_event_members
from dynhull_cli.json_lines import json_line
from dynhull_client import AlarmEvent

from .sources import Event, Source

CONTENT_TYPE = "application/cloudevents+json"
BATCH_CONTENT_TYPE = "application/cloudevents-batch+json"
SEQUENCE_DIGITS = 20  # of the largest 64-bit number: sequences as text then sort like numbers


@dataclass(frozen=True, slots=True)
class Letter:
    """An event to deliver.

    Attributes:
        id: identifies the event, wherever and however often it is delivered.
        source: the fence or the alarm.
        type: the type of the event, such as "enter".
        uid: the uid of the fence or the alarm.
        sequence: the sequence of the event, or the last of those that it says were lost.
        text: the CloudEvent as JSON on one line.
    """

    id: str
    source: Source
    type: str
    uid: str
    sequence: int
    text: str


def letter(event: Event) -> Letter:
    """The letter with an event."""
    subject: str | int | None
    if isinstance(event, AlarmEvent):
        source, subject, data = Source("alarm", event.alarm), event.hull or None, alarm_event_members(event)
    else:
        source, subject, data = Source("fence", event.fence), event.key, fence_event_members(event)
    place = f"{event.first}-{event.last}" if event.type == "lost" else str(event.sequence)
    identity = f"{event.uid}-{place}"
    members: dict[str, Any] = {
        "specversion": "1.0",
        "id": identity,
        "source": f"/{source.kind}s/{source.name}",
        "type": f"dynhull.{source.kind}.{event.type}",
        "sequence": f"{event.sequence:0{SEQUENCE_DIGITS}}",
        "datacontenttype": "application/json",
    }
    if subject is not None:
        members["subject"] = str(subject)
    if event.time is not None:
        members["time"] = event.time.isoformat()
    return Letter(identity, source, event.type, event.uid, event.sequence, json_line(**members, data=data))


def read_letter(text: str) -> Letter:
    """The letter with a CloudEvent that `letter` wrote; ValueError if the text is none."""
    try:
        event = json.loads(text)
        data = event["data"]
        source = Source("alarm", data["alarm"]) if "alarm" in data else Source("fence", data["fence"])
        return Letter(event["id"], source, data["type"], data["uid"], data["sequence"], text)
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"not an event of a fence or an alarm: {text[:80]!r}") from None
