"""What the commands for data folders do: copy, check and export, with a progress bar and errors as messages."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from .exports import WRITERS
from .progress import progress_bar
from .state.contents import replayed
from .storage.port import StorageError
from .storage.sqlite import copies


def copy_folder(source: Path, target: Path, *, accept_loss: bool = False) -> None:
    """Copy a data folder, and print what was lost and how many hulls it has."""
    with _errors_reported(), progress_bar("pages") as progress:
        report = copies.copy(source, target, progress, accept_loss=accept_loss)
    for note in report.notes:
        typer.echo(note, err=True)
    typer.echo(f"{target}: {len(report.hulls)} hulls")


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
        typer.echo(f"{data}: {len(report.hulls)} hulls, all whole")
    return not report.fatal and not report.notes


def export_hull(data: Path, name: str, file: Path) -> None:
    """Write the points of a hull to a file, in the format of its suffix."""
    with _errors_reported():
        if file.suffix not in WRITERS:
            raise StorageError(f"{file}: the name must end in {', '.join(WRITERS)}")
        row, kept, notes = copies.read(data, name)
        for note in notes:
            typer.echo(note, err=True)
        contents = replayed(kept, row.settings).stored()
        with progress_bar("points") as progress:
            WRITERS[file.suffix](file, contents, progress)
    typer.echo(f"{file}: {len(contents):,} points of {name} at revision {kept.last_revision}")


@contextmanager
def _errors_reported() -> Iterator[None]:
    """Exit with a message after an error of the storage or the operating system."""
    try:
        yield
    except (StorageError, OSError) as error:
        sys.exit(f"error: {error}")
