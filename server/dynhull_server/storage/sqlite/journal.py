"""The journal: every acknowledged batch, snapshots of points, and what they make of a restart."""

import sqlite3
import threading
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path

from . import recovery, snapshots
from .folder import Folder
from .records import Points, Record, checksum, encode
from .recovery import Recovered
from .wal import check_log
from .writer import Durability, Statement, Writer

NEWEST = 2**62

CHECKPOINT_BYTES = 16 * 2**20  # of log, before it is copied into the database
CHECKPOINT_SECONDS = 0.25
PATIENCE_MS = 10  # for writers and readers, before the log is begun anew; meanwhile no commit begins


@dataclass(frozen=True, slots=True)
class HullRow:
    """A hull the journal knows.

    Attributes:
        number: the journal's number for it.
        name: its name.
        created: seconds since 1970.
        config: its configuration, as the engine encodes it.
    """

    number: int
    name: str
    created: float
    config: bytes


class Journal:
    """An open journal in a folder.

    Args:
        path: the folder, made where it is missing.
        durability: what an acknowledgement promises.

    Raises:
        JournalError: the folder cannot be used; the message says why and what to do.

    Attributes:
        notes: what was lost at the end of the journal, in words; empty where nothing was.
    """

    def __init__(self, path: Path, durability: Durability = Durability.SYNC) -> None:
        self._folder = Folder(path)
        self.notes: list[str] = []
        try:
            lost = check_log(self._folder.log)
            if lost:
                self.notes.append(lost)
            self._folder.prepare()
            self._writer = Writer(self._folder, durability)
        except BaseException:
            self._folder.close()
            raise
        with self._reading() as connection:
            (highest,) = connection.execute("SELECT max(id) FROM hulls").fetchone()
        self._next_hull = (highest or 0) + 1
        self._numbering = threading.Lock()
        self._snapshotting = threading.Lock()  # trimming takes the chunks of unfinished snapshots for orphans
        self._closing = threading.Event()
        self._checkpointer = threading.Thread(target=self._checkpoint, name="checkpoint", daemon=True)
        self._checkpointer.start()

    # Reading, at start-up

    def hulls(self) -> list[HullRow]:
        """The hulls, in the order of their names."""
        with self._reading() as connection:
            rows = connection.execute("SELECT id, name, created, config FROM hulls ORDER BY name")
            return [HullRow(*row) for row in rows]

    def size(self) -> int:
        """How many bytes of batches and snapshots `recover` will read, of all hulls together."""
        with self._reading() as connection:
            query = "SELECT (SELECT total(length(payload)) FROM batches) + (SELECT total(length(points)) FROM chunks)"
            return int(connection.execute(query).fetchone()[0])

    def recover(self, number: int, until: int = NEWEST) -> Recovered:
        """A hull's newest good snapshot and the batches after it, up to a revision.

        What had to be left out is in `notes`.

        Raises:
            JournalDamagedError: something in the middle is damaged.
        """
        with self._reading() as connection:
            recovered = recovery.recover(connection, number, until)
        self.notes += recovered.notes
        if recovered.cut_from is not None:
            self._writer.write(
                [("DELETE FROM batches WHERE hull = ? AND first >= ?", (number, recovered.cut_from))]
            ).result()
        return recovered

    def oldest(self, number: int) -> int:
        """The oldest revision of a hull that `recover` can go back to."""
        query = "SELECT revision FROM snapshots WHERE hull = ? ORDER BY revision DESC LIMIT 1 OFFSET ?"
        with self._reading() as connection:
            row = connection.execute(query, (number, snapshots.KEPT - 1)).fetchone()
        return 0 if row is None else int(row[0])

    # Writing

    def new_row(self, name: str, created: float, config: bytes) -> HullRow:
        """A row for a new hull, not yet written."""
        with self._numbering:
            number = self._next_hull
            self._next_hull += 1
        return HullRow(number, name, created, config)

    def create(self, row: HullRow) -> Future[None]:
        """Commit a new hull. A row that is there already is left as it is."""
        return self._writer.write([_creation(row)])

    def delete(self, number: int) -> Future[None]:
        """Forget a hull. Its batches and snapshots go with it."""
        chunks = "DELETE FROM chunks WHERE snapshot IN (SELECT id FROM snapshots WHERE hull = ?)"
        tables = ["DELETE FROM snapshots WHERE hull = ?", "DELETE FROM batches WHERE hull = ?"]
        return self._writer.write([(sql, (number,)) for sql in [chunks, *tables, "DELETE FROM hulls WHERE id = ?"]])

    def append(self, number: int, records: Sequence[Record], new: HullRow | None = None) -> Future[None]:
        """Commit batches of consecutive revisions, of a `new` hull together with its row.

        The future fails with JournalFullError where there is no room on the disk.
        """
        first, last = records[0].revision, records[-1].revision
        payload = encode(records)
        values = (number, first, last, checksum(payload, number, first, last), payload)
        sql = "INSERT INTO batches (hull, first, last, checksum, payload) VALUES (?, ?, ?, ?, ?)"
        return self._writer.write([*([] if new is None else [_creation(new)]), (sql, values)])

    def snapshot(self, number: int, revision: int, points: Points, state: bytes) -> None:
        """Write a snapshot beside the traffic, then trim what two snapshots make superfluous. Returns when it is done.

        Args:
            number: the hull's number.
            revision: the revision of the points.
            points: (n, 2) points with multiplicity.
            state: what else the engine wants back after a restart.
        """
        with self._snapshotting, self._reading() as connection:
            snapshots.write(self._writer, connection, number, revision, points, state)

    def bytes_used(self) -> int:
        """What the journal takes on the disk."""
        return self._folder.bytes_used()

    def close(self) -> None:
        """Commit what waits, and let others have the folder."""
        self._closing.set()
        self._checkpointer.join()
        self._writer.close()
        self._folder.close()

    def _reading(self) -> "_Reading":
        return _Reading(self._folder)

    def _checkpoint(self) -> None:
        """Copy the log into the database from a thread of its own: commits go on meanwhile.

        Then begin the log anew. One that grows makes every commit wait where the file system writes its own journal.
        """
        with self._reading() as connection:
            connection.execute(f"PRAGMA busy_timeout = {PATIENCE_MS}")
            while not self._closing.wait(CHECKPOINT_SECONDS):
                if self._folder.log_bytes() > CHECKPOINT_BYTES:
                    for mode in ("PASSIVE", "RESTART"):  # for the second, little is left to copy
                        connection.execute(f"PRAGMA wal_checkpoint({mode})").fetchall()


def _creation(row: HullRow) -> Statement:
    sql = "INSERT OR IGNORE INTO hulls (id, name, created, config) VALUES (?, ?, ?, ?)"
    return sql, (row.number, row.name, row.created, row.config)


class _Reading:
    """A connection for a while."""

    def __init__(self, folder: Folder) -> None:
        self._folder = folder

    def __enter__(self) -> sqlite3.Connection:
        self._connection = self._folder.connect()
        return self._connection

    def __exit__(self, *_: object) -> None:
        self._connection.close()
