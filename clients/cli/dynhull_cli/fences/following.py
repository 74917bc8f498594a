"""`dynhull fences watch` and `dynhull fences ack`."""

import sys
from itertools import islice
from typing import TYPE_CHECKING, Annotated

import typer

from ..connected import AsJson, connected
from ..json_lines import json_line
from ..plural import plural
from ..tab_lines import tab_line
from .settings import FenceName

if TYPE_CHECKING:
    from dynhull_client import HullClient


@connected
def watch(
    client: "HullClient",
    name: FenceName,
    consumer: Annotated[
        str | None,
        typer.Option(help="Begin after the last event that this durable consumer acknowledged; creates it."),
    ] = None,
    ack: Annotated[bool, typer.Option("--ack", help="Acknowledge each event once it is printed.")] = False,
    after: Annotated[
        int | None, typer.Option(min=0, help="Begin after this sequence; 0 for all events that are kept.")
    ] = None,
    events: Annotated[int | None, typer.Option(min=1, max=sys.maxsize, help="End after this many events.")] = None,
    conflate: Annotated[
        bool,
        typer.Option(
            "--conflate",
            help="Leave out an enter and an exit that cancel each other. "
            'A later --after is the member "after" of --json.',
        ),
    ] = False,
    max_rate: Annotated[float, typer.Option(min=0, help="At most this many messages per second; 0 for all.")] = 0.0,
    as_json: AsJson = False,
) -> None:
    """Follow the events of a fence, one line per event, until it is deleted.

        dynhull fences watch depot --json | jq -c '[.type, .key]'
        dynhull fences watch depot --consumer alarm --ack

    A line has, between tabs: sequence, time, type, hull, key, x, y, causes. Without --consumer and --after it begins
    with the next event. After a lost connection the watch resumes by itself, without loss or repetition. An event
    "lost" names the sequences that the server dropped before they could be sent.

    With --consumer and --ack, a later watch continues after the last event that was printed.
    """
    from dynhull_client import FenceEvent

    from ..closed_pipe import when_pipe_closes
    from .shown import event_cells, event_members

    if ack and consumer is None:
        raise ValueError("--ack needs --consumer: who acknowledges?")

    def line(event: FenceEvent) -> str:
        if as_json:
            return json_line(**event_members(event), **({"after": event.after} if conflate else {}))
        return tab_line(*event_cells(event))

    with client.watch_fence(name, consumer, after, conflate=conflate, max_rate=max_rate) as stream:
        if not sys.stdout.isatty():
            when_pipe_closes(stream.close)
        for event in islice(stream, events):
            typer.echo(line(event))
            sys.stdout.flush()
            if ack and consumer is not None:
                client.ack_fence(name, consumer, event.sequence, uid=event.uid)


@connected
def ack(
    client: "HullClient",
    name: FenceName,
    consumer: Annotated[str, typer.Argument(metavar="CONSUMER", help="Name of the durable consumer.")],
    sequence: Annotated[int, typer.Argument(metavar="SEQUENCE", min=0, help="The last sequence that is done.")],
    as_json: AsJson = False,
) -> None:
    """Acknowledge the events of a fence up to a sequence, for a durable consumer, which is created if it is new.

    dynhull fences ack depot alarm 1440
    """
    now = client.ack_fence(name, consumer, sequence)
    typer.echo(
        json_line(consumer=now.name, acknowledged=now.acknowledged, backlog=now.backlog, lost=now.lost)
        if as_json
        else f"{now.name}: acknowledged {now.acknowledged}, {plural(now.backlog, 'event')} to come"
    )
