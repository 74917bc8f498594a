"""Copying all rows between a data folder and a database.

Rows, checksums and totals are the same in both, so the copy is right if an examination of it finds the totals of the
source: they have the number and the sum of all rows.
"""

import logging
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path

from dynhull_server.storage.port import DamagedError, LockedError, Progress, StorageError
from dynhull_server.storage.rows.divided import DatabaseView, latest_epoch
from dynhull_server.storage.rows.examine import Findings
from dynhull_server.storage.rows.filed_check import bring_all, undone
from dynhull_server.storage.rows.tables import COLUMNS, Insert, Reader
from dynhull_server.storage.rows.totals import STOPPED
from dynhull_server.storage.segments.archive import HISTORY
from dynhull_server.storage.segments.objects import archive_at
from dynhull_server.storage.segments.place import is_store
from dynhull_server.storage.sqlite import copies
from dynhull_server.storage.worker_folders import parts_of, worker_folder, write_manifest

from ..shards.epochs import owner_of
from .database import Connection, Database, as_storage_errors
from .examination import examined
from .ownership import LOOK, Leases, Ownership, follow_owner
from .reader import PostgresReader
from .schema import INSERTED_BYTES, hold, partitions_of, prepare, put_totals, queries_of

log = logging.getLogger(__name__)

# Rows that are sent together, at most.
SENT_ROWS = 4096


@dataclass(slots=True)
class Moved:
    """What was copied.

    Attributes:
        source: the source, for people.
        target: the target, for people.
        hulls: the number of hulls.
        shards: the number of shards that some of them have.
        fences: the number of fences.
        notes: messages about what was lost or damaged in the source.
    """

    source: str
    target: str
    hulls: int = 0
    shards: int = 0
    fences: int = 0
    notes: list[str] = field(default_factory=list)

    def add(self, findings: Findings) -> None:
        """Count a part."""
        shards = sum(hull.row.settings.shard is not None for hull in findings.ledger.hulls.values())
        self.hulls += len(findings.ledger.hulls) - shards
        self.shards += shards
        self.fences += len(findings.ledger.fences)
        self.notes += findings.notes


def to_database(folder: Path, database: Database, progress: Progress, history: str | Path | None = None) -> Moved:
    """Copy a folder into a database, in one transaction.

    Args:
        folder: the folder, which no server may use.
        database: the database, without tables of dynhull.
        progress: called with the rows copied so far and the total.
        history: the folder for the past of the hulls in the database; None if there is none.

    Raises:
        StorageError: one of them cannot be used, or another database has its past in the folder for it.
        DamagedError: the folder cannot be served, or the copy differs from it.
    """
    moved = Moved(str(folder), str(database))
    parts = parts_of(folder)
    if history is not None:
        _require_apart(history, parts)
        archive_at(history).require_free()
    with (
        closing(database.connect("dynhull move")) as connection,
        as_storage_errors(),
        connection.transaction(),
        undone(history) as copies_files,  # not for an error of the commit itself: it may have taken place
    ):
        hold(connection, database)
        if partitions_of(connection, database) is not None:
            raise StorageError(f"{database} has tables of dynhull: create another database")
        prepare(connection, database, len(parts))
        epoch = 0
        for partition, part in enumerate(parts):
            with copies.reading(part, lambda *_: None) as (reader, findings):
                for rows in _together(_rows(reader, progress)):
                    for sql, values in queries_of(partition, rows):
                        connection.execute(sql, values)
                totals = findings.ledger.totals._replace(mode=STOPPED)
                copies_files(findings.ledger)
                bring_all(findings.ledger, part / HISTORY, history)
            put_totals(connection, partition, totals)
            copy = examined(connection, partition, lambda *_: None)
            _require_same(findings, copy, str(database))
            moved.add(findings)
            epoch = max(epoch, latest_epoch(DatabaseView(PostgresReader(connection, partition), copy.ledger)))
        for partition in range(len(parts)):
            follow_owner(connection, partition, owner_of(epoch))
    return moved


