"""Copying and checking a data folder, also while a server uses it."""

import shutil
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from ...state.records import HullRow, HullSettings, Kept
from ..durable import make_durable
from ..port import NEWEST, DamagedError, FormatError, LockedError, Progress, StorageError
from ..rows import divided
from ..rows.divided import DatabaseView, NoLongerKeptError, Whole, dropping
from ..rows.examine import Findings
from ..rows.fence_check import FenceReport, check_fences
from ..rows.filed_check import adopting, bring_all, damaged_segments, history_bytes, leaving_out
from ..rows.group import AnyStep
from ..rows.incarnation import new_incarnation, renewing
from ..rows.ledger import Ledger
from ..rows.reading import read_hull
from ..rows.tables import FORMAT, Insert, UnreadableError
from ..rows.totals import STOPPED, Totals
from ..segments.archive import HISTORY
from ..segments.objects import archive_at
from .disk import Disk, OpenMode
from .examination import examine, format_of, load
from .folder import DATABASE, UNFINISHED, UNFINISHED_WORDS, Folder
from .migration import begin_anew, change, make_tables, migrate
from .readers import SQLiteReader
from .schema import PAGE_BYTES, carry_out, renew_totals

PAGES_A_STEP = 256
# How often the folders of a server are opened to find what they have in common.
ATTEMPTS = 5


@dataclass(frozen=True, slots=True)
class HullReport:
    """A description of one hull in a folder.

    Attributes:
        name: its name.
        summary: its revision, rows and snapshots.
        whole: whether all of its data is intact, its past too.
        is_shard: whether it is one of the shards of a hull.
    """

    name: str
    summary: str
    whole: bool
    is_shard: bool


@dataclass(frozen=True, slots=True)
class Report:
    """A description of a folder.

    Attributes:
        hulls: the hulls, ordered by name.
        fences: the fences, ordered by name, if they were compared.
        notes: losses and damage that do not prevent serving the folder.
        fatal: the reasons why it cannot be served; empty where it can.
    """

    hulls: list[HullReport]
    notes: list[str]
    fatal: list[str]
    fences: list[FenceReport] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class HullInFolder:
    """A hull in the folders of a server.

    Attributes:
        row: its row.
        revision: its revision.
        kepts: the settings and the contents of the hull or, of a hull over shards, of each shard.
        notes: messages about losses at the ends of logs.
    """

    row: HullRow
    revision: int
    kepts: list[tuple[HullSettings, Kept]]
    notes: list[str]


def check(path: Path, progress: Progress, history: str | Path | None = None) -> Report:
    """Examine all data of a folder without changing anything. A server may be writing to it.

    Args:
        path: a data folder or a backup.
        progress: called with the rows examined so far and the total.
        history: the folder of its past, by default the one in it.

    Raises:
        StorageError: the folder has no database, or cannot be read at all.
    """
    with _opened(path, log_in_use=True) as opened:
        findings = examine(opened.connection, opened.version, opened.own, progress)
        report = _report(findings, opened.notes)
        if report.fatal:
            return report
        fences = check_fences(opened.reader, findings.ledger)
    holes = list(damaged_segments(findings.ledger.hulls.values(), archive_at(history or path / HISTORY)))
    if holes:
        with _opened(path) as opened:  # what has become too old meanwhile is no hole
            there = load(opened.connection, opened.version).hulls
        holes = [
            each for each in holes if each[0].row.number in there and each[1] in there[each[0].row.number].segments
        ]
    torn = {hull.row.name for hull, _, _ in holes}
    hulls = [replace(each, whole=each.whole and each.name not in torn) for each in report.hulls]
    return replace(report, hulls=hulls, fences=fences, notes=[*report.notes, *(text for _, _, text in holes)])


def history_size(paths: Sequence[Path]) -> int:
    """The bytes of the past of the hulls in the folders of a server.

    Raises:
        StorageError: they cannot be read.
    """
    total = 0
    for path in paths:
        with _opened(path) as opened:
            total += history_bytes(load(opened.connection, opened.version))
    return total


def check_together(paths: Sequence[Path]) -> None:
    """Compare the shards of hulls with their roots, which may be in other folders of a server.

    Raises:
        DamagedError: a shard does not have what was decided.
        StorageError: the folders cannot be read, or change faster than that.
    """
    with _together(paths):
        return


