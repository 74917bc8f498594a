"""What requests about alarms and their answers look like."""

from typing import Annotated

from pydantic import AliasChoices, Field, StrictStr

import dynhull_client as sdk

from .answers import Span, answering
from .numbers import SPAN, Seconds
from .schemas import Count, Name, Request, Response, example


class NewAlarm(Request):
    """An alarm to create."""

    name: Name
    hull: Name | None = Field(None, description="The hull that is watched,")
    prefix: Annotated[str, Field(strict=True, max_length=200)] | None = Field(
        None, description="or what the names of all hulls that are watched begin with: each has an alarm of its own."
    )
    when: StrictStr = Field(
        max_length=4000,
        description="The condition: a measure (area, perimeter, diameter, width, count or vertices), >, >=, < or <=, a "
        "number and, of hulls on the globe, m, km, m2 or km2; or silent 5m, near HULL 3, vertex in AREA, vertex KEY.",
    )
    clear: Annotated[str, Field(strict=True, max_length=4000)] | None = Field(
        None, description="What clears it, weaker than the opposite of `when`, which it is by default."
    )
    for_: Seconds | None = Field(None, alias="for", description=f"How long the condition must hold before. {SPAN}.")
    max_events: Count = Field(0, description="How many events are kept; 0 for the limit of the server.")
    max_event_age: Seconds | None = Field(None, description=f"How long events are kept. {SPAN}.")


class OfHull(Request):
    """The hull for which an alarm is meant."""

    model_config = example(hull="fleet")

    hull: Name


class Muting(OfHull):
    """For which hull an alarm is muted, and until when."""

    model_config = example(hull="fleet", until="2026-02-01T06:00:00Z")

    until: StrictStr | None = Field(None, max_length=100, description="A time of RFC 3339; null for no longer.")


@answering(sdk.AlarmStatus)
class AlarmStatus(Response):
    """An alarm at one hull."""


@answering(sdk.Alarm)
class Alarm(Response):
    """An alarm with its rule, its counts and its consumers."""

    for_: Span = Field(
        validation_alias=AliasChoices("for", "for_"),
        serialization_alias="for",
        description="The seconds for which the first must hold before.",
    )


class AlarmPage(Response):
    """Alarms by name. `next` is the `after` of the next page; null on the last."""

    alarms: list[Alarm]
    next: str | None
