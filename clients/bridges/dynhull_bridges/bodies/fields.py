"""The fields of events that templates name, and events to try a template with."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import fields
from datetime import UTC, datetime
from typing import Any, get_args

from dynhull_client import AlarmEvent, FenceEvent, SubjectsInside

from ..letters import Letter, letter
from ..sources import Event, Kind

TIME = datetime(2026, 1, 1, tzinfo=UTC)
OF_EVENT = "specversion", "id", "source", "type", "sequence", "datacontenttype", "subject", "time", "data"
OF_DATA: dict[Kind, tuple[str, ...]] = {
    "fence": tuple(each.name for each in fields(FenceEvent)),
    "alarm": tuple(each.name for each in fields(AlarmEvent)),
}
ADDED = "event", "kind", "name"
LISTS = "cause", "inside", "keys", "position", "previous_position", "raised"
NEVER_SENT = "progress", "unknown"


def fields_of(kinds: Sequence[Kind]) -> list[str]:
    """The names that templates may use."""
    return list(dict.fromkeys((*ADDED, *(name for kind in kinds for name in OF_DATA[kind]))))


def values_of(letter: Letter) -> dict[str, Any]:
    """The values of all fields, those of other kinds too; None where the event has none."""
    event = {**dict.fromkeys(OF_EVENT), **json.loads(letter.text)}
    nothing = {name: None for names in OF_DATA.values() for name in names}
    data: dict[str, Any] = event["data"]
    return nothing | data | {"event": event, "kind": letter.source.kind, "name": letter.source.name}


def samples(kinds: Sequence[Kind]) -> Iterator[Letter]:
    """Events of each type, with as much as such an event may have, and with as little."""
    for kind in kinds:
        types, least, most = _of_fences() if kind == "fence" else _of_alarms()
        for each in types:
            if each not in NEVER_SENT:
                yield letter(least(each))
                yield letter(most(each))


def _of_fences() -> tuple[Sequence[str], Any, Any]:
    def least(kind: Any) -> Event:
        return FenceEvent(kind, 1, "fence", "uid")

    def most(kind: Any) -> Event:
        return FenceEvent(
            kind,
            2,
            "fence",
            "uid",
            cause=frozenset({"subject_moved"}),
            hull="hull",
            key='a "key"',
            revision=2,
            area_revision=3,
            position=(1.5, 2.0),
            previous_position=(0.0, 1.0),
            distance=0.5,
            event_time=TIME,
            time=TIME,
            first_time=TIME,
            inside=(SubjectsInside("hull", ("a", "b"), 1),),
            first=1,
            last=2,
            conflated=1,
            previous_hull="other",
            previous_hull_revision=1,
        )

    return get_args(FenceEvent.__annotations__["type"]), least, most


def _of_alarms() -> tuple[Sequence[str], Any, Any]:
    def least(kind: Any) -> Event:
        return AlarmEvent(kind, 1, "alarm", "uid")

    def most(kind: Any) -> Event:
        return AlarmEvent(
            kind,
            2,
            "alarm",
            "uid",
            hull="hull",
            revision=2,
            value=12.5,
            bound=10.0,
            cause=frozenset({"batch"}),
            cause_revision=2,
            cause_hull="hull",
            cause_time=TIME,
            previous=8.0,
            time=TIME,
            keys=('a "key"', 7),
            raised=("hull", "other"),
            first=1,
            last=2,
        )

    return get_args(AlarmEvent.__annotations__["type"]), least, most