def copy(source: Path, target: Path, progress: Progress, *, accept_loss: bool = False) -> Report:
    """Copy a folder, including its log, as of one moment: `copy_all` of one folder."""
    ((_, report),) = copy_all([(source, target)], progress, accept_loss=accept_loss)
    return report


def copy_all(
    folders: Sequence[tuple[Path, Path]],
    progress: Progress,
    *,
    accept_loss: bool = False,
    restores: bool = False,
    history: str | Path | None = None,
    without_history: bool = False,
) -> Iterator[tuple[Path, Report]]:
    """Copy folders of one server, including their logs, each as of one moment. Yields each copy, and a report on it.

    Hulls over shards are copied as of the moment before these, so that the copies belong together: what their roots and
    shards have beyond is left out.

    Hulls and fences have other uids in the copies: these lack what is committed after them, so they must not be taken
    for the originals.

    A copy has a different file name until it is complete and on the disk, so a partial copy is never used.

    Args:
        folders: the source and the target of each. A source is a data folder or a backup; a server may be writing to
            it. A target must be empty if it exists.
        progress: called with the pages copied so far and the total.
        accept_loss: whether to copy without the damaged or missing part of the log.
        restores: whether the copies are to be served in place of what was lost: their fences begin anew.
        history: the folder of the past of the sources, by default the one in each.
        without_history: whether to leave the past out, but for what is in the journal.

    Raises:
        StorageError: a source has no database, a target is not empty, or hulls change faster than they are copied.
        DamagedError: the copied data is damaged.
    """
    incarnation = new_incarnation()
    with _together([source for source, _ in folders], accept_loss=accept_loss) as together:
        for place, (opened, (source, target)) in enumerate(zip(together.sources, folders, strict=True)):
            with _new(source, target) as connection:
                opened.connection.backup(
                    connection, pages=PAGES_A_STEP, progress=lambda _, left, pages: progress(pages - left, pages)
                )
                past = None if without_history else (history or source / HISTORY, target / HISTORY)
                report = _finish(connection, opened, together.lasts(place), incarnation, past, restores=restores)
            yield target, report


@contextmanager
def _together(paths: Sequence[Path], *, accept_loss: bool = False) -> Iterator["_Together"]:
    """The databases of one server, and what they have in common of hulls over shards.

    Raises:
        StorageError: these hulls change faster than the databases can be opened.
    """
    failure: Exception | None = None
    for _ in range(ATTEMPTS):
        before: dict[str, int] = {}
        for path in paths if len(paths) > 1 else ():
            with _opened(path, accept_loss=accept_loss) as opened:
                before |= divided.revisions(load(opened.connection, opened.version))
        with ExitStack() as stack:
            sources = [stack.enter_context(_opened(path, accept_loss=accept_loss)) for path in paths]
            ledgers = [load(each.connection, each.version) for each in sources]
            parts = [DatabaseView(each.reader, ledger) for each, ledger in zip(sources, ledgers, strict=True)]
            if len(parts) == 1:
                before = divided.revisions(ledgers[0])
            try:
                wholes = list(divided.wholes(parts, before))
            except NoLongerKeptError as error:  # a snapshot was written meanwhile, and another one before
                failure = error
                continue
            yield _Together(sources, parts, wholes)
            return
    raise StorageError(f"the folder changes faster than it can be read, so try again, or stop the server: {failure}")


@contextmanager
def reading(path: Path, progress: Progress) -> Iterator[tuple[SQLiteReader, Findings]]:
    """The rows of a folder, and what an examination finds; no server can use the folder before the end of the block.

    Raises:
        StorageError: a server uses it, or it has an older format.
        DamagedError: it cannot be served.
    """
    with _opened(path, unused=True) as opened:
        if opened.version != FORMAT:
            raise FormatError(
                f"{path} has format {opened.version}: copy it with `dynhull restore {path} --data NEW`, which migrates "
                "the copy"
            )
        findings = examine(opened.connection, opened.version, opened.own, progress)
        if findings.fatal:
            raise DamagedError(f"{path}: {'; '.join(findings.fatal)}: restore a backup")
        findings.notes[:0] = opened.notes
        yield opened.reader, findings


