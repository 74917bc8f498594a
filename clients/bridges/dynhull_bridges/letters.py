"""Events of fences as CloudEvents 1.0 in the structured JSON form."""

import json
from dataclasses import dataclass
from typing import Any

from dynhull_cli.fences.shown import event_members
from dynhull_cli.json_lines import json_line
from dynhull_client import FenceEvent

CONTENT_TYPE = "application/cloudevents+json"
BATCH_CONTENT_TYPE = "application/cloudevents-batch+json"
TYPE_PREFIX = "dynhull.fence."
SEQUENCE_DIGITS = 20  # of the largest 64-bit number: sequences as text then sort like numbers


@dataclass(frozen=True, slots=True)
class Letter:
    """An event to deliver.

    Attributes:
        id: identifies the event, wherever and however often it is delivered.
        fence: the name of the fence.
        type: the type of the event, such as "enter".
        uid: the uid of the fence.
        sequence: the sequence of the event, or the last of those that it says were lost.
        text: the CloudEvent as JSON on one line.
    """

    id: str
    fence: str
    type: str
    uid: str
    sequence: int
    text: str


def letter(event: FenceEvent) -> Letter:
    """The letter with an event."""
    place = f"{event.first}-{event.last}" if event.type == "lost" else str(event.sequence)
    identity = f"{event.uid}-{place}"
    members: dict[str, Any] = {
        "specversion": "1.0",
        "id": identity,
        "source": f"/fences/{event.fence}",
        "type": TYPE_PREFIX + event.type,
        "sequence": f"{event.sequence:0{SEQUENCE_DIGITS}}",
        "datacontenttype": "application/json",
    }
    if event.key is not None:
        members["subject"] = str(event.key)
    if event.time is not None:
        members["time"] = event.time.isoformat()
    text = json_line(**members, data=event_members(event))
    return Letter(identity, event.fence, event.type, event.uid, event.sequence, text)


def read_letter(text: str) -> Letter:
    """The letter with a CloudEvent that `letter` wrote; ValueError if the text is none."""
    try:
        event = json.loads(text)
        data = event["data"]
        return Letter(event["id"], data["fence"], data["type"], data["uid"], data["sequence"], text)
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"not an event of a fence: {text[:80]!r}") from None
