"""`dynhull alarms watch`."""

import sys
from itertools import islice
from typing import TYPE_CHECKING, Annotated

import typer

from ..connected import AsJson, connected
from ..json_lines import json_line
from ..tab_lines import tab_line
from .settings import AlarmName

if TYPE_CHECKING:
    from dynhull_client import HullClient


@connected
def watch(
    client: "HullClient",
    name: AlarmName,
    consumer: Annotated[
        str | None,
        typer.Option(help="Begin after the last event that this durable consumer acknowledged; creates it."),
    ] = None,
    ack: Annotated[bool, typer.Option("--ack", help="Acknowledge each event once it is printed.")] = False,
    after: Annotated[
        int | None, typer.Option(min=0, help="Begin after this sequence; 0 for all events that are kept.")
    ] = None,
    events: Annotated[int | None, typer.Option(min=1, max=sys.maxsize, help="End after this many events.")] = None,
    as_json: AsJson = False,
) -> None:
    """Follow the events of an alarm, one line per event, until it is deleted.

        dynhull alarms watch spread --json | jq -c '[.type, .hull, .value]'
        dynhull alarms watch spread --consumer pager --ack

    A line has, between tabs: sequence, time, type, hull, value, bound, causes. Without --consumer and --after it begins
    with the next event. After a lost connection the watch resumes by itself, without loss or repetition. An event
    "lost" names the sequences that the server dropped before they could be sent.

    With --consumer and --ack, a later watch continues after the last event that was printed.
    """
    from ..closed_pipe import when_pipe_closes
    from .shown import event_cells, event_members

    if ack and consumer is None:
        raise ValueError("--ack needs --consumer: who acknowledges?")
    with client.watch_alarm(name, consumer, after) as stream:
        if not sys.stdout.isatty():
            when_pipe_closes(stream.close)
        for event in islice(stream, events):
            typer.echo(json_line(**event_members(event)) if as_json else tab_line(*event_cells(event)))
            sys.stdout.flush()
            if ack and consumer is not None:
                client.ack_alarm(name, consumer, event.sequence, uid=event.uid)
