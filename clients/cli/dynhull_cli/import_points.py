"""`dynhull import`: the points of a file into a hull of a running server."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from dynhull_client import DynhullError, HullClient, HullExistsError

from .csv_points import read_points

BATCH_POINTS = 8192

Points = npt.NDArray[np.float64]


def import_points(
    name: Annotated[str, typer.Argument(help="The hull; made where it is not there.")],
    file: Annotated[
        Path, typer.Argument(help="What to read: .csv, .parquet or .geojson.", exists=True, dir_okay=False)
    ],
    address: Annotated[str, typer.Option(help="The server.")] = "127.0.0.1:50051",
    x: Annotated[str | None, typer.Option(help="Column of x. Default: x, lon or longitude.")] = None,
    y: Annotated[str | None, typer.Option(help="Column of y. Default: y, lat or latitude.")] = None,
) -> None:
    """Add the points of a file to a hull, in batches. The other way: dynhull export."""
    try:
        points, notes = _reader(file)(file, x, y)
        for note in notes:
            typer.echo(note, err=True)
        with HullClient(address) as client:
            summary = _send(client, name, points)
    except (DynhullError, ValueError, TypeError, OSError) as error:
        sys.exit(f"error: {error}")
    typer.echo(f"{name}: {summary} points at the end")


def _send(client: HullClient, name: str, points: Points) -> int:
    """Stream the points; returns how many the hull has then."""
    try:
        client.create_hull(name)
    except HullExistsError as known:
        typer.echo(f"{known}: adding to it", err=True)
    console = Console(stderr=True)
    columns = [BarColumn(), MofNCompleteColumn(), TextColumn("points"), TimeRemainingColumn()]
    with (
        Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress,
        client.ingest(name) as stream,
    ):
        task = progress.add_task("", total=len(points))
        for first in range(0, len(points), BATCH_POINTS):
            stream.apply(insert=points[first : first + BATCH_POINTS])
            progress.advance(task, BATCH_POINTS)
    assert stream.summary is not None  # the context was left without an error
    return stream.summary.points


def _reader(file: Path) -> Callable[[Path, str | None, str | None], tuple[Points, list[str]]]:
    readers = {".csv": _read_csv, ".parquet": _read_parquet, ".geojson": _read_geojson}
    if file.suffix not in readers:
        raise ValueError(f"{file}: the name must end in {', '.join(readers)}")
    return readers[file.suffix]


def _read_csv(file: Path, x: str | None, y: str | None) -> tuple[Points, list[str]]:
    rows, notes = read_points(file, x, y)
    return np.array([position for _, _, position in rows]), notes


def _read_parquet(file: Path, x: str | None, y: str | None) -> tuple[Points, list[str]]:
    import pyarrow.parquet as pq  # takes a while to load, and only this format needs it

    columns = [x or "x", y or "y"]
    there = pq.read_schema(file).names
    for option, column in zip(("--x", "--y"), columns, strict=True):
        if column not in there:
            raise ValueError(f"{file} has no column {column!r} ({option}); it has {', '.join(there)}")
    table = pq.read_table(file, columns=columns)
    return np.stack([table[column].to_numpy() for column in columns], axis=1), []


def _read_geojson(file: Path, _x: str | None, _y: str | None) -> tuple[Points, list[str]]:
    collection = json.loads(file.read_text("utf-8"))
    rows, others = [], 0
    for feature in collection.get("features", []):
        geometry = feature.get("geometry") or {}
        if geometry.get("type") == "Point":
            rows.append(geometry["coordinates"][:2])
        else:
            others += 1
    notes = [f"{others} features left out that are no points"] if others else []
    if not rows:
        raise ValueError(f"{file} has no points: it must be a FeatureCollection of Point features")
    return np.array(rows, dtype=np.float64), notes
