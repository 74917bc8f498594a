"""What the disk refuses at the start of a server is waited for if it passes."""

import asyncio
import errno
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from forked import COMMAND
from logged_process import logged_process, require_service

from dynhull_server.starting import FIRST_PAUSE, started
from dynhull_server.storage.port import StorageError
from dynhull_server.storage.refusals import Meaning
from dynhull_server.storage.sqlite.refusals import meaning_of
from dynhull_server.storage.sqlite.storage import SQLiteStorage

SERVE = (COMMAND, "serve", "--port", "0", "--log-format", "json", "--scrub-cpu", "0", "--data")
FULL_DISK = 'mount -t tmpfs -o size=1m none "$0" && head -c 2M /dev/zero > "$0/ballast"; exec "$@"'


def test_a_database_that_another_program_has_locked(tmp_path: Path) -> None:
    storage = SQLiteStorage(tmp_path)
    storage.open(lambda *_: None)
    storage.close()
    with closing(sqlite3.connect(tmp_path / "dynhull.db", isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with logged_process([*SERVE, str(tmp_path)]) as logged:
            assert "database is locked" in logged.wait_for("cannot serve yet")["reason"]
            other.execute("ROLLBACK")
            require_service(logged)


def test_a_disk_that_is_full(tmp_path: Path) -> None:
    wrap = ["unshare", "--map-root-user", "--mount", "sh", "-c", FULL_DISK, str(tmp_path)]
    with logged_process([*wrap, *SERVE, str(tmp_path / "data")]) as logged:
        logged.wait_for("cannot serve yet")
        Path(f"/proc/{logged.process.pid}/root{tmp_path}/ballast").unlink()
        require_service(logged)


PASSES, DOUBTFUL, FINAL = Meaning


@pytest.mark.parametrize(
    ("code", "meaning"),
    [
        (sqlite3.SQLITE_BUSY_SNAPSHOT, PASSES),
        (sqlite3.SQLITE_FULL, PASSES),
        (sqlite3.SQLITE_CANTOPEN, DOUBTFUL),
        (sqlite3.SQLITE_IOERR_FSYNC, DOUBTFUL),
        (sqlite3.SQLITE_CORRUPT_VTAB, FINAL),
        (sqlite3.SQLITE_NOTADB, FINAL),
        (sqlite3.SQLITE_READONLY_DIRECTORY, FINAL),
        (sqlite3.SQLITE_CONSTRAINT_UNIQUE, FINAL),
    ],
)
def test_what_an_error_of_sqlite_means(code: int, meaning: Meaning) -> None:
    error = sqlite3.OperationalError("injected")
    error.sqlite_errorcode = code
    assert meaning_of(error) is meaning


@pytest.mark.parametrize(
    ("code", "meaning"), [(errno.ENOSPC, PASSES), (errno.EMFILE, PASSES), (errno.EIO, DOUBTFUL), (errno.EROFS, FINAL)]
)
def test_what_an_error_of_the_disk_means(code: int, meaning: Meaning) -> None:
    assert meaning_of(OSError(code, "injected")) is meaning


class Made:
    async def drain(self) -> None:
        drained.append(self)


drained: list[Made] = []


def test_the_patience_with_what_is_doubtful_begins_with_the_doubt() -> None:
    """As with a database that first shuts down, which takes longer, and then does not answer while it starts again."""
    refusals = [StorageError("shuts down", meaning=PASSES), StorageError("no answer", meaning=DOUBTFUL)]

    async def make() -> Made:
        return Made()

    async def start(_: Made) -> None:
        if refusals:
            raise refusals.pop(0)

    async def run() -> Made | None:
        return await started(make, start, asyncio.Event(), FIRST_PAUSE / 2)

    assert asyncio.run(run()) not in (None, *drained)
    assert len(drained) == 2
