"""The command: `dynhull demo`."""

from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.text import Text

from dynhull_client import DynhullError, HullClient

from .replay import Step, replay
from .scene import Scene
from .server import server_process
from .table import Table

# Snow: the longest mean delay of the year, 180 flights cancelled.
DEFAULT_DAY = "2013-03-08"
MOST_CORNERS = 12


def demo(
    day: Annotated[
        datetime,
        typer.Option(
            formats=["%Y-%m-%d"],
            help="The day of 2013 to replay. 2013-03-08 had snow and the worst delays of the year.",
        ),
    ] = DEFAULT_DAY,  # type: ignore[assignment]  # typer reads the text
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
        str | None, typer.Option("--id", help="Column that identifies a point: a row with a known id moves its point.")
    ] = None,
    time: Annotated[str | None, typer.Option(help="Column to order by: one batch for each value.")] = None,
    batches: Annotated[int, typer.Option(min=1, help="Without --time: number of batches to cut the file into.")] = 100,
    out: Annotated[Path, typer.Option(dir_okay=False, help="PNG file to write the picture to.")] = Path(
        "dynhull-demo.png"
    ),
) -> None:
    """Replay real points through a real server and verify every step.

    The command starts a server of its own and streams one batch per minute of the day: each flight is deleted where it
    was and inserted where it is. A watcher follows. After every batch the command compares the live hull with Chan's
    static recomputation and with the watcher's copy. It ends with VERIFIED and exit code 0, or with the first
    difference and exit code 1.

    Your own points: dynhull demo --points fleet.csv --x lon --y lat --id vehicle --time minute
    """
    console = Console(highlight=False, soft_wrap=True)
    try:
        scene = _scene(day, points, x, y, identity, time, batches)
        verified = _show(console, scene, out)
    except (ValueError, OSError, RuntimeError, DynhullError) as error:
        message = Text.assemble(("error: ", "red"), str(error))
        Console(stderr=True, soft_wrap=True).print(message)
        raise typer.Exit(2) from None
    if not verified:
        raise typer.Exit(1)


def _show(console: Console, scene: Scene, out: Path) -> bool:
    """Replay a scene, print its milestones and draw the picture; returns whether every step agreed."""
    console.print(f"[bold]{scene.title}[/bold]")
    for note in scene.notes:
        console.print(note, markup=False)
    agreed = 0
    largest: Step | None = None
    difference = None
    columns = [BarColumn(), MofNCompleteColumn(), TextColumn(scene.step), TimeRemainingColumn()]
    with (
        server_process() as address,
        HullClient(address) as client,
        Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress,
    ):
        for step in progress.track(replay(client, scene), total=scene.length):
            if step.difference:
                difference = f"{step.frame.clock}: {step.difference}"
                break
            agreed += 1
            if largest is None or step.area > largest.area:
                largest = step
            if step.frame.milestone:
                console.print(_line(scene, step), markup=False)
    if largest and len(largest.vertices):
        from .picture import draw  # matplotlib takes a while to load, and only the end needs it

        draw(out, scene, largest.frame, largest.vertices, largest.area)
        console.print(f"Largest at {largest.frame.clock}: {largest.area:,.0f} {scene.area_unit}. Picture: {out}")
    console.print(f"Live hull compared with Chan's recomputation and with the watcher's copy: {agreed} {scene.step}")
    if difference:
        console.print(f"[red]DIFFERENT[/red] at {difference}")
        return False
    console.print(f"[green]VERIFIED {agreed}/{scene.length}[/green]")
    return True


def _scene(
    day: datetime,
    points: Path | None,
    x: str | None,
    y: str | None,
    identity: str | None,
    time: str | None,
    batches: int,
) -> Scene:
    if points is not None:
        return Table(points, x, y, identity, time, batches)
    from .flights import Flights  # pandas and pyproj, which a CSV file does not need

    return Flights(day.date())


def _line(scene: Scene, step: Step) -> str:
    names = step.frame.names_at(step.vertices)
    corners = ", ".join(names[:MOST_CORNERS]) + (
        f" and {len(names) - MOST_CORNERS} more" if len(names) > MOST_CORNERS else ""
    )
    return (
        f"{step.frame.clock:>5}  {len(step.frame.positions):>5,} {scene.counted}  {len(names):>3} vertices  "
        f"{step.area:>14,.0f} {scene.area_unit}  {corners}"
    )