def to_folder(database: Database, folder: Path, progress: Progress, history: str | Path | None = None) -> Moved:
    """Copy a database into a folder, which has a part for each partition if there are several.

    Args:
        database: the database, which no server may use.
        folder: the folder, which is made.
        progress: called with the rows copied so far and the total.
        history: the folder with the past of the hulls in the database; None if there is none.

    Raises:
        StorageError: one of them cannot be used.
        DamagedError: the database cannot be served, or the copy differs from it.
    """
    moved = Moved(str(database), str(folder))
    with ExitStack() as stack:
        connection = stack.enter_context(closing(database.connect("dynhull move")))
        stack.enter_context(as_storage_errors())
        partitions = _partitions(connection, database)
        if partitions > 1 and folder.exists() and any(folder.iterdir()):
            raise StorageError(f"{folder} is not empty")
        owners = [Ownership(database, partition, log.error) for partition in range(partitions)]
        for partition, owner in enumerate(owners):
            stack.callback(owner.release)
            _take(partition, owner)
        connection.execute("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY")
        for partition, owner in enumerate(owners):
            findings = examined(connection, partition, lambda *_: None)
            if findings.fatal:
                raise DamagedError(f"{database}: {'; '.join(findings.fatal)}: restore a backup")
            target = folder if partitions == 1 else worker_folder(folder, partition)
            rows = _while_owned(owner, _rows(PostgresReader(connection, partition), progress))
            copy = copies.write(str(database), target, rows, findings.ledger.totals, history)
            _require_same(findings, copy, str(target))
            moved.add(findings)
        if partitions > 1:
            write_manifest(folder, partitions, complete=True)  # at the end: without it, the copy is refused
    return moved


def _require_apart(history: str | Path, parts: list[Path]) -> None:
    """Raise StorageError if a database would have the past of a folder: each would remove what the other one needs."""
    for part in parts:
        if is_store(history) or not Path(history).exists() or not (part / HISTORY).exists():
            continue
        if Path(history).samefile(part / HISTORY):
            raise StorageError(f"{history} has the past of {part}: give the database a --history-dir of its own")


def _partitions(connection: Connection, database: Database) -> int:
    partitions = partitions_of(connection, database)
    if partitions is None:
        raise StorageError(f"{database} has no tables of dynhull")
    return partitions


def _rows(reader: Reader, progress: Progress) -> Iterator[Insert]:
    """All rows, from the first table to the last."""
    total = sum(map(reader.count, COLUMNS))
    done = 0
    for table, columns in COLUMNS.items():
        for values in reader.every(table, ", ".join(columns)):
            yield Insert(table, values)
            done += 1
            if not done % SENT_ROWS:
                progress(done, total)
    progress(total, total)


def _take(partition: int, owner: Ownership) -> None:
    """Own a partition, perhaps only when the lease of a server has ended. Raises LockedError if that is renewed."""
    leases, unchanged = Leases(), 0.0
    while True:
        try:
            owner.take(leases)
            return
        except LockedError:
            if (seconds := leases.seconds(partition)) < unchanged:
                raise
            unchanged = seconds
        time.sleep(LOOK)


def _while_owned(owner: Ownership, rows: Iterator[Insert]) -> Iterator[Insert]:
    """The rows. Raises TakenOverError at the end if a server has taken over, whose commits the copy would not have."""
    yield from rows
    owner.renew()


def _together(rows: Iterator[Insert]) -> Iterator[list[Insert]]:
    """The rows in groups that fit into memory."""
    group: list[Insert] = []
    size = 0
    for row in rows:
        group.append(row)
        size += sum(len(value) for value in row.values if isinstance(value, bytes | str))
        if size > INSERTED_BYTES or len(group) == SENT_ROWS:
            yield group
            group, size = [], 0
    if group:
        yield group


def _require_same(source: Findings, copy: Findings, place: str) -> None:
    """Raise DamagedError if a copy has other rows than its source, or is damaged elsewhere."""
    if copy.ledger.totals._replace(mode=STOPPED) != source.ledger.totals._replace(mode=STOPPED) or copy.fatal:
        raise DamagedError(f"{place}: the copy differs from its source: {'; '.join(copy.fatal) or 'other totals'}")
