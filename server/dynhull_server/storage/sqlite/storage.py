"""The storage on SQLite: an implementation of the port.

Outcomes. A commit that fails before its COMMIT has written no frame with a commit mark, and is rolled back. During
COMMIT SQLite writes the frames in order, the one with the mark last, so a failed write leaves no complete mark either.
All other errors of COMMIT (a failed sync, no memory, shared memory that cannot grow) may happen after the mark: after a
crash, the next recovery would find the commit, although this process does not see it. `settle` decides the outcome with
a commit of its own. SQLite writes it either after the frames in question, if it considers them part of the log, or over
them. In the second case all of them become invalid, because checksums continue from frame to frame. Once that commit is
durable, reading shows the outcome.
"""

import sqlite3
from array import array
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from threading import Lock

from ...state.changes import Change
from ...state.errors import words
from ...state.fences.records import FenceEvent, Inside, KeptFence
from ...state.records import HullRow, Kept
from ..durability import Durability
from ..port import (
    NEWEST,
    Contents,
    DamagedError,
    LockedError,
    NotCommittedError,
    Progress,
    Step,
    StorageError,
)
from .chunks import chunk, starts, state
from .disk import Access, Disk
from .encoding import weight
from .examine import Findings, examine, format_of, load
from .fence_ledger import DropInside, ShrinkEvents, inside_steps
from .fence_reading import read_events, read_fences, shrunk
from .folder import Folder
from .ledger import (
    DROPPED,
    KEPT,
    Chunk,
    DropBatches,
    DropDead,
    DropSnapshot,
    Finish,
    Group,
    Ledger,
    Snapshot,
)
from .migration import make_tables, migrate
from .reading import Readers, begin, read_each, read_hull, rows_by_id
from .schema import FORMAT, PAGE_BYTES, UPDATE_TOTALS
from .staging import staging
from .totals import MODES, STOPPED, Totals, read_totals, renew_totals

DROPPED_BYTES, DROPPED_ROWS = 2**19, 1000  # per step

CHECKPOINT_BYTES = 16 * 2**20  # the size of the log that starts a checkpoint
LONGEST_LOG_BYTES = 64 * 2**20  # a longer log is truncated when it restarts
START_PATIENCE_MS = 1000  # waiting for readers at the start
PATIENCE_MS = 10  # waiting for writers and readers before the log restarts; meanwhile no commit begins

SYNCHRONOUS = {Durability.SYNC: "FULL", Durability.INTERVAL: "NORMAL", Durability.NONE: "OFF"}

# A write failed, so no complete frame has a commit mark.
NOTHING_WRITTEN = (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE)


@contextmanager
def _as_storage_errors() -> Iterator[None]:
    """Convert errors of SQLite, whose cause is the disk or the data on it, to StorageError."""
    try:
        yield
    except sqlite3.Error as error:
        raise StorageError(str(error)) from error


