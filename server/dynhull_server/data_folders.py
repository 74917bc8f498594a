"""What the commands for data folders do: copy, check and export, with a progress bar and errors as messages."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from dynhull_cli.plural import plural

from .exporting import exported, require_format, write_export
from .exports import in_parts
from .failure import code_of, fail, text_of
from .progress import progress_bar
from .state.alarms.rule import is_alarm, unmarked
from .state.contents import replayed
from .state.contents.joining import joined
from .storage.port import DamagedError, StorageError
from .storage.sqlite import copies
from .storage.worker_folders import parts_of, workers_of, write_manifest


def copy_folder(
    source: Path,
    target: Path,
    *,
    accept_loss: bool = False,
    restores: bool = False,
    history: str | None = None,
    without_history: bool = False,
) -> None:
    """Copy a data folder, and print what was lost and how many hulls it has; of one with workers, each part."""
    with _errors_reported():
        workers = workers_of(source)
        if workers is not None and target.exists() and any(target.iterdir()):
            raise StorageError(f"{target} is not empty")
        folders = [(part, target / part.relative_to(source)) for part in parts_of(source)]
        if not accept_loss and (size := copies.history_size(parts_of(source))):
            left = "left out" if without_history else "linked where that is possible, otherwise copied"
            typer.echo(f"{source}: {plural(size, 'byte')} of past, {left}")
        with progress_bar("pages") as progress:
            options = {"accept_loss": accept_loss, "restores": restores, "without_history": without_history}
            copied = list(copies.copy_all(folders, progress, history=history, **options))
        for copy, report in copied:
            for note in report.notes:
                typer.echo(note, err=True)
            typer.echo(f"{copy}: {_hulls(report)}")
        if workers is not None:
            write_manifest(target, workers, complete=True)  # at the end: without it, the copy is refused


def check_folder(data: Path, history: str | None = None) -> bool:
    """Examine a data folder and print a report, of one with workers on each part; returns whether all is intact."""
    with _errors_reported():
        parts = parts_of(data)
        whole = [_check_part(part, history) for part in parts]
        if not all(whole):
            return False
        try:
            copies.check_together(parts)
        except DamagedError as error:
            typer.echo(f"{error}", err=True)
            typer.echo(f"{data}: damaged; it can be served without the hull named above")
            return False
    return True


def _check_part(data: Path, history: str | None) -> bool:
    with _errors_reported(), progress_bar("rows") as progress:
        report = copies.check(data, progress, history)
    for hull in report.hulls:
        typer.echo(f"{hull.name}: {hull.summary}: {'whole' if hull.whole else 'DAMAGED'}")
    for fence in report.fences:
        state = "WRONG" if fence.faults else "whole"
        of_alarm = is_alarm(fence.name)
        what, inside = ("alarm", "raised") if of_alarm else ("fence", "inside")
        typer.echo(f"{what} {unmarked(fence.name)}: {fence.last:,} events, {fence.inside:,} {inside}: {state}")
    wrong = [str(fault) for fence in report.fences for fault in fence.faults]
    for problem in [*report.notes, *report.fatal, *wrong]:
        typer.echo(problem, err=True)
    if wrong and not report.fatal:
        typer.echo(
            f"{data}: fences are wrong, as reported above: restore a backup, or delete and create these fences again"
        )
    elif report.fatal:
        typer.echo(f"{data}: damaged; it cannot be served: restore a backup")
    elif report.notes:
        typer.echo(f"{data}: damaged; it can be served without the parts named above")
    else:
        typer.echo(f"{data}: {_hulls(report)}, all whole")
    return not report.fatal and not report.notes and not wrong


def _hulls(report: copies.Report) -> str:
    shards = sum(hull.is_shard for hull in report.hulls)
    return hulls_counted(len(report.hulls) - shards, shards)


def hulls_counted(hulls: int, shards: int) -> str:
    """The number of hulls, and that of the shards that some of them are divided among."""
    counted = plural(hulls, "hull")
    return f"{counted}, {plural(shards, 'shard')}" if shards else counted


def export_hull(data: Path, name: str, file: Path) -> None:
    """Write the points of a hull to a file, in the format of its suffix."""
    require_format(file)
    with _errors_reported():
        found = copies.read(parts_of(data), name)
        for note in found.notes:
            typer.echo(note, err=True)
        contents = joined([replayed(kept, settings).stored() for settings, kept in found.kepts])
        write_export(file, in_parts(contents), len(contents), geographic=found.row.settings.geographic)
    exported(file, name, len(contents), found.revision)


@contextmanager
def _errors_reported() -> Iterator[None]:
    """Exit with a message after an error of the storage or the operating system."""
    try:
        yield
    except (StorageError, OSError) as error:
        fail(text_of(error), code_of(error))
