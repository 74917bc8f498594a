"""The folder of a server's data: one SQLite database in WAL mode, and a lock that only one server holds."""

import fcntl
import sqlite3
from pathlib import Path

from .errors import JournalFormatError, JournalLockedError

DATABASE = "dynhull.db"
LOCK = "dynhull.lock"
APPLICATION_ID = 0x64796E68  # "dynh"
FORMAT = 1
PAGE_BYTES = 8192  # a batch of many points spans few pages, and wastes half of one

SCHEMA = """
CREATE TABLE hulls (
    id INTEGER PRIMARY KEY,
    name TEXT NOT NULL UNIQUE,
    created REAL NOT NULL,
    config BLOB NOT NULL
);
-- Consecutive batches of one hull that shared a commit: revisions first to last.
CREATE TABLE batches (
    hull INTEGER NOT NULL,
    first INTEGER NOT NULL,
    last INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    payload BLOB NOT NULL
);
CREATE UNIQUE INDEX batches_by_revision ON batches (hull, first);
-- A snapshot counts once its row is here; its chunks come before.
CREATE TABLE snapshots (
    id INTEGER PRIMARY KEY,
    hull INTEGER NOT NULL,
    revision INTEGER NOT NULL,
    chunks INTEGER NOT NULL,
    state BLOB NOT NULL,
    checksum INTEGER NOT NULL
);
CREATE TABLE chunks (
    snapshot INTEGER NOT NULL,
    number INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    points BLOB NOT NULL
);
CREATE UNIQUE INDEX chunks_by_number ON chunks (snapshot, number);
"""

# From each older format to the next: none yet.
MIGRATIONS: dict[int, str] = {}


class Folder:
    """A data folder, held by one process at a time.

    Raises:
        JournalLockedError: another server holds it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        path.mkdir(parents=True, exist_ok=True)
        self._lock = (path / LOCK).open("a")  # held as long as it is open
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise JournalLockedError(
                f"another server works on {path}: stop it first, or choose another folder with --data"
            ) from None

    @property
    def database(self) -> Path:
        """The database's file."""
        return self.path / DATABASE

    @property
    def log(self) -> Path:
        """The database's write-ahead log."""
        return self.path / f"{DATABASE}-wal"

    def log_bytes(self) -> int:
        """The size of the write-ahead log."""
        return self.log.stat().st_size if self.log.exists() else 0

    def connect(self) -> sqlite3.Connection:
        """A connection for one thread at a time."""
        connection = sqlite3.connect(self.database, isolation_level=None, check_same_thread=False, timeout=30)
        connection.execute("PRAGMA journal_mode = WAL")
        return connection

    def bytes_used(self) -> int:
        """What the database and its write-ahead log take on the disk."""
        return sum(file.stat().st_size for file in self.path.glob(f"{DATABASE}*"))

    def close(self) -> None:
        """Let others have the folder."""
        self._lock.close()

    def prepare(self) -> None:
        """Make the database, or bring an older one to this format.

        Raises:
            JournalFormatError: a newer server wrote it, or it is another program's.
        """
        connection = sqlite3.connect(self.database, isolation_level=None)
        try:
            (application,) = connection.execute("PRAGMA application_id").fetchone()
            (version,) = connection.execute("PRAGMA user_version").fetchone()
            (tables,) = connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()
            if tables == 0:
                connection.execute(f"PRAGMA page_size = {PAGE_BYTES}")
                connection.execute("PRAGMA journal_mode = WAL")
                self._run(connection, SCHEMA, FORMAT)
                return
            if application != APPLICATION_ID:
                raise JournalFormatError(f"{self.database} is the database of another program: choose another folder")
            if version > FORMAT:
                raise JournalFormatError(
                    f"{self.database} has format {version}, this server knows formats up to {FORMAT}: "
                    "run the newer version of dynhull that wrote it"
                )
            for step in range(version, FORMAT):
                self._run(connection, MIGRATIONS[step], step + 1)
        except sqlite3.DatabaseError as error:
            raise JournalFormatError(f"{self.database} is no readable database ({error}): restore a backup") from error
        finally:
            connection.close()

    @staticmethod
    def _run(connection: sqlite3.Connection, script: str, version: int) -> None:
        """All of a script, or none of it."""
        connection.executescript(
            f"BEGIN; {script} PRAGMA application_id = {APPLICATION_ID}; PRAGMA user_version = {version}; COMMIT;"
        )
