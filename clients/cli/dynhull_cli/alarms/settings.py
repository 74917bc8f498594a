"""`dynhull alarms create`, `ack` and `mute`."""

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated

import typer

from ..completion import alarms, hulls
from ..connected import AsJson, connected
from ..durations import duration
from ..json_lines import json_line, members

if TYPE_CHECKING:
    from dynhull_client import HullClient

AlarmName = Annotated[str, typer.Argument(metavar="ALARM", help="Name of the alarm.", autocompletion=alarms)]
OfHull = Annotated[str, typer.Argument(metavar="HULL", help="Name of the hull.", autocompletion=hulls)]


@connected
def create(
    client: "HullClient",
    name: AlarmName,
    when: Annotated[
        str,
        typer.Option(
            help="Condition that raises it: MEASURE OP NUMBER [UNIT], silent SPAN, near HULL [DISTANCE], "
            "vertex in AREA, or vertex KEY. MEASURE is area, perimeter, diameter, width, count or vertices; OP is >, "
            ">=, < or <=; UNIT is m, km, m2 or km2, for geographic hulls; AREA is a hull, circle(X, Y, RADIUS) or "
            "polygon(X Y, X Y, X Y)."
        ),
    ],
    hull: Annotated[str | None, typer.Option(metavar="HULL", help="The hull that is watched.")] = None,
    prefix: Annotated[
        str | None, typer.Option(metavar="PREFIX", help="Or all hulls whose names begin with this, later ones too.")
    ] = None,
    clear: Annotated[
        str | None, typer.Option(help="Condition that clears it, weaker than the opposite of --when. Default: that.")
    ] = None,
    for_: Annotated[
        str | None,
        typer.Option("--for", metavar="SPAN", help="How long --when must hold before it is raised, such as 30s."),
    ] = None,
    max_events: Annotated[
        int, typer.Option(min=0, help="Number of events to keep; 0 for the limit of the server.")
    ] = 0,
    max_event_age: Annotated[
        str | None, typer.Option(metavar="SPAN", help="How long events are kept, such as 7d. Default: no limit.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Create an alarm.

        dynhull alarms create spread --hull fleet/north --when 'area > 500 km2' --clear 'area < 450 km2' --for 30s
        dynhull alarms create quiet --prefix fleet/ --when 'silent 5m'
        dynhull alarms create close --hull fleet/north --when 'near fleet/south 2' --clear 'not near fleet/south 3'

    In the plane area, diameter and width are compared exactly. Hulls for which the condition holds already raise it.
    """
    from .shown import alarm_members, condition_text

    if (hull is None) == (prefix is None):
        raise ValueError("give one of --hull and --prefix")
    alarm = client.create_alarm(
        name,
        hull=hull,
        prefix=prefix,
        when=when,
        clear=clear,
        for_=duration(for_, "--for"),
        max_events=max_events,
        max_event_age=duration(max_event_age, "--max-event-age"),
    )
    typer.echo(json_line(**alarm_members(alarm)) if as_json else f"{alarm.name}: {condition_text(alarm)}")


@connected
def ack(client: "HullClient", name: AlarmName, hull: OfHull, as_json: AsJson = False) -> None:
    """Say that somebody takes care of an alarm that is raised for a hull, until it is cleared.

    dynhull alarms ack spread fleet/north
    """
    status = client.acknowledge_alarm(name, hull)
    typer.echo(json_line(**members(status)) if as_json else f"{name}: acknowledged for {hull}")


@connected
def mute(
    client: "HullClient",
    name: AlarmName,
    hull: OfHull,
    span: Annotated[str, typer.Argument(metavar="SPAN", help="For how long, such as 2h; 0 for no longer.")],
    as_json: AsJson = False,
) -> None:
    """Mute an alarm for a hull, for those who show alarms. Its events are made and sent as before.

    dynhull alarms mute spread fleet/north 2h
    """
    from .shown import time_text

    given = duration(span, "SPAN")
    status = client.mute_alarm(name, hull, datetime.now(UTC) + given if given else None)
    until = f"muted for {hull} until {time_text(status.muted_until)}" if status.muted_until else f"not muted for {hull}"
    typer.echo(json_line(**members(status)) if as_json else f"{name}: {until}")
