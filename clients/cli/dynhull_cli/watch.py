"""`dynhull watch`: the changes of a hull, live."""

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from .connected import AsJson, HullName, connected

if TYPE_CHECKING:
    from dynhull_client import HullClient


@connected
def watch(
    client: "HullClient",
    name: HullName,
    as_json: AsJson = False,
    max_rate: Annotated[float, typer.Option(min=0, help="At most this many events per second; 0 for all.")] = 10.0,
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
    """Follow the changes of a hull: a live table on a terminal, one line per event elsewhere.

        dynhull watch fleet/north --json | jq -c .added

    A line has, between tabs: revision, points, vertices, vertices added, vertices removed, area, perimeter. The first
    line counts all vertices as added.

    With --json, each event has the revision, the number of points, the measures, and the vertices added and removed
    since the event before. The first event has "snapshot": true and adds all vertices. After a lost connection the
    watch resumes by itself, with the changes it missed or, if the server no longer has them, with a new snapshot.

    With --max-vertices, an event has all vertices chosen, and the error: how far the hull reaches beyond them. A line
    then has, between tabs: revision, points, vertices, area, perimeter, error.

    With --keys, lines also show the keys that joined and left the vertices of the hull; JSON has "joined" and "left".
    """
    from .changes import Shown, follow

    shown = Shown(max_rate=max_rate, keys=keys, layer=layer, max_vertices=max_vertices)
    follow(client, name, shown, events=events, as_json=as_json)
