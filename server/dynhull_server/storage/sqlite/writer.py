"""Group commit: one thread writes, and whatever arrives while a commit is under way shares the next."""

import os
import sqlite3
import threading
from concurrent.futures import Future
from enum import StrEnum
from time import monotonic
from typing import Any

from .errors import JournalError, JournalFullError
from .folder import Folder

LONGEST_LOG_BYTES = 64 * 2**20  # kept when the log is begun anew
SYNC_INTERVAL = 0.1  # seconds, for Durability.INTERVAL

Statement = tuple[str, tuple[Any, ...]]


class Durability(StrEnum):
    """What an acknowledgement promises. A batch is whole or absent in every case.

    SYNC: it is on the disk, and survives a power failure. INTERVAL: it survives the end of the process at once, a power
    failure after a tenth of a second. NONE: it survives the end of the process at once, a power failure when the
    operating system chooses.
    """

    SYNC = "sync"
    INTERVAL = "interval"
    NONE = "none"


class Writer:
    """Commits statements in the order they come; those of one `write` together."""

    def __init__(self, folder: Folder, durability: Durability) -> None:
        self._durability = durability
        self._log = folder.log
        self._connection = folder.connect()
        level = "FULL" if durability is Durability.SYNC else "NORMAL" if durability is Durability.INTERVAL else "OFF"
        self._connection.execute(f"PRAGMA synchronous = {level}")
        self._connection.execute("PRAGMA wal_autocheckpoint = 0")  # the journal has a thread for it
        self._connection.execute(f"PRAGMA journal_size_limit = {LONGEST_LOG_BYTES}")
        self._turn = threading.Condition()
        self._waiting: list[tuple[list[Statement], Future[None]]] = []
        self._closing = False
        self._unsynced_since: float | None = None
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def write(self, statements: list[Statement]) -> Future[None]:
        """Commit the statements. The future fails with JournalFullError where there is no room on the disk."""
        done: Future[None] = Future()
        with self._turn:
            if self._closing:
                raise JournalError("the journal is closed")
            self._waiting.append((statements, done))
            self._turn.notify()
        return done

    def close(self) -> None:
        """Commit what waits, and stop."""
        with self._turn:
            self._closing = True
            self._turn.notify()
        self._thread.join()
        self._connection.close()

    def _run(self) -> None:
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._waiting or self._closing, self._patience())
                group, self._waiting = self._waiting, []
                if not group and self._closing:
                    break
            if group:
                self._commit(group)
            if self._patience() == 0.0:
                self._sync()
        if self._unsynced_since is not None:
            self._sync()

    def _commit(self, group: list[tuple[list[Statement], Future[None]]]) -> None:
        try:
            self._transaction(statement for statements, _ in group for statement in statements)
        except sqlite3.Error as error:
            if len(group) == 1:
                group[0][1].set_exception(_journal_error(error))
            else:  # one too large for the disk must not take the small ones with it
                for one in group:
                    self._commit([one])
            return
        if self._durability is Durability.INTERVAL and self._unsynced_since is None:
            self._unsynced_since = monotonic()
        for _, done in group:
            done.set_result(None)

    def _transaction(self, statements: Any) -> None:
        execute = self._connection.execute
        try:
            execute("BEGIN IMMEDIATE")
            for sql, parameters in statements:
                execute(sql, parameters)
            execute("COMMIT")
        except sqlite3.Error:
            if self._connection.in_transaction:
                execute("ROLLBACK")
            raise

    def _patience(self) -> float | None:
        """Seconds until the log must be synced; None where it need not be."""
        if self._unsynced_since is None:
            return None
        return max(0.0, self._unsynced_since + SYNC_INTERVAL - monotonic())

    def _sync(self) -> None:
        self._unsynced_since = None
        descriptor = os.open(self._log, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _journal_error(error: sqlite3.Error) -> JournalError:
    if error.sqlite_errorcode in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE):
        return JournalFullError("the disk is full: make room, and writes are taken again")
    return JournalError(f"the journal could not be written: {error}")
