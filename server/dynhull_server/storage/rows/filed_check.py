"""The files of segments: are they there, and as they were written? And copies of them."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..port import DamagedError, StorageError
from ..segments.archive import BATCHES, STATE, Archive, is_installed
from ..segments.objects import archive_at
from .filed import read_batches, read_state, require_known
from .filing import run_from_start
from .group import DropErasure, RetireSegment
from .ledger import HullRows, Ledger
from .segment_rows import StoredSegment


def damaged_segments(hulls: Iterable[HullRows], archive: Archive) -> Iterator[tuple[HullRows, StoredSegment, str]]:
    """The segments that cannot be read, and why."""
    for hull in hulls:
        for segment in hull.segments:
            try:
                examine_segment(archive, segment)
            except StorageError as error:
                yield hull, segment, hole(hull, segment, error)


def examine_segment(archive: Archive, segment: StoredSegment) -> None:
    """Raise DamagedError, which names the file, if a file of a segment is not as it was written."""
    require_known(segment)
    if is_installed():
        read_batches(archive, segment)
        if segment.facts.state_bytes:
            read_state(archive, segment)
        return
    archive.read(segment.file + BATCHES, segment.facts.wrote)
    if segment.facts.state_bytes:
        archive.read(segment.file + STATE, segment.facts.state_wrote)


def hole(hull: HullRows, segment: StoredSegment, error: Exception) -> str:
    """What is missing of the past of a hull without a segment."""
    return f"hull {hull.row.name!r}: revisions {segment.first} to {segment.last} of its past cannot be read: {error}"


def history_bytes(ledger: Ledger) -> int:
    """The size of all segments."""
    return sum(segment.size for hull in ledger.hulls.values() for segment in hull.segments)


def leaving_out(ledger: Ledger) -> Iterator[RetireSegment | DropErasure]:
    """The steps that leave a copy without any segment."""
    for number, hull in ledger.hulls.items():
        yield from (RetireSegment(number, segment) for segment in hull.segments)
        yield from (DropErasure(number, stored) for stored in hull.erasures)


def adopting(ledger: Ledger, source: Path | str, target: Path | str, notes: list[str]) -> Iterator[RetireSegment]:
    """Copy the files of all segments; the steps that leave those out whose files are not there any more, or damaged.

    What lies before one that is left out is left out, too, so that the past has no gap.

    Args:
        ledger: the rows of the copy.
        source: the folder with the files.
        target: the folder for them.
        notes: receives what is left out.
    """
    before, after = archive_at(source), archive_at(target)
    copied = False
    for number, hull in ledger.hulls.items():
        gone = 0
        for place, segment in enumerate(hull.segments):
            try:
                after.adopt(before, segment.file)
                copied = True
                examine_segment(after, segment)
            except (FileNotFoundError, DamagedError) as error:
                notes.append(f"not copied: {hole(hull, segment, error)}")
                gone = place + 1
        for segment in hull.segments[: run_from_start(hull, gone)]:
            after.remove(segment.file)
            yield RetireSegment(number, segment)
    if copied:
        after.sync()


@contextmanager
def undone(target: Path | str | None) -> Iterator[Callable[[Ledger], None]]:
    """Call what is given with the ledgers whose files are to be copied: an error removes what was not there before.

    A process that is killed leaves them. To copy them again does no harm.
    """
    copied: list[tuple[Archive, str]] = []

    def noted(ledger: Ledger) -> None:
        if target is not None and history_bytes(ledger):
            archive = archive_at(target)
            files = [segment.file for hull in ledger.hulls.values() for segment in hull.segments]
            copied.extend((archive, each) for each in files if not archive.has(each))

    try:
        yield noted
    except BaseException:
        for archive, file in copied:
            archive.remove(file)
        raise


def bring_all(ledger: Ledger, source: Path | str | None, target: Path | str | None) -> None:
    """Copy the files of all segments. Raises StorageError if there are some, and no folder, or one is damaged."""
    size = history_bytes(ledger)
    if not size:
        return
    if source is None or target is None:
        raise StorageError(
            f"the hulls have {size:,} bytes of past: say with --history-dir where those of a database are"
        )
    notes: list[str] = []
    if list(adopting(ledger, source, target, notes)):
        raise DamagedError("; ".join(notes))
