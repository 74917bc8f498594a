"""The command: `dynhull explain`."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..out_file import check_out

if TYPE_CHECKING:
    from collections.abc import Callable

    from .scene import Point, Story

TREE = "tree"
ALGORITHMS = ("graham_scan", "jarvis_march", "chan", "monotone_chain", TREE)
SUFFIXES = (".html", ".png", ".svg", ".gif")
EXAMPLE: "list[Point]" = [(7, 3), (13, 8), (2, 9), (10, 1), (0, 4), (12, 5), (4, 2), (15, 6), (9, 7), (5, 6)]
EXAMPLE += [(14, 2), (3, 5), (8, 9.5), (1, 6), (11, 4), (6, 0)]


class Boundary(StrEnum):
    """Whether the hull keeps points on the boundary that are not vertices."""

    DROP = "drop"
    KEEP = "keep"


def explain(
    algorithm: Annotated[
        str,
        typer.Argument(
            metavar="ALGORITHM",
            help=f"{', '.join(ALGORITHMS[:-1])} or {ALGORITHMS[-1]}; the beginning of a name is enough.",
            autocompletion=lambda: list(ALGORITHMS),
        ),
    ],
    points: Annotated[
        Path | None,
        typer.Argument(metavar="FILE.csv", exists=True, dir_okay=False, help="Points, one a row. Default: 16 points."),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            dir_okay=False,
            help="The file to write: .html (a page to step through), .png or .svg (a sheet) or .gif (an animation).",
        ),
    ] = Path("dynhull-explain.html"),
    x: Annotated[
        str | None, typer.Option(help="Column of x. Default: x, lon, lng, long, longitude or easting.")
    ] = None,
    y: Annotated[str | None, typer.Option(help="Column of y. Default: y, lat, latitude or northing.")] = None,
    collinear: Annotated[
        Boundary, typer.Option(help="Boundary points that are not vertices; a static algorithm only.")
    ] = Boundary.DROP,
) -> None:
    """Draw, step by step, how an algorithm finds a hull, or how the dynamic tree keeps one.

    Static algorithms: the chain, the turn being tested, the points discarded. Tree: three quarters of the points are
    in the tree at first; then each further point is inserted and the oldest one deleted, with the nodes visited and
    the bridges searched anew. Its leaves hold up to 4 points here, so that a few points make a tree.

    A sheet has room for 40 steps, an animation for 300, a page for 2000; if there are more, an even choice is drawn.
    A static algorithm takes up to 2000 points, the tree 200.
    """
    try:
        algorithm, write = _full_name(algorithm), _writer(out)
        rows, notes = (EXAMPLE, []) if points is None else _read(points, x, y)
        name = "example" if points is None else points.name
        story = _story(algorithm, name, rows, collinear)
        drawn = write(out, story)
    except (ValueError, OSError) as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(2) from None
    for note in notes:
        typer.echo(note)
    left_out = "" if drawn == len(story.pictures) else f", {drawn:,} of them drawn"
    typer.echo(f"{story.result}, {len(story.pictures):,} steps{left_out}: {out}")


def _full_name(beginning: str) -> str:
    """The one algorithm whose name begins like this."""
    found = [name for name in ALGORITHMS if name.startswith(beginning)]
    if len(found) != 1:
        raise ValueError(f"{beginning}: not an algorithm; choose {', '.join(ALGORITHMS[:-1])} or {ALGORITHMS[-1]}")
    return found[0]


def _read(path: Path, x: str | None, y: str | None) -> "tuple[list[Point], list[str]]":
    from ..csv_points import read_points

    file = read_points(path, x, y)
    return [position for _, _, position in file.rows], file.notes


def _story(algorithm: str, name: str, points: "list[Point]", collinear: Boundary) -> "Story":
    if algorithm != TREE:
        from .static_scene import static_story

        return static_story(algorithm, name, points, collinear.value)
    if collinear is not Boundary.DROP:
        raise ValueError("--collinear keep: the tree keeps vertices only")
    from .tree_scene import tree_story

    return tree_story(name, points)


def _writer(path: Path) -> "Callable[[Path, Story], int]":
    """The function that writes a file with this suffix and returns the number of steps in it."""
    check_out(path, SUFFIXES)
    suffix = path.suffix.lower()
    if suffix == ".html":
        from .page import write_page

        return write_page
    from .picture import draw_animation, draw_sheet  # matplotlib takes a second to import

    return draw_animation if suffix == ".gif" else draw_sheet
