"""The command: `dynhull load`."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from itertools import chain
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from ..connected import AsJson, connected
from ..json_lines import json_line
from ..plural import plural
from .bad_rows import BadRows, open_bad_rows
from .chunks import Points, blocks
from .source import STANDARD_INPUT, Format, Options, Source, open_source

if TYPE_CHECKING:
    from dynhull_client import Applied, HullClient, Writer

BATCH_POINTS = 8192  # part of the promise of --resume: the number of a batch says which points are in it


def _input(text: str, *names: str, **more: Any) -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Input", **more)


@connected
def load(
    client: "HullClient",
    name: Annotated[str, typer.Argument(metavar="HULL", help="Name of the hull; created if there is none.")],
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="A .csv, .tsv, .txt, .parquet, .json, .geojson or .ndjson file; - for standard input.",
        ),
    ] = STANDARD_INPUT,
    format: Annotated[  # noqa: A002
        Format | None, _input("Format. Default: by the name of the file; csv for standard input.")
    ] = None,
    x: Annotated[
        str | None,
        _input("Column of x, by name or by number from 1. Default: x, lon, lng, long, longitude or easting."),
    ] = None,
    y: Annotated[str | None, _input("Column of y. Default: y, lat, latitude or northing.")] = None,
    delimiter: Annotated[
        str | None, _input("Character between the columns of CSV, or tab or space. Default: found in the first line.")
    ] = None,
    decimal: Annotated[
        str | None,
        _input(
            "Decimal mark of CSV. Default: a point; a comma if the numbers have one and no comma separates columns."
        ),
    ] = None,
    header: Annotated[
        bool | None,
        _input(
            "Whether the first row of CSV names the columns. Default: yes, unless it has numbers.", show_default=False
        ),
    ] = None,
    encoding: Annotated[
        str | None, _input("Encoding of CSV. Default: UTF-8, or UTF-16 with a byte order mark.")
    ] = None,
    vertices: Annotated[
        bool,
        _input("Take the vertices of lines, polygons and Multi-geometries as points.", "--vertices"),
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Read everything and report it. Needs no server and changes nothing.")
    ] = False,
    replace: Annotated[
        bool, typer.Option("--replace", help="Delete the hull first, once all of the file has been read without error.")
    ] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted load of the same file.")] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Add the points of a file once more that was loaded before.")
    ] = False,
    producer: Annotated[
        str | None, typer.Option(help="Name of the load, for --resume. Default: made from the contents of the file.")
    ] = None,
    bad_rows: Annotated[Path | None, typer.Option(help="CSV file to write the bad rows to.", dir_okay=False)] = None,
    max_bad: Annotated[
        int | None, typer.Option(min=0, help="Stop if there are more bad rows than this. Default: never.")
    ] = None,
    patience: Annotated[float, typer.Option(min=0, help="Seconds to wait for a server that went away.")] = 60.0,
    as_json: AsJson = False,
) -> None:
    """Add the points of a file or a pipe to a hull, each exactly once.

        dynhull load places places.csv.gz --x longitude --y latitude --bad-rows bad.csv

    Files may be compressed with gzip. Rows that are not points are counted, shown and left out. After an interruption
    of any kind, --resume continues where the load stopped: no point is lost, none is added twice. A file that was
    loaded before is refused unless --again or --replace is given. Memory does not grow with the file.

    While --replace loads, readers see the hull without points, then with a part of them.
    """
    _check(decimal, replace=replace, resume=resume, again=again)
    options = Options(x, y, delimiter, decimal, header, encoding, vertices)
    with open_source(file, format, options) as source, open_bad_rows(bad_rows) as bad_file:
        bad = BadRows(bad_file, max_bad)
        if dry_run:
            _report_reading(name, source, bad, as_json)
            return
        if replace:
            if source.size is None:
                raise ValueError(
                    f"--replace reads its input twice, and {source.name} is a pipe: write it to a file first"
                )
            _read_through(source, BadRows(None, max_bad))
            source.rewind()
        producer = producer or (None if again else _producer(source))
        if resume and producer is None:
            raise ValueError(f"{source.name} has no name to resume by: give --producer NAME, the same each time")
        with closing(source.chunks()) as chunks:
            batches = blocks(bad.left_out(chunks), BATCH_POINTS)
            first = next(batches, None)  # before the hull is created: there may be no points at all
            if first is None:
                raise ValueError(_no_points(source, bad))
            _print_notes(source.notes)
            _make(client, name, silent=resume, replace=replace)
            writer = client.writer(
                name, producer=producer, batch_points=BATCH_POINTS, stop_on_error=True, patience=patience
            )
            with (
                _resumable("--resume in place of --replace" if replace else "--resume", producer),
                _progress(source) as read,
            ):
                loaded, acknowledged = _send(writer, chain([first], batches), resume, read)
    _print_notes(bad.report())
    points = None if acknowledged is None else acknowledged.points
    if as_json:
        typer.echo(json_line(name=name, loaded=loaded, bad_rows=bad.count, points=points))
    else:
        typer.echo(
            f"{name}: {plural(loaded, 'point')} loaded" + ("" if points is None else f", {points:,} in the hull")
        )


def _check(decimal: str | None, *, replace: bool, resume: bool, again: bool) -> None:
    if replace + resume + again > 1:
        raise ValueError("--resume continues a load, --again and --replace begin another: give one of them")
    if decimal not in (None, ".", ","):
        raise ValueError(f"--decimal {decimal!r} is neither . nor ,")


def _read_through(source: Source, bad: BadRows) -> tuple[int, Points]:
    """The number of points, and the least and the greatest x and y; ValueError where the input is unusable."""
    count = 0
    corners = np.array([[np.inf, np.inf], [-np.inf, -np.inf]])
    with closing(source.chunks()) as chunks, _progress(source) as read:
        for points in bad.left_out(chunks):
            count += len(points)
            read(len(points))
            if len(points):
                corners = np.array([np.minimum(corners[0], points.min(0)), np.maximum(corners[1], points.max(0))])
    if not count:
        raise ValueError(_no_points(source, bad))
    return count, corners


def _report_reading(name: str, source: Source, bad: BadRows, as_json: bool) -> None:
    count, corners = _read_through(source, bad)
    _print_notes([*source.notes, *bad.report()])
    if as_json:
        typer.echo(json_line(name=name, points=count, bad_rows=bad.count, bounds=corners.ravel()))
    else:
        (left, bottom), (right, top) = corners.tolist()
        where = f"x from {left} to {right}, y from {bottom} to {top}"
        typer.echo(f"{name}: {plural(count, 'point')} would be loaded, {where}; nothing was changed")


def _no_points(source: Source, bad: BadRows) -> str:
    return "\n".join([f"{source.name} has no points", *source.notes, *bad.report()])


def _print_notes(notes: Iterable[str]) -> None:
    for note in notes:
        typer.echo(note, err=True)


def _producer(source: Source) -> str | None:
    digest = source.digest()
    return None if digest is None else f"load-{digest[:32]}"


def _make(client: "HullClient", name: str, *, silent: bool, replace: bool) -> None:
    from dynhull_client import HullExistsError, HullNotFoundError

    if replace:
        try:
            client.delete_hull(name)
        except HullNotFoundError:
            typer.echo(f"there is no hull {name!r} to replace: creating it", err=True)
    try:
        client.create_hull(name)
    except HullExistsError as known:
        if not silent:
            typer.echo(f"{known}: adding to it", err=True)


def _send(
    writer: "Writer", batches: Iterable[Points], resume: bool, read: Callable[[int], None]
) -> "tuple[int, Applied | None]":
    """Send each batch that was not applied before; the number of points sent, and what the last batch did."""
    loaded, outcome = 0, None
    with writer:
        known = writer.sequence
        if known and not resume:
            raise LoadedBeforeError(
                "loaded before, at least in part: --resume loads what is missing, --again all points once more, "
                "--replace deletes the hull first"
            )
        for number, points in enumerate(batches, start=1):
            if number > known:
                outcome = writer.put(insert=points)
                loaded += len(points)
            read(len(points))
        writer.flush()
    return loaded, None if outcome is None else outcome.result()


class LoadedBeforeError(ValueError):
    """The hull has batches of this load already."""


@contextmanager
def _resumable(option: str, producer: str | None) -> Iterator[None]:
    """Where a load with a name is interrupted, say how to continue it."""
    from dynhull_client import DynhullError

    try:
        yield
    except LoadedBeforeError:
        raise
    except (KeyboardInterrupt, DynhullError, ValueError):
        if producer is not None:
            typer.echo(
                f"The points acknowledged so far are in the hull. The same command with {option} loads the rest; "
                f"if you correct the file first, add --producer {producer}.",
                err=True,
            )
        raise


@contextmanager
def _progress(source: Source) -> Iterator[Callable[[int], None]]:
    """A bar on a terminal's standard error, nothing elsewhere. Call with the number of points read since then."""
    console = Console(stderr=True)
    columns = [
        BarColumn(),
        TextColumn("{task.fields[points]:,} points, {task.fields[rate]:,.0f} per second"),
        TimeRemainingColumn(),
    ]
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=source.size, points=0, rate=0)
        points, begun = 0, monotonic()

        def read(more: int) -> None:
            nonlocal points
            points += more
            rate = points / (monotonic() - begun)
            bar.update(task, completed=source.done(), points=points, rate=rate)

        yield read
