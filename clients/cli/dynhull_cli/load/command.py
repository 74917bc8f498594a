"""The command: `dynhull load`."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from itertools import chain
from pathlib import Path
from time import monotonic
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from dynhull_client import Applied, DynhullError, HullClient, HullExistsError, Writer

from ..connected import connected
from .bad_rows import BadRows, open_bad_rows
from .chunks import Points, blocks
from .source import STANDARD_INPUT, Format, Source, open_source

BATCH_POINTS = 8192  # a part of the promise of --resume: the number of a batch says which points are in it


@connected
def load(
    client: HullClient,
    name: Annotated[str, typer.Argument(help="The hull; made where it is not there.")],
    file: Annotated[
        str, typer.Argument(help="What to read: .csv, .parquet, .geojson, .ndjson; - for standard input.")
    ] = STANDARD_INPUT,
    format: Annotated[Format | None, typer.Option(help="What it is. Default: by its name; of a pipe, csv.")] = None,  # noqa: A002
    x: Annotated[str | None, typer.Option(help="Column of x. Default: x, lon or longitude.")] = None,
    y: Annotated[str | None, typer.Option(help="Column of y. Default: y, lat or latitude.")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with a load of the same file that was interrupted.")
    ] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Add the points of a file that was loaded before once more.")
    ] = False,
    producer: Annotated[
        str | None, typer.Option(help="Name of the load, for --resume. Default: made from what is in the file.")
    ] = None,
    bad_rows: Annotated[
        Path | None, typer.Option(help="CSV file to write rows to that are no points.", dir_okay=False)
    ] = None,
    patience: Annotated[float, typer.Option(min=0, help="Seconds to wait for a server that went away.")] = 60.0,
    max_bad: Annotated[int | None, typer.Option(min=0, help="Stop at more bad rows than that. Default: never.")] = None,
) -> None:
    """Add the points of a file or a pipe to a hull, each exactly once.

        dynhull load places places.csv --x longitude --y latitude --bad-rows bad.csv

    Rows that are no points are counted, shown and left out. A load that was interrupted, by whatever it was, goes on
    where it stopped with --resume: nothing is lost and nothing comes twice. A file that was loaded before is refused
    unless --again says that its points are to be there once more. Memory does not grow with the file.
    """
    if resume and again:
        raise ValueError("--resume goes on with a load, --again begins another: give one")
    with (
        open_source(file, format, x, y) as source,
        open_bad_rows(bad_rows) as bad_file,
        closing(source.chunks()) as chunks,
    ):
        producer = producer or (None if again else _producer(source))
        if resume and producer is None:
            raise ValueError(f"{source.name} has no name to resume by: give --producer NAME, the same each time")
        bad = BadRows(bad_file, max_bad)
        batches = blocks(bad.left_out(chunks), BATCH_POINTS)
        first = next(batches, None)  # before there is a hull: the file may be none at all
        if first is None:
            raise ValueError("\n".join([f"{source.name} has no points", *bad.report()]))
        _make(client, name, silent=resume)
        writer = client.writer(
            name, producer=producer, batch_points=BATCH_POINTS, stop_on_error=True, patience=patience
        )
        with _progress(source) as told:
            loaded, acknowledged = _send(writer, chain([first], batches), resume, producer, told)
    for line in bad.report():
        typer.echo(line, err=True)
    held = "" if acknowledged is None else f", {acknowledged.points:,} in the hull"
    typer.echo(f"{name}: {loaded:,} points loaded{held}")


def _producer(source: Source) -> str | None:
    digest = source.digest()
    return None if digest is None else f"load-{digest[:32]}"


def _make(client: HullClient, name: str, *, silent: bool) -> None:
    try:
        client.create_hull(name)
    except HullExistsError as known:
        if not silent:
            typer.echo(f"{known}: adding to it", err=True)


def _send(
    writer: Writer, batches: Iterable[Points], resume: bool, producer: str | None, told: Callable[[int], None]
) -> tuple[int, Applied | None]:
    """Have each batch applied that was not before; how many points that were, and what the last one did."""
    loaded, outcome = 0, None
    with writer:
        known = writer.sequence
        if known and not resume:
            raise ValueError("loaded before, at least in part: --resume loads what is missing, --again all once more")
        try:
            for number, points in enumerate(batches, start=1):
                if number > known:
                    outcome = writer.put(insert=points)
                    loaded += len(points)
                told(len(points))
            writer.flush()
        except (KeyboardInterrupt, DynhullError, ValueError):
            if producer is not None:
                mended = f"where the file is mended first, with --producer {producer} too"
                typer.echo(
                    f"What was acknowledged is in. The same command with --resume loads the rest; {mended}.", err=True
                )
            raise
    return loaded, None if outcome is None else outcome.result()


@contextmanager
def _progress(source: Source) -> Iterator[Callable[[int], None]]:
    """A bar on a terminal's standard error, nothing elsewhere. Call with how many points have been read."""
    console = Console(stderr=True)
    columns = [
        BarColumn(),
        TextColumn("{task.fields[points]:,} points, {task.fields[rate]:,.0f} a second"),
        TimeRemainingColumn(),
    ]
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=source.size, points=0, rate=0)
        points, begun = 0, monotonic()

        def told(more: int) -> None:
            nonlocal points
            points += more
            rate = points / (monotonic() - begun)
            bar.update(task, completed=source.done(), points=points, rate=rate)

        yield told
