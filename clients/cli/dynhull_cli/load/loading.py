"""Reads the points of an input and sends them to a hull, each exactly once."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from itertools import chain
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from dynhull_client import (
    DeadlineError,
    DynhullError,
    HullClient,
    HullExistsError,
    HullNotFoundError,
    RestoredError,
    UnavailableError,
)

from ..json_lines import json_line
from ..keyed_rows import known_hull
from ..plural import plural
from ..reading.columns import are_degrees, look_like_degrees, say_plane
from .bad_rows import BadRows
from .chunks import Chunk, Points, Rows, blocks
from .refusals import Expected
from .sending import LoadedBeforeError, Sending
from .source import Source

if TYPE_CHECKING:
    from dynhull.keys import KeyType
    from dynhull_client import HullInfo

BATCH_POINTS = 8192  # part of the promise of --resume: the number of a batch says which points are in it
ANSWER = 1.0  # seconds
PRODUCER_DIGITS = 32  # of the file's digest


def report_reading(name: str, source: Source, bad: BadRows, expected: Callable[[], Expected], as_json: bool) -> None:
    """Read the input to its end and print what a load would add; ValueError where the input is unusable.

    `expected`, called once there are points, is what the server would refuse.
    """
    count, corners = _read_through(source, bad, expected)
    _print_notes([*source.notes, *bad.report()])
    if as_json:
        typer.echo(json_line(name=name, points=count, bad_rows=bad.count, bounds=corners.ravel()))
    else:
        (left, bottom), (right, top) = corners.tolist()
        where = f"x from {left} to {right}, y from {bottom} to {top}"
        typer.echo(f"{name}: {plural(count, 'point')} would be loaded, {where}; nothing was changed")


def hull_if_served(client: HullClient, name: str) -> "HullInfo | None":
    """The hull; None if there is no such hull, or no server that answers at once, which is said."""
    try:
        return known_hull(client, name, timeout=ANSWER)
    except DynhullError as error:
        away = isinstance(error, UnavailableError | DeadlineError)
        _print_notes([f"{f'no answer from {client.address}' if away else error}: read as for a new hull"])
        return None


def require_readable(source: Source, max_bad: int | None, expected: Callable[[], Expected]) -> None:
    """Read the input to its end and rewind it; ValueError where it is unusable or can be read only once."""
    if source.size is None:
        raise ValueError(f"--replace reads its input twice, and {source.name} is a pipe: write it to a file first")
    _read_through(source, BadRows(source.name, None, max_bad), expected)
    source.rewind()


def producer_name(source: Source) -> str | None:
    """The name of the load of a file, made from its contents and the options; None for a pipe."""
    digest = source.digest()
    return None if digest is None else f"load-{digest[:PRODUCER_DIGITS]}"


def load_points(
    client: HullClient,
    name: str,
    source: Source,
    bad: BadRows,
    producer: str | None,
    patience: float,
    *,
    known: "Callable[[], HullInfo | None]",
    geographic: bool | None,
    resume: bool,
    replace: bool,
    conditions: Mapping[str, Any],
) -> Sending:
    """Create the hull where it is missing, and add the points that earlier runs of the same load did not add.

    A new hull is geographic if `geographic` says so or, without it, if the input does. `known` returns the hull that
    was there before, None without one. `conditions`: which keys are put, and when they leave.

    Returns:
        What became of the rows.

    Raises:
        ValueError: the input is unusable, or was loaded before.
        DynhullError: the server refused a request or did not answer.
    """
    with closing(source.chunks()) as chunks:
        batches = _batches(chunks, bad)
        first = next(batches, None)  # before the hull is created: there may be no points at all
        if first is None:
            raise ValueError(_no_points(source, bad))
        _print_notes(source.notes)
        _make(client, name, source, known, geographic, silent=resume, replace=replace)
        if not resume:
            _print_notes(_doubts(name, source, first.points, geographic, known))
        sending = Sending(client, name, producer, patience, resume=resume, bad=bad, conditions=conditions)
        with (
            _resumable("--resume in place of --replace" if replace else "--resume", producer),
            _progress(source) as read,
        ):
            sending.run(chain([first], batches), read)
    if not sending.rows and not sending.known:  # all rows were refused
        raise ValueError(_no_points(source, bad))
    _print_notes(bad.report())
    return sending


def _read_through(source: Source, bad: BadRows, expected: Callable[[], Expected]) -> tuple[int, Points]:
    """Returns the number of points, and the least and the greatest x and y; ValueError where the input is unusable."""
    count = 0
    corners = np.array([[np.inf, np.inf], [-np.inf, -np.inf]])
    refusals: Expected | None = None
    with closing(source.chunks()) as chunks, _progress(source) as read:
        for rows in _batches(chunks, bad):
            read(len(rows))
            refusals = refusals or expected()
            refused = refusals.refused(rows)
            bad.add([rows.bad(row, refused[row]) for row in sorted(refused)])
            points = rows.without(refused).points
            count += len(points)
            if len(points):
                corners = np.array([np.minimum(corners[0], points.min(0)), np.maximum(corners[1], points.max(0))])
    if not count:
        raise ValueError(_no_points(source, bad))
    return count, corners


def _batches(chunks: Iterable[Chunk], bad: BadRows) -> Iterator[Rows]:
    """The good rows as they are sent."""
    return filter(len, chain.from_iterable(map(Rows.by_expiry, blocks(bad.left_out(chunks), BATCH_POINTS))))


def _no_points(source: Source, bad: BadRows) -> str:
    return "\n".join([f"{source.name} has no points", *source.notes, *bad.report()])


def _print_notes(notes: Iterable[str]) -> None:
    for note in notes:
        typer.echo(note, err=True)


def _make(
    client: HullClient,
    name: str,
    source: Source,
    known: "Callable[[], HullInfo | None]",
    geographic: bool | None,
    *,
    silent: bool,
    replace: bool,
) -> None:
    """Create the hull unless it exists."""
    keyed: KeyType | None = None
    if source.options.key is not None:
        keyed = "int" if source.integer_keys else "str"
    if replace:
        try:
            client.delete_hull(name)
        except HullNotFoundError:
            typer.echo(f"there is no hull {name!r} to replace: creating it", err=True)
    on_globe = source.degrees if geographic is None else geographic
    try:
        client.create_hull(name, keyed=keyed, geographic=on_globe)
    except HullExistsError as error:
        if not silent:
            typer.echo(f"{error}: adding to it", err=True)
        info = known() or client.get_hull(name).info
        _check_frame(info, source, geographic)
        return
    if on_globe:
        what = " and ".join(source.axes) or "x and y"
        typer.echo(f"{name}: a new hull on the globe: {what} are degrees; --plane makes it a plane", err=True)
    elif source.degrees:
        typer.echo(
            f"{name}: a new hull in the plane, in square degrees; --geographic makes it one on the globe", err=True
        )


def _check_frame(info: "HullInfo", source: Source, geographic: bool | None) -> None:
    """Warn if degrees go into a plane; ValueError if the existing hull is not what was asked for."""
    if geographic is not None and geographic != info.geographic:
        kind, option = ("geographic", "--plane") if info.geographic else ("a plane", "--geographic")
        raise ValueError(f"the hull {info.name!r} is {kind}: leave out {option}, or load into another hull")
    if source.degrees and not info.geographic:
        typer.echo(
            f"{info.name} is a plane: it takes {' and '.join(source.axes)} for x and y, and has square degrees. "
            "`dynhull create NAME --geographic` makes a hull on the globe",
            err=True,
        )


def _doubts(
    name: str,
    source: Source,
    points: Points,
    geographic: bool | None,
    known: "Callable[[], HullInfo | None]",
) -> Iterator[str]:
    """Lines about points that may be no x and y, by the names of their columns or by the first ones."""
    x, y = source.axes or ("", "")
    if are_degrees(y, x):
        yield f"{name} takes {x} for x and {y} for y: the longitude comes first"
        return
    info = known()
    says = source.degrees or say_plane(x, y) or source.elsewhere or geographic is not None
    if not says and (info is None or not info.geographic) and look_like_degrees(points):
        yield (
            f"{name} is a plane, and its points look like longitudes and latitudes: if they are, --replace "
            "--geographic loads them as places on the globe, and --plane says that they are not"
        )


@contextmanager
def _resumable(option: str, producer: str | None) -> Iterator[None]:
    """When a load with a name is interrupted, print how to continue it."""
    try:
        yield
    except LoadedBeforeError:
        raise
    except (KeyboardInterrupt, DynhullError, ValueError) as error:
        if producer is not None:
            there = "The points acknowledged so far are in the hull"
            if isinstance(error, RestoredError):
                there = "Of the points acknowledged so far, the hull lacks some"
            typer.echo(
                f"{there}. The same command with {option} loads the rest; "
                f"if you correct the file or an option first, add --producer {producer}.",
                err=True,
            )
        raise


@contextmanager
def _progress(source: Source) -> Iterator[Callable[[int], None]]:
    """A bar on standard error, if it is a terminal. Call it with the number of points read since the last call."""
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
