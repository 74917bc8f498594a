"""`dynhull list`, `dynhull create` and `dynhull delete`: the hulls of a server."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynhull_surface.settings import HullSettings

from . import completion
from .connected import AsJson, connected
from .durations import shown
from .history import KEPT, HistoryBytes, given_history
from .json_lines import json_line, members
from .listing import below, confirm_deletion, existing, listed, made, print_list
from .lon_lat import lon_lat
from .plural import plural
from .quarantine import Confirmations, MaxGrowth, MaxSpeed, given_rules, rule_members, shown_rules
from .setting_options import choosing, settings_options

if TYPE_CHECKING:
    from rich.table import Table

    from dynhull_client import HullClient, HullInfo

WINDOW = "max_age", "max_points", "clock", "max_skew", "ahead"

NewNames = Annotated[list[str], typer.Argument(metavar="HULL", help="Names of the hulls.")]
Names = Annotated[
    list[str], typer.Argument(metavar="HULL", help="Names of the hulls.", autocompletion=completion.hulls)
]


@connected
def list_hulls(
    client: "HullClient",
    prefix: Annotated[str, typer.Argument(metavar="PREFIX", help="List only hulls whose names begin with this.")] = "",
    as_json: AsJson = False,
) -> None:
    """List the hulls by name: points, distinct points, revision, kind of keys, window, centre and quarantine.

    dynhull list fleet/ --json | jq -r .name

    A terminal shows a table; a pipe receives one line per hull with tabs between the columns.
    """
    print_list(listed(client.list_hulls(prefix), below("hulls", prefix)), as_json, _members, _line, _table)


@connected
@choosing(settings_options(HullSettings, "Settings, fixed from then on"))
def create(
    client: "HullClient",
    names: NewNames,
    chosen: dict[str, Any],
    max_speed: MaxSpeed = None,
    max_growth: MaxGrowth = None,
    confirmations: Confirmations = None,
    history: Annotated[str | None, typer.Option("--history", help=KEPT, metavar="SPAN")] = None,
    history_bytes: HistoryBytes = None,
    exist_ok: Annotated[
        bool, typer.Option("--exist-ok", help="Accept a hull that exists already with the same settings.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Create hulls without points.

        dynhull create fleet/north fleet/south
        dynhull create vehicles --keyed str --max-age 30m --geographic

    A hull with --keyed holds one point for each key: `dynhull put` inserts or moves it. With --max-age or --max-points,
    points leave the hull by themselves. With --geographic, edges are great circles; lengths and areas are metres and
    square metres on WGS 84. With --max-speed or --max-growth, bad positions wait in quarantine: `dynhull quarantine`.
    """
    from dynhull_client import HullExistsError

    chosen["quarantine"] = given_rules(max_speed, max_growth, confirmations)
    if chosen["quarantine"] is not None and chosen["keyed"] is None:
        raise ValueError(f"{'--max-speed' if max_speed is not None else '--max-growth'} is given with --keyed")
    chosen["history"], chosen["history_bytes"] = given_history(history, "--history"), history_bytes
    if history is None and history_bytes is not None:
        raise ValueError("--history-bytes is given with --history")
    for name in names:
        _, created = made(client.create_hull, HullExistsError, exist_ok=exist_ok, name=name, **chosen)
        typer.echo(
            json_line(name=name, created=created) if as_json else f"{name}: {'created' if created else 'exists'}"
        )


@connected
def recenter(
    client: "HullClient",
    name: Annotated[str, typer.Argument(metavar="HULL", help="Name of the hull.", autocompletion=completion.hulls)],
    center: Annotated[
        str | None,
        typer.Argument(metavar="LON,LAT", help="New centre, in degrees. Default: the mean direction of the points."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Move the centre of a geographic hull, whose points are within 85 degrees of it.

        dynhull recenter fleet -- -170,-15

    The hull is built anew, as one revision.
    """
    info = client.recenter(name, None if center is None else lon_lat(center))
    if as_json:
        typer.echo(json_line(name=name, revision=info.revision, center=info.center))
    else:
        typer.echo(f"{name}: about {_shown_place(info)}, revision {info.revision}")


@connected
def reshard(
    client: "HullClient",
    name: Annotated[str, typer.Argument(metavar="HULL", help="Name of the hull.", autocompletion=completion.hulls)],
    shards: Annotated[
        int, typer.Argument(metavar="SHARDS", help="The number of shards from now on, 1 to 1024.", min=1)
    ],
    as_json: AsJson = False,
) -> None:
    """Divide the points of a hull over shards among another number of shards.

        dynhull reshard fleet 16

    Batches wait until that is done; watches go on. It is one revision, in which the hull stays as it is.
    """
    info = client.reshard(name, shards)
    if as_json:
        typer.echo(json_line(name=name, revision=info.revision, shards=info.shards))
    else:
        typer.echo(f"{name}: {info.shards} shard{'' if info.shards == 1 else 's'}, revision {info.revision}")


def _shown_place(info: "HullInfo") -> str:
    """The centre of a hull in a few characters; empty without one."""
    return "" if info.center is None else ",".join(f"{each:g}" for each in info.center)


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

    found = existing(names, lambda name: client.get_hull(name).info, HullNotFoundError if missing_ok else None)
    if not yes:
        confirm_deletion([f"{info.name} ({plural(info.points, 'point')})" for info in found])
    for info in found:
        client.delete_hull(info.name)
        typer.echo(
            json_line(name=info.name, points=info.points)
            if as_json
            else f"{info.name}: deleted, {plural(info.points, 'point')}"
        )


def _line(info: "HullInfo") -> str:
    counts = f"{info.points}\t{info.distinct}\t{info.revision}"
    frame = f"\tglobe {_shown_place(info)}".rstrip(" ") if info.geographic else ""
    held = f"\tquarantine {_quarantine(info)}" if _quarantine(info) else ""
    return f"{info.name}\t{counts}\t{info.keyed or '-'}\t{_window(info) or '-'}{frame}{held}"


def _members(info: "HullInfo") -> dict[str, Any]:
    window = dict.fromkeys(WINDOW) if info.window is None else members(info.window)
    window["window_clock"] = window.pop("clock")
    hull = {name: value for name, value in members(info).items() if name not in ("window", "quarantine")}
    return {**hull, **window, "restored": info.restored, **rule_members(info.quarantine)}


def _window(info: "HullInfo") -> str:
    """The limits of the window in a few characters; empty without one."""
    window = info.window
    if window is None:
        return ""
    limits = (
        None if window.max_age is None else shown(window.max_age),
        None if window.max_points is None else f"{window.max_points:,} points",
        None if window.max_skew is None else f"{shown(window.max_skew)} ahead",
    )
    return ", ".join(filter(None, limits))


def _quarantine(info: "HullInfo") -> str:
    """The rules of the quarantine and the number of keys in it; empty without rules and keys."""
    if info.quarantine is None and not info.held:
        return ""
    return f"{shown_rules(info.quarantine)}, {info.held:,} held"


def _table(hulls: "list[HullInfo]") -> "Table":
    from rich.table import Table

    table = Table("hull")
    for heading in ("points", "distinct", "revision"):
        table.add_column(heading, justify="right")
    table.add_column("keys")
    table.add_column("window")
    table.add_column("centre")
    table.add_column("quarantine")
    for info in hulls:
        counts = (f"{each:,}" for each in (info.points, info.distinct, info.revision))
        table.add_row(info.name, *counts, info.keyed or "", _window(info), _shown_place(info), _quarantine(info))
    return table
