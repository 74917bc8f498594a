"""The command: `dynhull explain`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..csv_points import read_points
from .page import write_page
from .picture import draw_animation, draw_sheet
from .steps import explained

WRITERS = {".png": draw_sheet, ".gif": draw_animation, ".html": write_page}


class Algorithm(StrEnum):
    """The static algorithms that leave a trace."""

    GRAHAM_SCAN = "graham_scan"
    JARVIS_MARCH = "jarvis_march"
    CHAN = "chan"
    MONOTONE_CHAIN = "monotone_chain"


class Boundary(StrEnum):
    """What becomes of points on the boundary that are no vertices."""

    DROP = "drop"
    KEEP = "keep"


def explain(
    algorithm: Annotated[Algorithm, typer.Argument(help="The algorithm.")],
    points: Annotated[Path, typer.Argument(metavar="FILE.csv", exists=True, dir_okay=False, help="Points, one a row.")],
    out: Annotated[
        Path, typer.Option(dir_okay=False, help="The file to write: .png (a sheet), .gif (an animation) or .html.")
    ] = Path("dynhull-explain.html"),
    x: Annotated[str | None, typer.Option(help="Column of x. Default: x, lon or longitude.")] = None,
    y: Annotated[str | None, typer.Option(help="Column of y. Default: y, lat or latitude.")] = None,
    collinear: Annotated[Boundary, typer.Option(help="Boundary points that are no vertices.")] = Boundary.DROP,
) -> None:
    """Draw, step by step, how an algorithm finds a hull: its chain, the turn it looks at, the points it discards.

    A sheet has room for 40 steps, an animation for 300, a page for 2000; of more, an even choice is drawn.
    """
    try:
        write = WRITERS[out.suffix.lower()]
    except KeyError:
        typer.echo(f"error: --out {out}: the name must end in .png, .gif or .html", err=True)
        raise typer.Exit(2) from None
    try:
        rows, notes = read_points(points, x, y)
        xy = [position for _, _, position in rows]
        steps = explained(algorithm.value, xy, collinear.value)
        drawn = write(out, f"{algorithm.value}: {points.name}", list(dict.fromkeys(xy)), steps)
    except (ValueError, OSError) as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(2) from None
    for note in notes:
        typer.echo(note)
    left_out = "" if drawn == len(steps) else f", {drawn:,} of them drawn"
    typer.echo(f"{len(steps[-1].hull):,} vertices, {len(steps):,} steps{left_out}: {out}")
