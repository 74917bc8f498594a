"""`dynhull list`, `dynhull create` and `dynhull delete`: the hulls of a server."""

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from .connected import AsJson, connected, fail
from .exits import Exit
from .json_lines import json_line
from .plural import plural

if TYPE_CHECKING:
    from rich.table import Table

    from dynhull_client import HullClient, HullInfo

Names = Annotated[list[str], typer.Argument(metavar="HULL", help="Names of the hulls.")]


@connected
def list_hulls(
    client: "HullClient",
    prefix: Annotated[str, typer.Argument(metavar="PREFIX", help="List only hulls whose names begin with this.")] = "",
    as_json: AsJson = False,
) -> None:
    """List the hulls of the server by name, with their points, distinct points and revision.

    dynhull list fleet/ --json | jq -r .name

    A terminal shows a table; a pipe receives one line per hull with tabs between the columns.
    """
    from rich.console import Console

    hulls = client.list_hulls(prefix)
    console = Console(highlight=False)
    if console.is_terminal and not as_json:
        console.print(_table(list(hulls)))
        return
    for info in hulls:
        if as_json:
            counts = {"points": info.points, "distinct": info.distinct, "revision": info.revision}
            typer.echo(json_line(name=info.name, **counts, created=info.created.isoformat(), uid=info.uid))
        else:
            typer.echo(f"{info.name}\t{info.points}\t{info.distinct}\t{info.revision}")


@connected
def create(
    client: "HullClient",
    names: Names,
    exist_ok: Annotated[bool, typer.Option("--exist-ok", help="Accept a hull that exists already.")] = False,
    as_json: AsJson = False,
) -> None:
    """Create hulls without points.

    dynhull create fleet/north fleet/south
    """
    from dynhull_client import HullExistsError

    for name in names:
        try:
            client.create_hull(name)
            created = True
        except HullExistsError:
            if not exist_ok:
                raise
            created = False
        typer.echo(
            json_line(name=name, created=created) if as_json else f"{name}: {'created' if created else 'exists'}"
        )


@connected
def delete(
    client: "HullClient",
    names: Names,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Delete without asking.")] = False,
    missing_ok: Annotated[bool, typer.Option("--missing-ok", help="Skip a hull that does not exist.")] = False,
    as_json: AsJson = False,
) -> None:
    """Delete hulls with all their points. This cannot be undone.

        dynhull delete fleet/north

    On a terminal the command asks first; elsewhere it needs --yes. Where a hull does not exist, none is deleted.
    """
    from dynhull_client import HullNotFoundError

    found = []
    for name in dict.fromkeys(names):
        try:
            found.append(client.get_hull(name).info)
        except HullNotFoundError:
            if not missing_ok:
                raise
    if found and not yes:
        _confirm(found)
    for info in found:
        client.delete_hull(info.name)
        typer.echo(
            json_line(name=info.name, points=info.points)
            if as_json
            else f"{info.name}: deleted, {plural(info.points, 'point')}"
        )


def _confirm(found: "list[HullInfo]") -> None:
    what = ", ".join(f"{info.name} ({plural(info.points, 'point')})" for info in found)
    if not sys.stdin.isatty():
        fail(Exit.UNUSABLE, f"nothing was deleted: without a terminal to ask on, add --yes to delete {what}")
    if not typer.confirm(f"Delete {what}?", err=True):
        fail(Exit.FAILED, "nothing was deleted")


def _table(hulls: "list[HullInfo]") -> "Table":
    from rich.table import Table

    table = Table("hull")
    for heading in ("points", "distinct", "revision"):
        table.add_column(heading, justify="right")
    for info in hulls:
        table.add_row(info.name, *(f"{each:,}" for each in (info.points, info.distinct, info.revision)))
    return table
