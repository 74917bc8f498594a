"""What a restart makes of a hull's rows: the newest good snapshot, then the batches after it."""

import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from .errors import JournalDamagedError
from .records import Points, Record, checksum, decode


@dataclass(slots=True)
class Recovered:
    """A hull as it was.

    Attributes:
        revision: the revision of the points.
        points: (n, 2) points of the snapshot, with multiplicity.
        state: what the engine stored with them; empty without a snapshot.
        records: the batches after it, in order.
        notes: what had to be left out, in words.
        cut_from: the first revision of a damaged end; None where there is none.
    """

    revision: int
    points: Points
    state: bytes
    records: list[Record]
    notes: list[str] = field(default_factory=list)
    cut_from: int | None = None


def recover(connection: sqlite3.Connection, number: int, until: int) -> Recovered:
    """Read one hull as it was at revision `until`, or at the last one before.

    Raises:
        JournalDamagedError: a batch that others follow is missing or damaged, or every snapshot is.
    """
    try:
        recovered = _snapshot(connection, number, until)
        _batches(connection, number, until, recovered)
    except sqlite3.DatabaseError as error:
        raise JournalDamagedError(f"the database is damaged ({error}): restore a backup") from error
    return recovered


def _snapshot(connection: sqlite3.Connection, number: int, until: int) -> Recovered:
    query = (
        "SELECT id, revision, chunks, state, checksum FROM snapshots WHERE hull = ? AND revision <= ? "
        "ORDER BY revision DESC"
    )
    notes: list[str] = []
    for snapshot, revision, chunks, state, expected in connection.execute(query, (number, until)):
        if checksum(state, snapshot, number, revision, chunks) == expected:
            parts = list(_good_chunks(connection, snapshot))
            if len(parts) == chunks:
                points = np.concatenate([np.empty((0, 2)), *parts])
                return Recovered(revision, points, state, [], notes)
        notes.append(f"the snapshot of hull {number} at revision {revision} is damaged: using the one before")
    return Recovered(0, np.empty((0, 2)), b"", [], notes)


def _good_chunks(connection: sqlite3.Connection, snapshot: int) -> Iterator[Points]:
    query = "SELECT number, checksum, points FROM chunks WHERE snapshot = ? ORDER BY number"
    for expected, (number, stored, data) in enumerate(connection.execute(query, (snapshot,))):
        if number != expected or checksum(data, snapshot, number) != stored:
            return
        yield np.frombuffer(data, "<f8").reshape(-1, 2)


def _batches(connection: sqlite3.Connection, number: int, until: int, recovered: Recovered) -> None:
    """Append the good batches after the snapshot; a damaged last row is cut off."""
    start = recovered.revision
    reached = start
    bad: str | None = None
    query = (
        "SELECT first, last, checksum, payload FROM batches WHERE hull = ? AND last > ? AND first <= ? ORDER BY first"
    )
    for first, last, expected, payload in connection.execute(query, (number, start, until)):
        if bad is None and first > reached + 1:
            bad = f"revisions {reached + 1} to {first - 1} of hull {number} are missing"
        if bad is not None:
            raise JournalDamagedError(f"{bad}, and later ones are there: restore a backup")
        if checksum(payload, number, first, last) != expected:
            bad = f"revisions {first} to {last} of hull {number} are damaged"
            recovered.cut_from = first
            continue
        recovered.records += [record for record in decode(payload, first) if start < record.revision <= until]
        reached = last
    if bad is not None:
        recovered.notes.append(f"{bad}: cut off at revision {reached}, the last whole batch")
