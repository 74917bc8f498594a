"""Everything that the storage asks of the operating system: a test may put another disk here."""

import fcntl
import os
import sqlite3
from enum import StrEnum
from pathlib import Path
from typing import IO


class Access(StrEnum):
    """How a database is opened.

    WRITE: to read and to write; it is made where it is missing. READ: nothing is changed, not even when it is closed.
    RAW: as READ, of the database's file alone, as if it had no log.
    """

    WRITE = "mode=rwc"
    READ = "mode=ro"
    RAW = "mode=ro&immutable=1"


class Disk:
    """The machine's own disk."""

    def make(self, folder: Path) -> None:
        """Make a folder where it is missing."""
        folder.mkdir(parents=True, exist_ok=True)

    def lock(self, file: Path) -> IO[str] | None:
        """Take a lock, held until the file is closed; None where somebody else holds it."""
        opened = file.open("a")
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            opened.close()
            return None
        return opened

    def size(self, file: Path) -> int | None:
        """Bytes of a file, None where there is none. Takes no descriptor."""
        try:
            return file.stat().st_size
        except FileNotFoundError:
            return None

    def identity(self, file: Path) -> tuple[int, int] | None:
        """What tells a file from another one that is put in its place, None where there is none."""
        try:
            stat = file.stat()
        except FileNotFoundError:
            return None
        return stat.st_dev, stat.st_ino

    def open(self, file: Path) -> IO[bytes]:
        """A file to read, or to `sync`."""
        return file.open("rb")

    def sync(self, file: IO[bytes]) -> None:
        """Make a file durable."""
        os.fsync(file.fileno())

    def connect(self, database: Path, access: Access) -> sqlite3.Connection:
        """A connection to a database, for any thread, one at a time."""
        address = f"{database.absolute().as_uri()}?{access.value}"
        return sqlite3.connect(address, uri=True, isolation_level=None, check_same_thread=False, timeout=30)
