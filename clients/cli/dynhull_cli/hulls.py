"""`dynhull list`, `dynhull create` and `dynhull delete`: the hulls of a server."""

import sys
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynhull_surface.reasons import Exit

from .connected import AsJson, connected, fail
from .durations import duration, shown
from .json_lines import json_line
from .listing import below, listed
from .plural import plural
from .quarantine import Confirmations, MaxGrowth, MaxSpeed, given_rules, rule_members, shown_rules

if TYPE_CHECKING:
    from rich.table import Table

    from dynhull_client import HullClient, HullInfo


class KeyKind(StrEnum):
    """The kinds of keys."""

    STR = "str"
    INT = "int"


class ClockKind(StrEnum):
    """The clocks of a window."""

    SERVER = "server"
    DATA = "data"


Names = Annotated[list[str], typer.Argument(metavar="HULL", help="Names of the hulls.")]


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
    from rich.console import Console

    hulls = listed(client.list_hulls(prefix), below("hulls", prefix))
    console = Console(highlight=False)
    if console.is_terminal and not as_json:
        if rows := list(hulls):
            console.print(_table(rows))
        return
    for info in hulls:
        if as_json:
            typer.echo(json_line(**_members(info)))
        else:
            counts = f"{info.points}\t{info.distinct}\t{info.revision}"
            frame = f"\tglobe {_shown_place(info)}".rstrip(" ") if info.geographic else ""
            held = f"\tquarantine {_quarantine(info)}" if _quarantine(info) else ""
            typer.echo(f"{info.name}\t{counts}\t{info.keyed or '-'}\t{_window(info) or '-'}{frame}{held}")


COUNTS = {"min": 1, "max": 2**63 - 1, "metavar": "INTEGER"}


def _setting(text: str, *names: str, **more: Any) -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Settings, fixed from then on", **more)


@connected
def create(
    client: "HullClient",
    names: Names,
    keyed: Annotated[
        KeyKind | None,
        _setting("Name each point by a key, a string or an integer. Default: points without keys.", "--keyed"),
    ] = None,
    max_age: Annotated[
        str | None,
        _setting("Age at which points leave: 500ms, 90s, 30m, 2h or 7d; a number alone is seconds. Default: never."),
    ] = None,
    max_points: Annotated[
        int | None, _setting("Number of points beyond which the oldest leave. Default: no such limit.", **COUNTS)
    ] = None,
    clock: Annotated[
        ClockKind, _setting("Clock that decides what is too old: the server's, or data for the latest event time.")
    ] = ClockKind.SERVER,
    max_skew: Annotated[
        str | None,
        _setting("How far an event time may be ahead of the server's clock, as for --max-age. Default: any distance."),
    ] = None,
    clamp: Annotated[
        bool, _setting("Reduce event times further ahead to the latest allowed, rather than refuse them.", "--clamp")
    ] = False,
    event_order: Annotated[
        bool,
        _setting(
            "Of two positions of a key, keep the one with the later event time. Default: that which arrives last."
        ),
    ] = False,
    point_limit: Annotated[
        int | None,
        _setting("Number of points beyond which batches are refused. Default: the server's limit.", **COUNTS),
    ] = None,
    geographic: Annotated[
        bool, _setting("Points are longitudes and latitudes on the globe. Default: points of a plane.", "--geographic")
    ] = False,
    center: Annotated[
        str | None,
        _setting(
            "Centre of a geographic hull, LON,LAT in degrees; points are within 85 degrees of it. Default: the mean "
            "direction of the first points.",
            "--center",
            "--centre",
        ),
    ] = None,
    max_speed: MaxSpeed = None,
    max_growth: MaxGrowth = None,
    confirmations: Confirmations = None,
    shards: Annotated[
        int | None,
        _setting(
            "Number of shards to divide the points among, each on one of the server's workers. Default: one hull.",
            **COUNTS,
        ),
    ] = None,
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

    settings: dict[str, Any] = {
        "keyed": keyed and keyed.value,
        "max_age": duration(max_age, "--max-age"),
        "max_points": max_points,
        "clock": clock.value,
        "max_skew": duration(max_skew, "--max-skew"),
        "ahead": "clamp" if clamp else "refuse",
        "ordering": "event_time" if event_order else "arrival",
        "point_limit": point_limit,
        "geographic": geographic,
        "center": None if center is None else _place(center),
        "quarantine": given_rules(max_speed, max_growth, confirmations),
        "shards": shards,
    }
    _require("--geographic", geographic, {"--center": center is not None})
    _require(
        "--keyed",
        keyed is not None,
        {"--max-speed": max_speed is not None, "--max-growth": max_growth is not None, "--event-order": event_order},
    )
    _require(
        "--max-age or --max-points",
        max_age is not None or max_points is not None,
        {"--clock": clock is not ClockKind.SERVER, "--max-skew": max_skew is not None, "--clamp": clamp},
    )
    for name in names:
        try:
            client.create_hull(name, **settings)
            created = True
        except HullExistsError:
            if not exist_ok:
                raise
            client.create_hull(name, **settings, exist_ok=True)  # refuses other settings
            created = False
        typer.echo(
            json_line(name=name, created=created) if as_json else f"{name}: {'created' if created else 'exists'}"
        )


def _require(other: str, there: bool, given: dict[str, bool]) -> None:
    """Raise ValueError for an option that is given without the other one that it needs."""
    for option in (option for option, is_given in given.items() if is_given and not there):
        raise ValueError(f"{option} is given with {other}")


@connected
def recenter(
    client: "HullClient",
    name: Annotated[str, typer.Argument(metavar="HULL", help="Name of the hull.")],
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
    info = client.recenter(name, None if center is None else _place(center))
    if as_json:
        typer.echo(json_line(name=name, revision=info.revision, center=info.center))
    else:
        typer.echo(f"{name}: about {_shown_place(info)}, revision {info.revision}")


@connected
def reshard(
    client: "HullClient",
    name: Annotated[str, typer.Argument(metavar="HULL", help="Name of the hull.")],
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


def _place(text: str) -> tuple[float, float]:
    """LON,LAT as numbers; ValueError for another text."""
    try:
        lon, lat = (float(each) for each in text.split(","))
    except ValueError:
        raise ValueError(f"the centre is {text!r}: give LON,LAT, two numbers of degrees") from None
    return lon, lat


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


def _members(info: "HullInfo") -> dict[str, Any]:
    window = info.window
    return {
        "name": info.name,
        "points": info.points,
        "distinct": info.distinct,
        "revision": info.revision,
        "created": info.created.isoformat(),
        "uid": info.uid,
        "keyed": info.keyed,
        "ordering": info.ordering,
        "point_limit": info.point_limit,
        "max_age": None if window is None or window.max_age is None else window.max_age.total_seconds(),
        "max_points": None if window is None else window.max_points,
        "window_clock": None if window is None else window.clock,
        "max_skew": None if window is None or window.max_skew is None else window.max_skew.total_seconds(),
        "ahead": None if window is None else window.ahead,
        "clock": None if info.clock is None else info.clock.isoformat(),
        "geographic": info.geographic,
        "center": info.center,
        "held": info.held,
        "shards": info.shards,
        "restored": info.restored,
        **rule_members(info.quarantine),
    }


def _window(info: "HullInfo") -> str:
    """The limits of the window in a few characters; empty without one."""
    if info.window is None:
        return ""
    age = [] if info.window.max_age is None else [shown(info.window.max_age)]
    return ", ".join([*age, *([] if info.window.max_points is None else [f"{info.window.max_points:,} points"])])


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
