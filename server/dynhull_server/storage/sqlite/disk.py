"""All calls of the storage to the operating system; a test may substitute another disk."""

import fcntl
import os
import sqlite3
from enum import StrEnum
from pathlib import Path
from typing import IO

from ..durable import write_durably
from .birth import birth

# Seconds that a statement waits for locks of other connections, unless the connection says otherwise.
LOCK_SECONDS = 30


class OpenMode(StrEnum):
    """The mode in which a database is opened.

    WRITE: for reading and writing; a missing database is created. READ: nothing is changed, not even on closing. RAW:
    as READ, but only the database file is read, as if it had no log.
    """

    WRITE = "mode=rwc"
    READ = "mode=ro"
    RAW = "mode=ro&immutable=1"


class Disk:
    """The machine's own disk."""

    def make(self, folder: Path) -> None:
        """Create a folder if it is missing."""
        folder.mkdir(parents=True, exist_ok=True)

    def lock(self, file: Path) -> IO[str] | None:
        """Take a lock, held until the file is closed; None if another process holds it."""
        opened = file.open("a")
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            opened.close()
            return None
        return opened

    def size(self, file: Path) -> int | None:
        """The size of a file in bytes, None if it does not exist. Uses no file descriptor."""
        try:
            return file.stat().st_size
        except FileNotFoundError:
            return None

    def identity(self, file: Path) -> tuple[int, int] | None:
        """A value that differs for another file under the same name; None if the file does not exist."""
        try:
            stat = file.stat()
        except FileNotFoundError:
            return None
        return stat.st_dev, stat.st_ino

    def birth(self, file: Path) -> int | None:
        """When a file was made, which another file under the same name does not share; None if that is not known."""
        return birth(file)

    def read(self, file: Path) -> bytes | None:
        """The content of a small file, None if it does not exist."""
        try:
            return file.read_bytes()
        except FileNotFoundError:
            return None

    def write(self, file: Path, content: bytes) -> None:
        """Give a small file this content, durably; after a crash it has this or the one before."""
        write_durably(file, content)

    def open(self, file: Path) -> IO[bytes]:
        """Open a file for reading, or for `sync`."""
        return file.open("rb")

    def sync(self, file: IO[bytes]) -> None:
        """Make a file durable."""
        os.fsync(file.fileno())

    def connect(self, database: Path, access: OpenMode) -> sqlite3.Connection:
        """A connection to a database, usable from any thread, by one at a time."""
        address = f"{database.absolute().as_uri()}?{access.value}"
        return sqlite3.connect(address, uri=True, isolation_level=None, check_same_thread=False, timeout=LOCK_SECONDS)
