"""`dynhull backup`, `dynhull restore`, `dynhull check` and `dynhull export`: commands for data folders."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from dynhull.arrays import Points

from .progress import progress_bar
from .state.contents import replayed
from .storage.port import Progress, StorageError
from .storage.sqlite import copies

DATA = Path("dynhull-data")
ROWS_A_STEP = 100_000


def backup(
    target: Annotated[Path, typer.Argument(help="The folder to create.")],
    data: Annotated[Path, typer.Option(help="The data folder; a server may be using it.")] = DATA,
) -> None:
    """Copy a data folder consistently, also while a server uses it.

    The copy is examined in full. It is a data folder itself, so `dynhull serve --data COPY` serves it. A copy that was
    interrupted is refused by all commands.
    """
    _copy(data, target)


def restore(
    backup: Annotated[Path, typer.Argument(help="A backup, or any data folder.", exists=True, file_okay=False)],
    data: Annotated[Path, typer.Option(help="The data folder to create.")] = DATA,
    accept_loss: Annotated[
        bool, typer.Option(help="If the log is missing or damaged, continue without the commits in it.")
    ] = False,
) -> None:
    """Create a data folder from a backup, after checking that every hull in it is intact."""
    _copy(backup, data, accept_loss=accept_loss)


def check(
    data: Annotated[Path, typer.Argument(help="A data folder or a backup; a server may be using it.")] = DATA,
) -> None:
    """Examine a data folder or a backup, and report on each hull. Nothing is changed.

    All batches and snapshots are compared with their checksums, also those that the next start would not need. While a
    server uses the folder, the data committed at one moment is examined, but not the log.

    The exit code is 0 if everything is intact, and 1 if anything is damaged or cannot be read:

        dynhull check backups/monday && echo "can be restored"
    """
    with _errors_reported(), progress_bar("rows") as progress:
        report = copies.check(data, progress)
    for hull in report.hulls:
        typer.echo(f"{hull.name}: {hull.summary}: {'whole' if hull.whole else 'DAMAGED'}")
    for problem in [*report.notes, *report.fatal]:
        typer.echo(problem, err=True)
    if report.fatal:
        typer.echo(f"{data}: damaged; it cannot be served: restore a backup")
    elif report.notes:
        typer.echo(f"{data}: damaged; it can be served without the parts named above")
    else:
        typer.echo(f"{data}: {len(report.hulls)} hulls, all whole")
    raise typer.Exit(1 if report.fatal or report.notes else 0)


def export(
    name: Annotated[str, typer.Argument(help="The hull.")],
    file: Annotated[Path, typer.Argument(help="The file to write: .csv, .parquet or .geojson.", dir_okay=False)],
    data: Annotated[Path, typer.Option(help="The data folder or a backup; a server may be using it.")] = DATA,
) -> None:
    """Write the points of one hull, as of the last commit, to a file with columns x and y."""
    writers = {".csv": _write_csv, ".parquet": _write_parquet, ".geojson": _write_geojson}
    with _errors_reported():
        if file.suffix not in writers:
            raise StorageError(f"{file}: the name must end in {', '.join(writers)}")
        kept, notes = copies.read(data, name)
        for note in notes:
            typer.echo(note, err=True)
        points = replayed(kept).hull.points()
        with progress_bar("points") as progress:
            writers[file.suffix](file, points, progress)
    typer.echo(f"{file}: {len(points):,} points of {name} at revision {kept.last_revision}")


def _copy(source: Path, target: Path, *, accept_loss: bool = False) -> None:
    with _errors_reported(), progress_bar("pages") as progress:
        report = copies.copy(source, target, progress, accept_loss=accept_loss)
    for note in report.notes:
        typer.echo(note, err=True)
    typer.echo(f"{target}: {len(report.hulls)} hulls")


def _write_csv(file: Path, points: Points, progress: Progress) -> None:
    with file.open("w", encoding="utf-8") as out:
        out.write("x,y\n")
        for rows in _steps(points, progress):
            out.writelines(f"{x!r},{y!r}\n" for x, y in rows.tolist())


def _write_geojson(file: Path, points: Points, progress: Progress) -> None:
    with file.open("w", encoding="utf-8") as out:
        out.write('{"type": "FeatureCollection", "features": [\n')
        between = ""
        for rows in _steps(points, progress):
            for x, y in rows.tolist():
                geometry = {"type": "Point", "coordinates": [x, y]}
                out.write(between + json.dumps({"type": "Feature", "properties": {}, "geometry": geometry}))
                between = ",\n"
        out.write("\n]}\n")


def _write_parquet(file: Path, points: Points, progress: Progress) -> None:
    import pyarrow as pa  # slow to load, and only this format needs it
    import pyarrow.parquet as pq

    schema = pa.schema([("x", pa.float64()), ("y", pa.float64())])
    with pq.ParquetWriter(file, schema) as out:
        for rows in _steps(points, progress):
            out.write_table(pa.table({"x": np.ascontiguousarray(rows[:, 0]), "y": np.ascontiguousarray(rows[:, 1])}))


def _steps(points: Points, progress: Progress) -> Iterator[Points]:
    for first in range(0, len(points), ROWS_A_STEP):
        progress(first, len(points))
        yield points[first : first + ROWS_A_STEP]


@contextmanager
def _errors_reported() -> Iterator[None]:
    """Exit with a message after an error of the storage or the operating system."""
    try:
        yield
    except (StorageError, OSError) as error:
        sys.exit(f"error: {error}")