def write(
    source: str, target: Path, rows: Iterable[Insert], totals: Totals, history: Path | str | None = None
) -> Findings:
    """Make a folder with the rows of a source, as a whole or not at all. Returns what an examination finds.

    Args:
        source: the source, for people.
        target: the folder.
        rows: the rows.
        totals: those of the source.
        history: the folder with the past of the source; None if there is none.

    Raises:
        StorageError: the target is not empty, or there is a past, and no folder with it.
        DamagedError: the rows do not agree with the totals, or the past is damaged.
    """
    with _new(source, target) as connection:
        connection.execute(f"PRAGMA page_size = {PAGE_BYTES}")
        connection.execute("PRAGMA synchronous = OFF")  # it is made durable before it gets its name
        connection.execute("BEGIN IMMEDIATE")
        make_tables(connection)
        carry_out(connection, rows)
        renew_totals(connection, totals._replace(mode=STOPPED))
        findings = examine(connection, FORMAT, None, lambda *_: None)
        if findings.fatal:
            raise DamagedError(f"the data is damaged and was not copied: {'; '.join(findings.fatal)}")
        bring_all(findings.ledger, history, target / HISTORY)
        connection.execute("COMMIT")
        connection.execute("PRAGMA journal_mode = WAL")
    return findings


def read(paths: Sequence[Path], name: str) -> HullInFolder:
    """A hull as of the last commit; a hull over shards as `copy_all` copies it.

    Args:
        paths: the folders of one server.
        name: the name of the hull.

    Raises:
        StorageError: no hull has that name.
        DamagedError: it cannot be read.
    """
    with _together(paths) as together:
        parts, notes = together.parts, [note for each in together.sources for note in each.notes]
        for part in parts:
            for hull in part.ledger.hulls.values():
                if hull.row.name == name and not hull.row.settings.divided:
                    kept = read_hull(part.reader, hull, NEWEST)
                    return HullInFolder(hull.row, kept.last_revision, [(hull.row.settings, kept)], notes)
        for whole in together.wholes:
            if whole.row.name == name:
                shards = [(parts[of], parts[of].ledger.hulls[number], last) for of, number, last in whole.shards]
                nothing = replace(whole.row.settings, shards=0), Kept()  # says which columns there are
                kepts = [(hull.row.settings, read_hull(part.reader, hull, last)) for part, hull, last in shards]
                return HullInFolder(whole.row, whole.revision, [nothing, *kepts], notes)
    raise StorageError(f"there is no hull {name!r} in {paths[0] if len(paths) == 1 else paths[0].parent}")


@dataclass(frozen=True, slots=True)
class _Opened:
    """A database with an open read transaction.

    Attributes:
        connection: the connection to it.
        version: its format.
        notes: messages about losses at the end of its log.
        own: the totals in its own file, None while a server uses it.
    """

    connection: sqlite3.Connection
    version: int
    notes: list[str]
    own: Totals | None

    @property
    def reader(self) -> SQLiteReader:
        """Reads its rows."""
        return SQLiteReader(self.connection, self.version)


@dataclass(frozen=True, slots=True)
class _Together:
    """The databases of one server, and what they have in common of hulls over shards."""

    sources: list[_Opened]
    parts: list[DatabaseView]
    wholes: list[Whole]

    def lasts(self, place: int) -> dict[int, int]:
        """The last revisions of roots and shards in one of the databases that belong to what they have in common."""
        roots = {whole.row.number: whole.revision for whole in self.wholes if whole.part == place}
        return roots | {number: last for whole in self.wholes for of, number, last in whole.shards if of == place}


@contextmanager
def _new(source: object, target: Path) -> Iterator[sqlite3.Connection]:
    """A database that the block fills: with its end, and not before, it is on the disk under its final name."""
    made = _claim(target)
    unfinished = target / UNFINISHED
    try:
        with closing(sqlite3.connect(unfinished, isolation_level=None)) as connection:
            yield connection
        make_durable(unfinished)
    except BaseException as error:
        for file in target.glob(f"{UNFINISHED}*"):
            file.unlink()
        shutil.rmtree(target / HISTORY, ignore_errors=True)
        if made:
            target.rmdir()
        if isinstance(error, sqlite3.Error):
            raise StorageError(f"{source} cannot be copied to {target}: {error}") from error
        raise
    unfinished.rename(target / DATABASE)
    make_durable(target)
    make_durable(target.absolute().parent)