class SQLiteStorage:
    """Hulls in a folder.

    Args:
        path: the folder, created if it is missing.
        durability: the durability of a commit.
        disk: the disk it is on.
    """

    immediate = False
    keeps = True

    def __init__(self, path: Path, durability: Durability = Durability.SYNC, disk: Disk | None = None) -> None:
        self._folder = Folder(path, disk or Disk())
        self._durability = durability
        self._ledger = Ledger()
        self._visible = Lock()  # held while the ledger may differ from the committed rows
        self._unsettled = False
        self._writer: sqlite3.Connection | None = None
        self._housekeeping = Lock()
        self._log_in_doubt = False
        self._gone: Path | None = None
        self._under_way: dict[int, set[int]] = {}  # chunks of unfinished snapshots
        self._open = ExitStack()

    # Opening and closing

    def open(self, progress: Progress) -> Contents:
        """Examine the folder, repair what can be repaired, and load it."""
        self._folder.disk.make(self._folder.path)
        with ExitStack() as stack:
            stack.enter_context(self._folder.held())
            try:
                notes, own = self._folder.check_log()
                findings, version = self._examined(stack, own, progress)
                if findings.fatal:
                    raise DamagedError(f"{self._folder.database}: {'; '.join(findings.fatal)}: restore a backup")
                stack.callback(self._disconnect)
                self._load(findings, version)
                self._checkpointer = stack.enter_context(closing(self._folder.connect(Access.WRITE)))
                self._restart_log(own)
                self._readers = stack.enter_context(closing(Readers(self._connect_reader)))
                self._log = stack.enter_context(self._folder.disk.open(self._folder.log))
                self._files = {
                    file: self._folder.disk.identity(file) for file in (self._folder.database, self._folder.log)
                }
            except sqlite3.OperationalError as error:
                raise StorageError(f"{self._folder.database} cannot be opened: {error}") from error
            except sqlite3.Error as error:
                raise DamagedError(
                    f"{self._folder.database} cannot be read as a database ({error}): restore a backup"
                ) from error
            self._open = stack.pop_all()
        rows = sorted((hull.row for hull in self._ledger.hulls.values()), key=lambda row: row.name)
        fences = sorted((fence.row for fence in self._ledger.fences.values()), key=lambda row: row.name)
        notes += [self._prefixed(note) for note in findings.notes]
        return Contents(rows, self._ledger.totals.next_number, notes, fences)

    def close(self) -> None:
        """Release the folder."""
        if not self._unsettled and self._writer is not None:
            # On a full disk the folder stays marked as in use, as if the server had been killed, and its log remains.
            with suppress(sqlite3.Error, StorageError, MemoryError):
                self._writer.execute("PRAGMA synchronous = FULL")
                self._write(Group(self._in_mode(STOPPED), []))
                self._guard.close()
        self._open.close()

    # Committing

    @_as_storage_errors()
    def commit(self, changes: Sequence[Change | Step]) -> None:
        """Commit all of the changes or none."""
        if self._unsettled:
            raise StorageError("the outcome of the previous commit is not known yet")
        if self._gone is not None:
            raise NotCommittedError(_gone(self._gone))
        try:
            group = Group(self._ledger, changes)  # type: ignore[arg-type]  # all steps come from this class
        except NotCommittedError:
            raise
        except Exception as error:  # a value that does not fit a column, or no memory
            raise _not_committed(error) from error
        self._write(group)

    def ahead(self, changes: Sequence[Change | Step]) -> tuple[Sequence[Step], Sequence[Change | Step]]:
        """What of many events can be written before the changes."""
        return staging(changes, lambda: next(self._ledger.event_ids))

    @_as_storage_errors()
    def settle(self) -> None:
        """Decide the outcome of the last commit, as described at the top of this file."""
        if not self._unsettled:
            return
        self._disconnect()
        connection = self._writer = self._connect_writer()
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("BEGIN IMMEDIATE")
        totals, _ = read_totals(connection)
        if totals is None:
            raise DamagedError(f"{self._folder.database}: the totals are damaged: restore a backup")
        connection.execute(UPDATE_TOTALS, totals._replace(commits=totals.commits + 1).row)
        connection.execute("COMMIT")
        self._set_synchronous(connection)
        with self._housekeeping:
            self._copy_log("RESTART")  # if possible; otherwise the failed frames stay after the end of the log
        connection.execute("BEGIN")
        ledger = load(connection)
        connection.execute("COMMIT")
        with self._visible:
            ledger.go_on_from(self._ledger, set().union(*self._under_way.values()))
            self._ledger = ledger
            self._unsettled = False

    def _write(self, group: Group) -> None:
        connection = self._writer
        try:
            if connection is None:
                connection = self._writer = self._connect_writer()
            connection.execute("BEGIN IMMEDIATE")
            for sql, values in group.statements:
                connection.execute(sql, values)
        except BaseException as error:
            self._roll_back()
            if isinstance(error, sqlite3.Error | OSError | MemoryError):
                raise _not_committed(error) from error
            raise
        with self._visible:
            self._unsettled = True
            try:
                connection.execute("COMMIT")
            except sqlite3.Error as error:
                if getattr(error, "sqlite_errorcode", None) not in NOTHING_WRITTEN:
                    raise
                self._roll_back()
                self._unsettled = False
                raise _not_committed(error) from error
            group.adopt()
            self._unsettled = False

    def _roll_back(self) -> None:
        """End the transaction; if that fails, close the connection."""
        if self._writer is None:
            return
        try:
            if self._writer.in_transaction:
                self._writer.execute("ROLLBACK")
        except (sqlite3.Error, MemoryError):
            self._disconnect()

    # Reading

    def row(self, number: int) -> HullRow | None:
        """The hull with that number, or None."""
        with self._visible:
            hull = self._settled().hulls.get(number)
            return None if hull is None else hull.row

    @_as_storage_errors()
    def read(self, number: int, until: int = NEWEST) -> Kept:
        """A hull at a revision."""
        with self._readers.lend() as connection:
            with self._visible:
                hull = self._settled().hulls[number].copy()
                begin(connection)
            return read_hull(connection, hull, until)

    def read_each(self, numbers: Sequence[int]) -> Iterator[Kept]:
        """Hulls at their last revisions."""
        with _as_storage_errors(), self._readers.lend() as connection:
            with self._visible:
                hulls = [self._settled().hulls[number].copy() for number in numbers]
                begin(connection)
            yield from read_each(connection, hulls)

    def oldest(self, number: int) -> int:
        """The oldest revision that `read` can return."""
        with self._visible:
            return self._settled().hulls[number].oldest

    @_as_storage_errors()
    def read_fences(self, numbers: Sequence[int]) -> list[KeptFence | None]:
        """Fences as last committed."""
        with self._readers.lend() as connection:
            with self._visible:
                ledger = self._settled()
                found = [ledger.fences.get(number) for number in numbers]
                fences = [None if fence is None else ledger.runs.since(fence, fence.base) for fence in found]
                begin(connection)
            return read_fences(connection, fences)

    @_as_storage_errors()
    def read_events(self, number: int, after: int, most: int) -> list[FenceEvent]:
        """Events of a fence."""
        with self._readers.lend() as connection:
            with self._visible:
                ledger = self._settled()
                fence = ledger.runs.since(ledger.fences[number], after, most)
                begin(connection)
            return read_events(connection, fence, after, most)

    def boundary(self, number: int, first: int) -> int:
        """The sequence nearest before `first` such that all events before it can be dropped."""
        with self._visible:
            return self._settled().fences[number].boundary(first)

    def inside(self, number: int, inside: Inside) -> Iterator[Step]:
        """Write who is inside, then drop what that supersedes."""
        yield from inside_steps(number, inside, lambda: next(self._ledger.inside_ids))
        while (fence := self._ledger.fences.get(number)) and (
            older := [key for key in fence.insides if key < fence.base]
        ):
            yield DropInside(number, older[0])

    def _settled(self) -> Ledger:
        if self._unsettled:
            raise StorageError("the outcome of the last commit is not known yet")
        return self._ledger

    # Snapshots, and the removal of superseded rows

    def snapshot(self, number: int, kept: Kept) -> Iterator[Step]:
        """Write a snapshot, then drop the rows it supersedes."""
        contents = kept.contents
        firsts = starts(contents)
        ids = [next(self._ledger.chunk_ids) for _ in firsts]
        snapshot = Snapshot(next(self._ledger.snapshot_ids), kept.revision, array("q", ids))
        self._under_way[snapshot.id] = set(ids)
        try:
            for i, (place, first, end) in enumerate(zip(ids, firsts, [*firsts[1:], len(contents)], strict=True)):
                yield Chunk(place, snapshot.id, i, chunk(contents, slice(first, end)))
            yield Finish(number, snapshot, state(kept))
        finally:
            del self._under_way[snapshot.id]
        yield from self._trim(number)

    def _trim(self, number: int) -> Iterator[Step]:
        while (hull := self._ledger.hulls.get(number)) and len(hull.snapshots) > KEPT:
            yield DropSnapshot(number, hull.snapshots[0])
        yield from self._drop_dead("chunks", "points")
        while (hull := self._ledger.hulls.get(number)) and (ids := hull.superfluous()):
            rows = self._few(ids, "batches.rowid, first, last, checksum", "batches", "payload")
            if any(place != row[0] for place, row in zip(ids, rows, strict=False)) or not rows:
                raise DamagedError(f"{self._folder.database}: a row of batches of hull {number} is missing")
            weights = sum(weight(stored, number, first, last) for _, first, last, stored in rows)
            yield DropBatches(number, ids[: len(rows)], weights)

    def sweep(self) -> Iterator[Step]:
        """Drop the rows of deleted hulls and unfinished snapshots."""
        self._look_for_dead_chunks()
        for table, column in DROPPED.items():
            yield from self._drop_dead(table, column)
        for place in self._sparse():
            step = self._shrunk(place)
            if step is not None:
                yield step

    def _sparse(self) -> list[int]:
        with self._visible:
            return self._settled().events.sparse()

    @_as_storage_errors()
    def _shrunk(self, place: int) -> ShrinkEvents | None:
        """The step that leaves of a row of events what is needed; None if that is nothing."""
        with self._readers.lend() as connection:
            with self._visible:
                starts = {number: fence.first for number, fence in self._settled().fences.items()}
                begin(connection)
            return shrunk(connection, place, starts)

    def _drop_dead(self, table: str, column: str) -> Iterator[Step]:
        while ids := self._ledger.dead[table][:DROPPED_ROWS]:
            yield DropDead(table, ids[: max(1, len(self._few(ids, "NULL", table, column)))])

    @_as_storage_errors()
    def _look_for_dead_chunks(self) -> None:
        """Find the chunks that belong to no snapshot, also those of abandoned ones."""
        with self._readers.lend() as connection:
            rows = connection.execute("SELECT rowid, snapshot FROM chunks").fetchall()
        with self._visible:
            live = {snapshot.id for hull in self._ledger.hulls.values() for snapshot in hull.snapshots}
            live |= self._under_way.keys()
            self._ledger.dead["chunks"] = array("q", (place for place, snapshot in rows if snapshot not in live))

    @_as_storage_errors()
    def _few(self, ids: "array[int]", columns: str, table: str, sized: str) -> list[Sequence[int]]:
        """Some columns of the first rows: as many as fit into a step, but at least one."""
        taken: list[Sequence[int]] = []
        size = 0
        with self._readers.lend() as connection:
            for *row, length in rows_by_id(connection, f"{columns}, length({sized})", table, ids[:DROPPED_ROWS]):
                size += length
                if taken and size > DROPPED_BYTES:
                    break
                taken.append(row)
        return taken

    # Housekeeping

    @_as_storage_errors()
    def sync(self) -> None:
        """Make earlier commits durable."""
        if self._log_in_doubt:
            # After a failed sync, the next one may succeed although the pages of the first were lost.
            with self._housekeeping:
                busy, left = self._copy_log("FULL")
            if busy or left:
                raise StorageError("the log is in use: it will be made durable later")
            self._log_in_doubt = False
            return
        try:
            self._folder.disk.sync(self._log)
        except BaseException:
            self._log_in_doubt = True
            raise

    @_as_storage_errors()
    def checkpoint(self) -> None:
        """Copy a long log into the database, during commits, then restart it.

        A growing log would delay each commit on file systems with a journal. While one of the files is moved or
        deleted, nothing is committed, because it would be lost.
        """
        disk = self._folder.disk
        self._gone = next((file for file, identity in self._files.items() if disk.identity(file) != identity), None)
        if self._gone is not None:
            raise StorageError(_gone(self._gone))
        if (disk.size(self._folder.log) or 0) > CHECKPOINT_BYTES:
            with self._housekeeping:
                for mode in ("PASSIVE", "RESTART"):  # the second has little left to copy
                    self._copy_log(mode)

    def bytes_used(self) -> int:
        """The size of the database and its log in bytes."""
        return sum(self._folder.disk.size(file) or 0 for file in (self._folder.database, self._folder.log))

    def _copy_log(self, mode: str) -> tuple[int, int]:
        """Copy the log into the database. Returns whether another process prevented it, and the pages left."""
        busy, pages, copied = self._checkpointer.execute(f"PRAGMA wal_checkpoint({mode})").fetchone()
        return busy, pages - copied

    # Opening

    def _examined(self, stack: ExitStack, own: Totals | None, progress: Progress) -> tuple[Findings, int]:
        """Examine the database, and return its format. A missing database is created; otherwise nothing is changed.

        The last connection to close deletes the log, unless it is read-only. A log that is missing while the database
        file is marked as in use counts as lost. The read-only connection opened here therefore outlives all others,
        unless the database has been marked as stopped.
        """
        if not self._folder.disk.size(self._folder.database):
            self._make_database()
        connection = self._guard = stack.enter_context(closing(self._folder.connect(Access.READ)))
        version = format_of(connection, self._folder.database)
        if version == 0:  # a server was killed before it created the tables
            self._make_database()
            version = FORMAT
        connection.execute("BEGIN")
        findings = examine(connection, version, own, progress)
        connection.execute("ROLLBACK")
        return findings, version

    def _make_database(self) -> None:
        with closing(self._connect_writer()) as connection:
            connection.execute("BEGIN IMMEDIATE")
            make_tables(connection)
            connection.execute("COMMIT")

    def _load(self, findings: Findings, version: int) -> None:
        """Migrate and repair the database, and mark it as in use."""
        connection = self._writer = self._connect_writer()
        connection.execute("PRAGMA synchronous = FULL")
        self._ledger = findings.ledger
        connection.execute("BEGIN IMMEDIATE")
        if version < FORMAT:
            migrate(connection, version, findings.ledger, findings.starts)
        elif not findings.both_totals:
            renew_totals(connection, findings.ledger.totals)
        connection.execute("COMMIT")
        self._write(Group(self._in_mode(MODES[self._durability]), findings.repairs))
        self._set_synchronous(connection)

    def _in_mode(self, mode: int) -> Ledger:
        self._ledger.totals = self._ledger.totals._replace(mode=mode)
        return self._ledger

    def _restart_log(self, own: Totals | None) -> None:
        """Write the mark into the database file itself, and leave no failed frames after the end of the log."""
        self._checkpointer.execute(f"PRAGMA busy_timeout = {START_PATIENCE_MS}")
        busy, _ = self._copy_log("RESTART")
        # A backup may have begun while the previous server ran: then the file already has the mark.
        if busy and (own is None or own.mode == STOPPED):
            raise LockedError(f"another process reads {self._folder.database}: wait until it has finished")
        self._checkpointer.execute(f"PRAGMA busy_timeout = {PATIENCE_MS}")

    def _connect_writer(self) -> sqlite3.Connection:
        connection = self._folder.connect(Access.WRITE)
        try:
            connection.execute(f"PRAGMA page_size = {PAGE_BYTES}")
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA wal_autocheckpoint = 0")
            connection.execute(f"PRAGMA journal_size_limit = {LONGEST_LOG_BYTES}")
            connection.execute("PRAGMA secure_delete = OFF")
            self._set_synchronous(connection)
        except BaseException:
            connection.close()
            raise
        return connection

    def _connect_reader(self) -> sqlite3.Connection:
        """A connection that has read once, so that its files are open."""
        connection = self._folder.connect(Access.READ)
        try:
            connection.execute("SELECT id FROM totals").fetchone()
        except BaseException:
            connection.close()
            raise
        return connection

    def _set_synchronous(self, connection: sqlite3.Connection) -> None:
        connection.execute(f"PRAGMA synchronous = {SYNCHRONOUS[self._durability]}")

    def _disconnect(self) -> None:
        """Close the connection, which also ends its transaction."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def _prefixed(self, note: str) -> str:
        return f"{self._folder.database}: {note}"


def _not_committed(error: BaseException) -> NotCommittedError:
    if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL:
        return NotCommittedError("the disk is full: free some space, and writes are accepted again", full=True)
    return NotCommittedError(f"nothing was written: {words(error)}")


def _gone(file: Path) -> str:
    return f"{file} was moved or deleted under the server: put it back, or restart the server"
