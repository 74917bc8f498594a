"""`dynhull watch`: the changes of a hull, or of many, live."""

import sys
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from .completion import hulls
from .connected import AsJson, connected

if TYPE_CHECKING:
    from dynhull_client import HullClient


@connected
def watch(
    client: "HullClient",
    name: Annotated[
        str | None, typer.Argument(metavar="[HULL]", help="Name of the hull.", show_default=False, autocompletion=hulls)
    ] = None,
    prefix: Annotated[
        str | None,
        typer.Option(help='In place of HULL: all hulls whose names begin with this; "" for all.', show_default=False),
    ] = None,
    as_json: AsJson = False,
    max_rate: Annotated[
        float,
        typer.Option(min=0, help="At most this many events of a hull per second; 0 for all, of many hulls for 10."),
    ] = 10.0,
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
    outlines: Annotated[bool, typer.Option("--outlines", help="With --prefix and --json, show vertices.")] = False,
    rows: Annotated[int, typer.Option(min=1, help="With --prefix on a terminal, show at most this many hulls.")] = 25,
    position: Annotated[
        str | None, typer.Option(help="With --prefix, go on after this position, as --json has it.", show_default=False)
    ] = None,
) -> None:
    """Follow the changes of a hull: a live table on a terminal, one line per event elsewhere.

        dynhull watch fleet/north --json | jq -c .added
        dynhull watch --prefix fleet/

    A line has, between tabs: revision, points, vertices, vertices added, vertices removed, area, perimeter. The first
    line counts all vertices as added.

    With --json, each event has the revision, the number of points, the measures, and the vertices added and removed
    since the event before. The first event has "snapshot": true and adds all vertices. After a lost connection the
    watch resumes by itself, with the changes it missed or, if the server no longer has them, with a new snapshot.

    With --max-vertices, an event has all vertices chosen, and the error: how far the hull reaches beyond them. A line
    then has, between tabs: revision, points, vertices, area, perimeter, error.

    With --keys, lines also show the keys that joined and left the vertices of the hull; JSON has "joined" and "left".

    With --prefix, many hulls are followed: first the state of each, then that of each that changes, is created or
    deleted. A line has, between tabs: "state", hull, revision, points, vertices, area, perimeter; or "gone", hull. JSON
    has more of each, and positions: --position goes on after one.
    """
    if (name is None) == (prefix is None):
        raise typer.BadParameter("give either a hull or --prefix", param_hint="HULL")
    if prefix is not None:
        _refuse({"keys": keys, "layer": layer > 1}, "follows one hull: it does not go with --prefix")
        _watch_many(client, prefix, max_rate, events, max_vertices, rows, position, outlines=outlines, as_json=as_json)
        return
    _refuse({"outlines": outlines, "position": position}, "is for --prefix")
    assert name is not None  # see above
    from .changes import Shown, follow

    shown = Shown(max_rate=max_rate, keys=keys, layer=layer, max_vertices=max_vertices)
    follow(client, name, shown, events=events, as_json=as_json)


def _refuse(options: dict[str, object], why: str) -> None:
    for option, given in options.items():
        if given:
            raise typer.BadParameter(why, param_hint=f"--{option}")


def _watch_many(
    client: "HullClient",
    prefix: str,
    max_rate: float,
    events: int | None,
    max_vertices: int | None,
    rows: int,
    position: str | None,
    *,
    outlines: bool,
    as_json: bool,
) -> None:
    from .many import follow_many

    try:
        after = None if position is None else bytes.fromhex(position)
    except ValueError:
        raise typer.BadParameter("not hexadecimal digits", param_hint="--position") from None
    contents: Literal["summary", "outline"] = "outline" if outlines or max_vertices is not None else "summary"
    with client.watch_many(
        prefix, contents=contents, max_vertices=max_vertices, max_rate=max_rate, position=after
    ) as watch:
        follow_many(watch, f"in {prefix}" if prefix else "", events=events, rows=rows, as_json=as_json)
