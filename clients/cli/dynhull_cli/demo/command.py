"""The command: `dynhull demo`."""

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..durations import duration
from ..out_file import check_out

if TYPE_CHECKING:
    from datetime import timedelta

    from .scene import Scene

# Snow: the longest mean delay of the year, 180 flights cancelled.
DEFAULT_DAY = "2013-03-08"
DEFAULT_SPEED = 120.0


def demo(
    day: Annotated[
        str,
        typer.Option(
            metavar="YYYY-MM-DD",
            help="The day of 2013 to replay. 2013-03-08 had snow and the worst delays of the year.",
        ),
    ] = DEFAULT_DAY,
    hours: Annotated[int, typer.Option(min=1, max=24, help="The hours of the day to replay, from midnight.")] = 24,
    points: Annotated[
        Path | None, typer.Option(exists=True, dir_okay=False, help="Replay this CSV file instead.")
    ] = None,
    x: Annotated[
        str | None,
        typer.Option(
            help="Column of x, by name or by number from 1. Default: x, lon, lng, long, longitude or easting."
        ),
    ] = None,
    y: Annotated[str | None, typer.Option(help="Column of y. Default: y, lat, latitude or northing.")] = None,
    identity: Annotated[
        str | None,
        typer.Option("--id", "--key", help="Column that identifies a point: a row with a known id moves its point."),
    ] = None,
    time: Annotated[str | None, typer.Option(help="Column to order by: one batch for each value.")] = None,
    batches: Annotated[int, typer.Option(min=1, help="Without --time: number of batches to cut the file into.")] = 100,
    geographic: Annotated[
        bool | None,
        typer.Option(
            "--geographic/--plane",
            help="Whether the points of --points are on the globe, in degrees, or in the plane. Default: on the globe "
            "if the columns are named lon and lat, or the like.",
            show_default=False,
        ),
    ] = None,
    window: Annotated[
        str | None,
        typer.Option(
            help="Replay all positions of the last 30m (or 90s, 2h) in place of the latest ones: points without keys, "
            "which the server removes when they are that old."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(dir_okay=False, help="PNG file to write the picture to.")] = Path(
        "dynhull-demo.png"
    ),
    live: Annotated[
        bool,
        typer.Option(
            "--live",
            help="Show the flights, or --points, on a dashboard until Ctrl-C, over and over, with a gateway beside it.",
        ),
    ] = False,
    speed: Annotated[
        float, typer.Option(min=1, max=6000, help="With --live: how many times as fast as the day was.")
    ] = DEFAULT_SPEED,
) -> None:
    """Replay real points through a real server and verify every step.

    The command starts a server of its own and sends one batch per minute of the day, which puts each flight, by its
    number, where it is, and removes those that have landed. The server names the corners of the hull. A watcher
    follows. After every batch the command compares the live hull with Chan's static recomputation, its keys and their
    positions with those sent, and the watcher's copy with the live hull. Fences around three airports and between the
    hulls of two airlines report who enters and leaves; every event is compared with a recomputation. Then all is
    played again, from the past that the server has kept, and compared with what was live. It ends with
    VERIFIED and exit code 0, or with the first difference and exit code 1.

    To look at: dynhull demo --live. It prints the address of a dashboard, and of a gateway for HTTP.

    Your own points: dynhull demo --points fleet.csv --x lon --y lat --key vehicle --time minute, also with --live
    """
    from rich.console import Console
    from rich.text import Text

    from dynhull_client import DynhullError

    from .show import show

    def own(*, keyed: bool = False) -> "Scene":
        from .table import Table

        assert points is not None
        return Table(points, x, y, identity, time, batches, geographic=geographic, keyed=keyed)

    console = Console(highlight=False, soft_wrap=True)
    try:
        if live:
            if window is not None:
                raise ValueError("--live shows the latest positions: leave out --window")
            from .live import FIRST_FLIGHTS, OWN_POINTS
            from .live import live as show_live

            if points is None:
                _require_points(geographic)
                show_live(console, _flights(day, hours, None), speed, FIRST_FLIGHTS)
            else:
                show_live(console, own(keyed=True), speed, OWN_POINTS)
            return
        check_out(out, [".png"])
        max_age = duration(window, "--window")
        if points is not None:
            if max_age is not None:
                raise ValueError("--window is for the flights, not for --points")
            scene = own()
        else:
            _require_points(geographic)
            scene = _flights(day, hours, max_age)
        verified = show(console, scene, out)
    except (ValueError, OSError, RuntimeError, DynhullError) as error:
        message = Text.assemble(("error: ", "red"), str(error))
        Console(stderr=True, soft_wrap=True).print(message)
        raise typer.Exit(2) from None
    if not verified:
        raise typer.Exit(1)


def _require_points(geographic: bool | None) -> None:
    if geographic is not None:
        raise ValueError("--geographic and --plane are for --points: the flights are on the globe")


def _flights(day: str, hours: int, max_age: "timedelta | None") -> "Scene":
    try:
        date = datetime.strptime(day, "%Y-%m-%d").date()
    except ValueError:
        raise ValueError(f"--day {day!r} is not a day such as {DEFAULT_DAY}") from None
    from .flights import Flights  # pandas and pyproj, which a CSV file does not need

    flights = Flights(date, hours)
    if max_age is None:
        return flights
    from .window import RecentPositions

    return RecentPositions(flights, max_age)
