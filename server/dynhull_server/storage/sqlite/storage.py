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
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from threading import Lock

from ...state.changes import Change
from ...state.errors import words
from ...state.records import CommitStamp
from ..durability import Durability
from ..opening import closed_on_error
from ..port import DamagedError, LockedError, NotCommittedError, Progress, StorageError, StorageStep, StoredContents
from ..refusals import Meaning
from ..rows.chunks import CHUNK_BYTES
from ..rows.examine import Findings
from ..rows.group import Chunk, Group, Wipe
from ..rows.incarnation import new_incarnation
from ..rows.ledger import Ledger
from ..rows.storage import RowStorage
from ..rows.tables import FORMAT
from ..rows.totals import MODES, STOPPED, Totals, totals_from
from ..segments.archive import Archive
from .disk import LOCK_SECONDS, Disk, OpenMode
from .examination import examine, format_of, loaded
from .folder import Folder
from .migration import begin_anew, make_tables, migrate
from .origin import is_copied, note
from .readers import Readers, SQLiteReader
from .refusals import meaning_of
from .schema import PAGE_BYTES, UPDATE_TOTALS, carry_out, renew_totals

CHECKPOINT_BYTES = 16 * 2**20  # the size of the log that starts a checkpoint
LONGEST_LOG_BYTES = 64 * 2**20  # a longer log is truncated when it restarts
START_PATIENCE_MS = 1000  # waiting for others at the start, before it is tried anew
PATIENCE_MS = 10  # waiting for writers and readers before the log restarts; meanwhile no commit begins

SYNCHRONOUS = {Durability.SYNC: "FULL", Durability.INTERVAL: "NORMAL", Durability.NONE: "OFF"}

IS_COPY = (
    "it is a copy of the file that was served last, and may lack what was committed since: hulls and fences have other "
    "uids, fences begin with who is inside, and writers with numbers that it lacks end with RESTORED"
)

# A write failed, so no complete frame has a commit mark.
NOTHING_WRITTEN = (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE)


@contextmanager
def _as_storage_errors() -> Iterator[None]:
    """Convert errors of SQLite, whose cause is the disk or the data on it, to StorageError."""
    try:
        yield
    except sqlite3.Error as error:
        raise StorageError(str(error), meaning=meaning_of(error)) from error


