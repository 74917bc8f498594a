"""What the commands for data folders do: copy, check and export, with a progress bar and errors as messages."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import typer

from dynhull.arrays import Points

from .failure import code_of, fail, text_of
from .progress import progress_bar
from .state.hull_state import replayed
from .storage.port import Progress, StorageError
from .storage.sqlite import copies

ROWS_A_STEP = 100_000


def copy_folder(source: Path, target: Path, *, accept_loss: bool = False) -> None:
    """Copy a data folder, and print what was lost and how many hulls it has."""
    with _errors_reported(), progress_bar("pages") as progress:
        report = copies.copy(source, target, progress, accept_loss=accept_loss)
    for note in report.notes:
        typer.echo(note, err=True)
    typer.echo(f"{target}: {_hulls(report)}")


def check_folder(data: Path) -> bool:
    """Examine a data folder and print a report; returns whether everything is intact."""
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
        typer.echo(f"{data}: {_hulls(report)}, all whole")
    return not report.fatal and not report.notes


def _hulls(report: copies.Report) -> str:
    return "1 hull" if len(report.hulls) == 1 else f"{len(report.hulls):,} hulls"


def export_hull(data: Path, name: str, file: Path) -> None:
    """Write the points of a hull to a file, in the format of its suffix."""
    writers = {".csv": _write_csv, ".parquet": _write_parquet, ".geojson": _write_geojson}
    if file.suffix not in writers:
        fail(f"{file}: the name must end in {', '.join(writers)}")
    with _errors_reported():
        kept, notes = copies.read(data, name)
        for note in notes:
            typer.echo(note, err=True)
        points = replayed(kept).points()
        with progress_bar("points") as progress:
            writers[file.suffix](file, points, progress)
    typer.echo(f"{file}: {len(points):,} points of {name} at revision {kept.last_revision}")


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
        fail(text_of(error), code_of(error))