def _claim(target: Path) -> bool:
    """Make the folder for a copy; returns whether it is new."""
    if not target.exists():
        target.mkdir(parents=True)
        return True
    if (target / UNFINISHED).exists():
        raise StorageError(f"{target} {UNFINISHED_WORDS}")
    if target.is_file():
        raise StorageError(f"{target} is a file: name an empty folder, or one that does not exist yet")
    if any(target.iterdir()):
        raise StorageError(f"{target} is not empty: name an empty folder, or one that does not exist yet")
    return False


@contextmanager
def _opened(
    path: Path, *, accept_loss: bool = False, unused: bool = False, log_in_use: bool = False
) -> Iterator[_Opened]:
    """Open a folder. The log of one in use is examined with `log_in_use` only: a copy has what SQLite reads of it."""
    folder = Folder(path, Disk())
    with ExitStack() as stack:
        notes: list[str] = []
        own = None
        if stack.enter_context(folder.alone()):
            try:
                notes, own = folder.check_log()
            except DamagedError as error:
                if not accept_loss:
                    raise
                notes = [f"copied without what is lost: {error}"]
        elif unused:
            raise LockedError(f"a server uses {path}: stop it first")
        elif log_in_use:
            notes = folder.check_log_in_use()
        if not folder.disk.size(folder.database):
            raise StorageError(f"{path} is no data folder: it has no {DATABASE}")
        # Without a log, SQLite need not create files to read the database.
        access = OpenMode.READ if folder.disk.size(folder.log) else OpenMode.RAW
        try:
            connection = stack.enter_context(closing(folder.connect(access)))
            connection.execute("BEGIN")
            version = format_of(connection, folder.database)
            if version == 0:
                raise StorageError(f"{path} is no data folder: its {DATABASE} is empty")
            yield _Opened(connection, version, notes, own)
        except (sqlite3.Error, UnreadableError) as error:
            raise DamagedError(f"{folder.database} cannot be read ({error}): restore a backup") from error


def _finish(
    connection: sqlite3.Connection,
    opened: _Opened,
    lasts: Mapping[int, int],
    incarnation: str,
    past: tuple[Path | str, Path] | None,
    *,
    restores: bool,
) -> Report:
    """Examine copied pages, and turn them into a database of the present format that is marked as not in use.

    `lasts` are the last revisions of the hulls that may have later ones, and `past` is from where to where files of
    segments are copied; None for a copy without them.
    """
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("BEGIN IMMEDIATE")
    findings = examine(connection, opened.version, opened.own, lambda *_: None)
    if findings.fatal:
        raise DamagedError(f"the data is damaged and was not copied: {'; '.join(findings.fatal)}")
    ledger = findings.ledger
    change(connection, ledger, findings.mends)
    change(connection, ledger, _leading_back(SQLiteReader(connection, opened.version), ledger, lasts))
    if opened.version < FORMAT:
        migrate(connection, opened.version, ledger, findings.starts)
    retired = leaving_out(ledger) if past is None else adopting(ledger, *past, findings.notes)
    change(connection, ledger, list(retired))
    if restores:
        begin_anew(connection, ledger, incarnation)
    else:
        change(connection, ledger, renewing(ledger, incarnation))
    renew_totals(connection, ledger.totals._replace(mode=STOPPED))
    connection.execute("COMMIT")
    return _report(findings, opened.notes)


def _leading_back(reader: SQLiteReader, ledger: Ledger, lasts: Mapping[int, int]) -> Iterator[AnyStep]:
    """What drops that which hulls have beyond their last revisions."""
    for number, last in lasts.items():
        yield from dropping(reader, ledger.hulls[number], last)


def _report(findings: Findings, notes: list[str]) -> Report:
    hulls = sorted(findings.ledger.hulls.values(), key=lambda hull: hull.row.name)
    reports = []
    for hull in hulls:
        rows = "1 row" if len(hull.ids) == 1 else f"{len(hull.ids)} rows"
        summary = f"revision {hull.last}, {rows} of batches"
        if hull.segments:
            size = sum(segment.size for segment in hull.segments)
            summary += f", {size:,} bytes of past from revision {hull.segments[0].first} on"
            summary += f", from which keys were erased {len(hull.erasures)} times" if hull.erasures else ""
        if hull.snapshots:
            summary += f", snapshots at {', '.join(str(snapshot.revision) for snapshot in hull.snapshots)}"
        is_shard = hull.row.settings.shard is not None
        reports.append(HullReport(hull.row.name, summary, hull.row.number not in findings.damaged, is_shard))
    return Report(reports, notes + findings.notes, findings.fatal)