class SQLiteStorage(RowStorage):
    """Hulls in a folder.

    Args:
        path: the folder, created if it is missing.
        durability: the durability of a commit.
        disk: the disk it is on.
        incarnation: makes it another incarnation, whether it is a copy or not; None only if it is one.
        archive: has what the journal drops of hulls with a history; None for a server that reads and writes none of it.
    """

    def __init__(
        self,
        path: Path,
        durability: Durability = Durability.SYNC,
        disk: Disk | None = None,
        incarnation: str | None = None,
        archive: Archive | None = None,
    ) -> None:
        super().__init__(archive)
        self._folder = Folder(path, disk or Disk())
        self._durability = durability
        self._incarnation = incarnation
        self._writer: sqlite3.Connection | None = None
        self._housekeeping = Lock()
        self._log_in_doubt = False
        self._gone: Path | None = None
        self._open = ExitStack()

    # Opening and closing

    def open(self, progress: Progress) -> StoredContents:
        """Examine the folder, repair what can be repaired, and load it."""
        with ExitStack() as stack:
            try:
                self._folder.disk.make(self._folder.path)
                stack.enter_context(self._folder.held())
                notes, own = self._folder.check_log()
                findings, version = self._examined(stack, own, progress)
                if findings.fatal:
                    raise DamagedError(f"{self._folder.database}: {'; '.join(findings.fatal)}: restore a backup")
                stack.callback(self._disconnect)
                self._load(findings, version)
                killed = own is not None and own.mode != STOPPED
                self._wiping = self._erased = killed and any(hull.erasures for hull in self._ledger.hulls.values())
                self._checkpointer = stack.enter_context(closing(self._folder.connect(OpenMode.WRITE)))
                self._restart_log(own)
                self._readers = stack.enter_context(closing(Readers(self._connect_reader)))
                self._log = stack.enter_context(self._folder.disk.open(self._folder.log))
                self._files = {
                    file: self._folder.disk.identity(file) for file in (self._folder.database, self._folder.log)
                }
            except sqlite3.OperationalError as error:
                message = f"{self._folder.database} cannot be opened: {error}"
                raise StorageError(message, meaning=meaning_of(error)) from error
            except sqlite3.Error as error:
                raise DamagedError(
                    f"{self._folder.database} cannot be read as a database ({error}): restore a backup"
                ) from error
            except OSError as error:
                if meaning_of(error) is Meaning.FINAL:
                    raise
                raise StorageError(f"{self._folder.path}: {words(error)}", meaning=meaning_of(error)) from error
            self._open = stack.pop_all()
        return self._contents([*notes, *(self._prefixed(note) for note in findings.notes)])

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
    def commit(self, changes: Sequence[Change | StorageStep], now: int = 0) -> CommitStamp:
        """Commit all of the changes or none."""
        if self._gone is not None and not self._unsettled:
            raise NotCommittedError(_gone(self._gone))
        group = self._group(changes, now)
        self._write(group)
        return group.commit

    @_as_storage_errors()
    def settle(self) -> CommitStamp:
        """Decide the outcome of the last commit, as described at the top of this file."""
        if not self._unsettled:
            return self._latest
        self._disconnect()
        connection = self._writer = self._connect_writer()
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("BEGIN IMMEDIATE")
        totals, _ = totals_from(SQLiteReader(connection).totals())
        if totals is None:
            raise DamagedError(f"{self._folder.database}: the totals are damaged: restore a backup")
        connection.execute(UPDATE_TOTALS, totals._replace(commits=totals.commits + 1).row)
        connection.execute("COMMIT")
        self._set_synchronous(connection)
        with self._housekeeping:
            self._copy_log("RESTART")  # if possible; otherwise the failed frames stay after the end of the log
        connection.execute("BEGIN")
        findings = loaded(connection)
        connection.execute("COMMIT")
        self._renew(findings)
        return self._latest

    def _write(self, group: Group) -> None:
        connection = self._writer
        try:
            if connection is None:
                connection = self._writer = self._connect_writer()
            if group.wipes:
                self._begin_log_anew(connection)
            connection.execute("BEGIN IMMEDIATE")
            carry_out(connection, group.statements)
            connection.execute(UPDATE_TOTALS, group.totals.row)
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
        if group.wipes:
            connection.execute(f"PRAGMA journal_size_limit = {LONGEST_LOG_BYTES}")

    def _begin_log_anew(self, connection: sqlite3.Connection) -> None:
        """Have the next commit be the first one in the log, which ends after it.

        A log that is cut before would be one that was lost, if the process ended then. While another process reads the
        log it goes on as it is.
        """
        with self._housekeeping:
            busy, left = self._copy_log("RESTART")
        self._wiping = bool(busy or left)
        if not self._wiping:
            connection.execute("PRAGMA journal_size_limit = 0")

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

    def entitled(self) -> bool:
        """True: the folder is locked."""
        return True

    @property
    def _place(self) -> str:
        return str(self._folder.database)

    @contextmanager
    def _lend(self) -> Iterator[SQLiteReader]:
        with _as_storage_errors(), self._readers.lend() as connection:
            yield SQLiteReader(connection)

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

    def _confirm(self) -> None:
        self.sync()

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

    @_as_storage_errors()
    def _wipe(self) -> Iterator[StorageStep]:
        """Write over what is free in the database: then the log alone has it, which begins anew once it is copied."""
        if self._erased:
            self._wiping = True
            yield from self._write_over_free_pages()
            self._erased = False
        with self._housekeeping:
            self._copy_log("PASSIVE")
        yield Wipe()

    def _write_over_free_pages(self) -> Iterator[StorageStep]:
        """Take the free pages for zeros, as chunks of a snapshot that nobody ends, and give them back.

        To write over each page where it is dropped would be a third more for the disk, for all who erase nothing.
        """
        snapshot = next(self._ledger.snapshot_ids)
        places = self._under_way[snapshot] = set()
        try:
            while free := self._free_pages():
                places.add(place := next(self._ledger.chunk_ids))
                yield Chunk(place, snapshot, len(places) - 1, bytes(min(free * PAGE_BYTES, CHUNK_BYTES)))
        finally:
            del self._under_way[snapshot]
        self._look_for_dead_chunks()
        yield from self._drop_dead("chunks")

    def _free_pages(self) -> int:
        with self._housekeeping:
            return int(self._checkpointer.execute("PRAGMA freelist_count").fetchone()[0])

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
        connection = self._guard = stack.enter_context(closing(self._folder.connect(OpenMode.READ, START_PATIENCE_MS)))
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
        connection.execute(f"PRAGMA busy_timeout = {START_PATIENCE_MS}")
        connection.execute("PRAGMA synchronous = FULL")
        self._ledger = findings.ledger
        connection.execute("BEGIN IMMEDIATE")
        if version < FORMAT:
            migrate(connection, version, findings.ledger, findings.starts)
        elif not findings.both_totals:
            renew_totals(connection, findings.ledger.totals)
        connection.execute("COMMIT")
        self._write(Group(self._in_mode(MODES[self._durability]), findings.repairs))
        if (self._ledger.hulls or self._ledger.fences) and (self._incarnation or is_copied(self._folder)):
            connection.execute("BEGIN IMMEDIATE")
            begin_anew(connection, self._ledger, self._incarnation or new_incarnation())
            connection.execute("COMMIT")
            findings.notes.append(IS_COPY)
        note(self._folder)
        connection.execute(f"PRAGMA busy_timeout = {1000 * LOCK_SECONDS}")
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
            message = f"another process reads {self._folder.database}: wait until it has finished"
            raise LockedError(message, meaning=Meaning.PASSES)
        self._checkpointer.execute(f"PRAGMA busy_timeout = {PATIENCE_MS}")

    def _connect_writer(self) -> sqlite3.Connection:
        connection = self._folder.connect(OpenMode.WRITE)
        with closed_on_error(connection):
            connection.execute(f"PRAGMA page_size = {PAGE_BYTES}")
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA wal_autocheckpoint = 0")
            connection.execute(f"PRAGMA journal_size_limit = {LONGEST_LOG_BYTES}")
            connection.execute("PRAGMA secure_delete = FAST")  # in pages that are written anyway
            self._set_synchronous(connection)
        return connection

    def _connect_reader(self) -> sqlite3.Connection:
        """A connection that has read once, so that its files are open."""
        connection = self._folder.connect(OpenMode.READ)
        with closed_on_error(connection):
            connection.execute("SELECT id FROM totals").fetchone()
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
        message = "the disk is full: free some space, and writes are accepted again"
        return NotCommittedError(message, full=True, meaning=meaning_of(error))
    return NotCommittedError(f"nothing was written: {words(error)}", meaning=meaning_of(error))


def _gone(file: Path) -> str:
    return f"{file} was moved or deleted under the server: put it back, or restart the server"
