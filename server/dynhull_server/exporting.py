"""What `dynhull export` does, whether a folder or a server has the hull."""

from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import typer

from dynhull_cli.plural import plural

from .exports import WRITERS, complete_file
from .failure import fail
from .progress import progress_bar
from .state.records import Contents

if TYPE_CHECKING:
    from dynhull_client import HullClient, Stored


def require_format(file: Path) -> None:
    """End the command unless files with this name can be written."""
    if file.suffix not in WRITERS:
        fail(f"{file}: the name must end in {', '.join(WRITERS)}")


def export_served(client: "HullClient", name: str, file: Path) -> None:
    """Write the points of a hull of a server to a file; in memory is a part of them at a time."""
    require_format(file)
    following = client.read_points(name)
    first = next(following)
    info = first.info
    parts = map(_contents, chain([first], following))
    write_export(file, parts, info.points, geographic=info.geographic)
    exported(file, name, info.points, info.revision)


def write_export(file: Path, parts: Iterable[Contents], total: int, *, geographic: bool) -> None:
    """Write points to a file in the format of its suffix: as a whole, or not at all."""
    with complete_file(file) as unfinished, progress_bar("points") as progress:

        def counted() -> Iterator[Contents]:
            done = 0
            for part in parts:
                progress(done, total)
                yield part
                done += len(part)

        WRITERS[file.suffix](unfinished, counted(), geographic=geographic)


def exported(file: Path, name: str, points: int, revision: int) -> None:
    """Print what was written."""
    typer.echo(f"{file}: {plural(points, 'point')} of {name} at revision {revision}")


def _contents(stored: "Stored") -> Contents:
    times, deadlines = (
        None if each is None else each.astype("datetime64[us]").view(np.int64)  # NaT is NO_TIME
        for each in (stored.times, stored.expire_times)
    )
    return Contents(stored.points, stored.keys, times, deadlines, accuracies=stored.accuracies)
