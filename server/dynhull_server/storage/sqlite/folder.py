"""The data folder of a server: one SQLite database in WAL mode, its log, and a lock held by one process."""

import sqlite3
from collections.abc import Iterator
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from pathlib import Path

from ..opening import closed_on_error
from ..port import DamagedError, FormatError, LockedError, StorageError
from ..rows.tables import UnreadableError
from ..rows.totals import Totals, totals_from
from .disk import Disk, OpenMode
from .log import check_log
from .log_index import read_index
from .readers import SQLiteReader

DATABASE = "dynhull.db"
LOCK = "dynhull.lock"
# A copy has this name until it is complete.
UNFINISHED = "unfinished.db"
UNFINISHED_WORDS = "is an unfinished copy: remove it, and copy again"

NEXT_START = "the server that runs does not read its log again, but the next one would find"
CACHE_KILOBYTES = 2000
# How often a log in use is read until it has not begun anew in between.
ATTEMPTS = 100


class Folder:
    """A data folder.

    Args:
        path: its path.
        disk: the disk it is on.

    Attributes:
        database: the database file.
        log: the database's write-ahead log.
        index: the index of the log, while a server uses it.

    Raises:
        StorageError: the path is that of a file.
    """

    def __init__(self, path: Path, disk: Disk) -> None:
        if path.is_file():
            raise StorageError(f"{path} is a file, not a data folder")
        self.path = path
        self.disk = disk
        self.database = path / DATABASE
        self.log = path / f"{DATABASE}-wal"
        self.index = path / f"{DATABASE}-shm"

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the lock. LockedError if another process holds it."""
        lock = self.disk.lock(self.path / LOCK)
        if lock is None:
            raise LockedError(
                f"another server or command uses {self.path}: stop it first, or choose another folder with --data"
            )
        with lock:
            yield

    @contextmanager
    def alone(self) -> Iterator[bool]:
        """Yields whether no server uses the folder; none can start before the end of the block."""
        file = self.path / LOCK
        try:
            lock: AbstractContextManager[object] | None = (
                self.disk.lock(file) if self.disk.size(file) is not None else nullcontext()
            )
        except OSError:  # the folder is read-only: no server can use it
            lock = nullcontext()
        with lock or nullcontext():
            yield lock is not None

    def connect(self, access: OpenMode, lock_ms: int | None = None) -> sqlite3.Connection:
        """A connection, which waits that long for locks; by default as the disk says.

        The size of its cache is set here, because that in the header could be damaged.
        """
        connection = self.disk.connect(self.database, access)
        with closed_on_error(connection):
            try:
                if lock_ms is not None:
                    connection.execute(f"PRAGMA busy_timeout = {lock_ms}")
                connection.execute(f"PRAGMA cache_size = -{CACHE_KILOBYTES}")
                connection.execute("PRAGMA cell_size_check = ON")
                connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()
            except UnicodeDecodeError as error:  # SQLite's message quotes a damaged schema
                raise sqlite3.DatabaseError("malformed database schema") from error
        return connection

    def check_log(self) -> tuple[list[str], Totals | None]:
        """Examine the log before SQLite reads it, while no process writes.

        Returns messages about losses at its end, and the totals in the database file itself.

        Raises:
            FormatError: the folder is an unfinished copy.
            DamagedError: acknowledged batches are lost.
        """
        if self.disk.size(self.path / UNFINISHED) is not None:
            raise FormatError(f"{self.path} {UNFINISHED_WORDS}")
        own = self._own_totals()
        note = check_log(self.disk, self.log, own)
        return ([] if note is None else [note]), own

    def check_log_in_use(self) -> list[str]:
        """Examine the log as the next start would, while a server writes to it; what it writes now is left out.

        Not for a process that has the database open.

        Raises:
            StorageError: the log begins anew faster than it can be read.
            DamagedError: the next start would find that acknowledged batches are lost.
        """
        for _ in range(ATTEMPTS):
            before = read_index(self.disk, self.index)
            try:
                note = check_log(self.disk, self.log, self._own_totals(), before and (before.last or None))
                failure = None
            except DamagedError as error:
                note, failure = None, error
            after = read_index(self.disk, self.index)
            if before is None or after is None or not before.is_of_same_use(after):
                continue
            if failure is not None:
                raise DamagedError(f"{NEXT_START}: {failure}")
            return [] if note is None else [f"{NEXT_START}: {note}"]
        raise StorageError(f"the log of {self.path} changes faster than it can be read: try again, or stop the server")

    def _own_totals(self) -> Totals | None:
        """The totals in the database file, without its log; None if they cannot be read."""
        if not self.disk.size(self.database):
            if self.disk.size(self.log):
                raise DamagedError(f"{self.database} is missing or empty, but its log exists: restore a backup")
            return None
        try:
            with closing(self.connect(OpenMode.RAW)) as connection:
                return totals_from(SQLiteReader(connection).totals())[0]
        except (sqlite3.Error, UnreadableError):
            return None  # format 1, or damaged, which the examination reports
