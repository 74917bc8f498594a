"""Copies of a journal, and looks into one, beside a server that may be running on it."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from .errors import JournalDamagedError, JournalError
from .folder import APPLICATION_ID, DATABASE, FORMAT
from .journal import NEWEST, HullRow
from .recovery import Recovered, recover

PAGES_A_STEP = 256

Progress = Callable[[int, int], None]


def back_up(folder: Path, target: Path, progress: Progress) -> None:
    """Make a new folder with a consistent copy of a journal, as of one moment.

    Args:
        folder: the journal's; a server may be writing to it.
        target: the new folder.
        progress: called with pages done and pages in all.

    Raises:
        JournalError: there is no journal in the folder, or the target is there already.
    """
    with _opened(folder) as connection:
        try:
            target.mkdir(parents=True)
        except FileExistsError:
            raise JournalError(f"{target} is there already: name a folder that is not") from None
        with closing(sqlite3.connect(target / DATABASE)) as copy:
            connection.backup(
                copy, pages=PAGES_A_STEP, progress=lambda _, remaining, total: progress(total - remaining, total)
            )


def hulls(folder: Path) -> list[HullRow]:
    """The hulls of a journal, in the order of their names."""
    with _opened(folder) as connection:
        return [
            HullRow(*row) for row in connection.execute("SELECT id, name, created, config FROM hulls ORDER BY name")
        ]


def look(folder: Path, number: int) -> Recovered:
    """A hull's newest good snapshot and the batches after it, as of the last commit.

    Raises:
        JournalDamagedError: a batch that others follow is damaged.
    """
    with _opened(folder) as connection:
        connection.execute("BEGIN")  # all of it from one moment
        return recover(connection, number, NEWEST)


@contextmanager
def _opened(folder: Path) -> Iterator[sqlite3.Connection]:
    database = folder / DATABASE
    if not database.exists():
        raise JournalError(f"{folder} holds no hulls: there is no {DATABASE} in it")
    with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True, isolation_level=None)) as connection:
        try:
            (application,) = connection.execute("PRAGMA application_id").fetchone()
            (version,) = connection.execute("PRAGMA user_version").fetchone()
        except sqlite3.DatabaseError as error:
            raise JournalDamagedError(f"{database} is no readable database ({error}): restore a backup") from error
        if application != APPLICATION_ID or version > FORMAT:
            raise JournalError(f"{database} was written by another program, or by a newer dynhull")
        yield connection
