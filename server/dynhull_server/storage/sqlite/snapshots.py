"""Writing a snapshot beside the traffic: small commits, then one that makes it count, then trimming in small steps."""

import sqlite3
import time

import numpy as np

from .records import Points, checksum
from .writer import Statement, Writer

CHUNK_POINTS = 32_768  # half a megabyte: a commit that delays the ones behind it by little
KEPT = 2  # snapshots a hull; the older one is there in case the newer is damaged
TRIMMED_BYTES = 2**20  # a step
BREATH = 4.0  # times as long as a step took is rested after it: the disk is the traffic's


def write(
    writer: Writer, connection: sqlite3.Connection, number: int, revision: int, points: Points, state: bytes
) -> None:
    """Store a snapshot, wait until it is committed, drop all but the newest two and the batches before both."""
    (highest,) = connection.execute(
        "SELECT max(coalesce((SELECT max(id) FROM snapshots), 0), coalesce((SELECT max(snapshot) FROM chunks), 0))"
    ).fetchone()
    snapshot = highest + 1
    chunks = range(0, len(points), CHUNK_POINTS)
    for i, first in enumerate(chunks):
        data = np.ascontiguousarray(points[first : first + CHUNK_POINTS], "<f8").tobytes()
        values = (snapshot, i, checksum(data, snapshot, i), data)
        _step(writer, [("INSERT INTO chunks (snapshot, number, checksum, points) VALUES (?, ?, ?, ?)", values)])
    row = (snapshot, number, revision, len(chunks), state, checksum(state, snapshot, number, revision, len(chunks)))
    # Not where the hull was deleted meanwhile: then the chunks are orphans, and the next trimming takes them.
    sql = (
        "INSERT INTO snapshots (id, hull, revision, chunks, state, checksum) "
        "SELECT ?, ?, ?, ?, ?, ? WHERE EXISTS (SELECT 1 FROM hulls WHERE id = ?)"
    )
    _step(writer, [(sql, (*row, number))])
    _trim(writer, connection, number)


def _trim(writer: Writer, connection: sqlite3.Connection, number: int) -> None:
    query = "SELECT id, revision FROM snapshots WHERE hull = ? ORDER BY revision DESC"
    rows = connection.execute(query, (number,)).fetchall()
    for snapshot, _ in rows[KEPT:]:
        _step(writer, [("DELETE FROM snapshots WHERE id = ?", (snapshot,))])
    orphans = "SELECT rowid FROM chunks WHERE snapshot NOT IN (SELECT id FROM snapshots) LIMIT 2"
    _drop(writer, connection, "chunks", orphans, ())
    if len(rows) < KEPT:
        return
    oldest = rows[KEPT - 1][1]
    while True:
        query = "SELECT rowid, length(payload) FROM batches WHERE hull = ? AND last <= ? ORDER BY first LIMIT 1000"
        step: list[int] = []
        size = 0
        for rowid, length in connection.execute(query, (number, oldest)).fetchall():
            if step and size + length > TRIMMED_BYTES:
                break
            step.append(rowid)
            size += length
        if not step:
            return
        _step(writer, [("DELETE FROM batches WHERE rowid = ?", (rowid,)) for rowid in step])


def _drop(writer: Writer, connection: sqlite3.Connection, table: str, query: str, values: tuple[int, ...]) -> None:
    while rows := connection.execute(query, values).fetchall():
        _step(writer, [(f"DELETE FROM {table} WHERE rowid = ?", row) for row in rows])  # noqa: S608  (ours)


def _step(writer: Writer, statements: list[Statement]) -> None:
    begun = time.monotonic()
    writer.write(statements).result()
    time.sleep(BREATH * (time.monotonic() - begun))
