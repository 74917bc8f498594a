"""`dynhull replay`: the past of a hull, played back."""

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from .connected import AsJson, HullName, connected
from .durations import more_than_0

if TYPE_CHECKING:
    from dynhull_client import HullClient

WHEN = "a revision, all digits, or a time, such as 2026-11-24T16:00Z"

From = Annotated[
    str | None,
    typer.Option("--from", metavar="WHEN", help=f"Where to begin: {WHEN}. By default the oldest there is."),
]
To = Annotated[str | None, typer.Option("--to", metavar="WHEN", help=f"Where to end: {WHEN}. By default the newest.")]
Every = Annotated[
    str | None, typer.Option(metavar="SPAN", help="The least time of the past between two lines, such as 1m.")
]


@connected
def replay(
    client: "HullClient",
    name: HullName,
    begin: From = None,
    end: To = None,
    speed: Annotated[
        float, typer.Option(min=0, help="How many seconds of the past go by in one; 0 for as fast as they are read.")
    ] = 0.0,
    every: Every = None,
    as_json: AsJson = False,
    max_rate: Annotated[float, typer.Option(min=0, help="At most this many events per second; 0 for all.")] = 0.0,
    events: Annotated[int | None, typer.Option(min=1, max=sys.maxsize, help="End after this many events.")] = None,
    keys: Annotated[bool, typer.Option("--keys", help="Name the vertices of a keyed hull by their keys.")] = False,
    layer: Annotated[
        int, typer.Option(min=1, max=1000, help="Follow the hull of this convex layer; 1 is the hull itself.")
    ] = 1,
    max_vertices: Annotated[
        int | None,
        typer.Option(
            min=1, max=1000, help="At most this many of the vertices, and how far the hull reaches beyond them."
        ),
    ] = None,
) -> None:
    """Play the past of a hull: a table on a terminal, one line per event elsewhere, as `dynhull watch` shows them.

        dynhull replay fleet/north --from 2026-11-24T06:00Z --to 2026-11-24T18:00Z --speed 600
        dynhull replay fleet/north --every 1m --json | jq -c '[.changed, .area]'

    A line has, between tabs: revision, time of the commit, points, vertices, vertices added, vertices removed, area,
    perimeter. The first line counts all vertices as added.

    With --json, each event is as that of `dynhull watch`; "changed" is the time of the commit.

    Where the program of the next pipe, or the terminal, is slower than --speed asks for, a line has the changes of more
    time. With --speed 0 each revision is a line. After a lost connection the replay goes on where it was.
    """
    from dynhull_surface.as_of import moment_of

    from .changes import Played, Shown, follow

    follow(
        client,
        name,
        Shown(max_rate=max_rate, keys=keys, layer=layer, max_vertices=max_vertices),
        played=Played(
            moment_of(begin, "--from"),
            moment_of(end, "--to"),
            speed,
            None if every is None else more_than_0(every, "--every"),
        ),
        events=events,
        as_json=as_json,
    )
