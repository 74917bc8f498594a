"""`dynhull backup`, `dynhull restore`, `dynhull export`: data folders as files."""

import json
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from dynhull.arrays import Points

from .engine.stored import read_hull
from .progress import progress_bar
from .storage.sqlite import copies
from .storage.sqlite.errors import JournalError
from .storage.sqlite.folder import DATABASE

DATA = Path("dynhull-data")
ROWS_A_STEP = 100_000


def backup(
    target: Annotated[Path, typer.Argument(help="The folder to make.")],
    data: Annotated[Path, typer.Option(help="The data folder; a server may be running on it.")] = DATA,
) -> None:
    """Copy a data folder, consistently, while a server runs on it.

    The copy is a data folder itself: `dynhull serve --data COPY` serves it.
    """
    with _told(), progress_bar("pages") as progress:
        copies.back_up(data, target, progress)
    typer.echo(f"{target}: {len(copies.hulls(target))} hulls")


def restore(
    backup: Annotated[Path, typer.Argument(help="A backup.", exists=True, file_okay=False)],
    data: Annotated[Path, typer.Option(help="The data folder to make.")] = DATA,
) -> None:
    """Make a data folder from a backup, after every hull in it has been read and found whole."""
    with _told():
        if data.exists() and any(data.iterdir()):
            raise JournalError(f"{data} is not empty: move it away first, or name another folder with --data")
        rows = copies.hulls(backup)
        with progress_bar("hulls") as progress:
            for done, row in enumerate(rows):
                progress(done, len(rows))
                notes = copies.look(backup, row.number).notes
                if notes:
                    raise JournalError(f"{backup}, hull {row.name}: {notes[0]}")
        data.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(backup / DATABASE, data / DATABASE)
    typer.echo(f"{data}: {len(rows)} hulls")


def export(
    name: Annotated[str, typer.Argument(help="The hull.")],
    file: Annotated[Path, typer.Argument(help="What to write: .csv, .parquet or .geojson.", dir_okay=False)],
    data: Annotated[Path, typer.Option(help="The data folder or a backup; a server may be running on it.")] = DATA,
) -> None:
    """Write the points of one hull to a file, as of the last commit: columns x and y, a row a point."""
    writers = {".csv": _write_csv, ".parquet": _write_parquet, ".geojson": _write_geojson}
    with _told():
        if file.suffix not in writers:
            raise JournalError(f"{file}: the name must end in {', '.join(writers)}")
        hull = read_hull(data, name)
        for note in hull.notes:
            typer.echo(note, err=True)
        with progress_bar("points") as progress:
            writers[file.suffix](file, hull.points, progress)
    typer.echo(f"{file}: {len(hull.points):,} points of {name} at revision {hull.revision}")


def _write_csv(file: Path, points: Points, progress: copies.Progress) -> None:
    with file.open("w", encoding="utf-8") as out:
        out.write("x,y\n")
        for rows in _steps(points, progress):
            out.writelines(f"{x!r},{y!r}\n" for x, y in rows.tolist())


def _write_geojson(file: Path, points: Points, progress: copies.Progress) -> None:
    with file.open("w", encoding="utf-8") as out:
        out.write('{"type": "FeatureCollection", "features": [\n')
        between = ""
        for rows in _steps(points, progress):
            for x, y in rows.tolist():
                geometry = {"type": "Point", "coordinates": [x, y]}
                out.write(between + json.dumps({"type": "Feature", "properties": {}, "geometry": geometry}))
                between = ",\n"
        out.write("\n]}\n")


def _write_parquet(file: Path, points: Points, progress: copies.Progress) -> None:
    import pyarrow as pa  # takes a while to load, and only this format needs it
    import pyarrow.parquet as pq

    schema = pa.schema([("x", pa.float64()), ("y", pa.float64())])
    with pq.ParquetWriter(file, schema) as out:
        for rows in _steps(points, progress):
            out.write_table(pa.table({"x": np.ascontiguousarray(rows[:, 0]), "y": np.ascontiguousarray(rows[:, 1])}))


def _steps(points: Points, progress: copies.Progress) -> Iterator[Points]:
    for first in range(0, len(points), ROWS_A_STEP):
        progress(first, len(points))
        yield points[first : first + ROWS_A_STEP]


@contextmanager
def _told() -> Iterator[None]:
    """What cannot be done ends the command with a line."""
    try:
        yield
    except (JournalError, OSError) as error:
        sys.exit(f"error: {error}")
