"""Reading hulls during commits, even when the process has run out of file descriptors."""

import sqlite3
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from threading import Condition
from typing import Any

from ...state.records import Kept
from ..port import DamagedError
from .chunks import joined, state_from
from .encoding import checksum, decode
from .ledger import HullRows, Snapshot

ROWS_A_QUERY = 1000
KEPT_OPEN = 4
BATCH_COLUMNS = "first, last, checksum, payload"


class Readers:
    """Connections for reading. Some are always open; more are opened when needed and possible.

    Args:
        connect: opens a connection.

    Raises:
        sqlite3.Error: the first ones cannot be opened.
    """

    def __init__(self, connect: Callable[[], sqlite3.Connection]) -> None:
        self._connect = connect
        self._returned = Condition()
        self._idle: list[sqlite3.Connection] = []
        try:
            for _ in range(KEPT_OPEN):
                self._idle.append(connect())
        except BaseException:
            self.close()
            raise

    @contextmanager
    def lend(self) -> Iterator[sqlite3.Connection]:
        """A connection, without an open transaction before and after."""
        connection = self._take()
        try:
            yield connection
        finally:
            if connection.in_transaction:
                connection.execute("ROLLBACK")
            with self._returned:
                self._idle.append(connection)
                spare = self._idle.pop(0) if len(self._idle) > KEPT_OPEN else None
                self._returned.notify()
            if spare is not None:
                spare.close()

    def close(self) -> None:
        """Close the idle connections."""
        for connection in self._idle:
            connection.close()
        self._idle = []

    def _take(self) -> sqlite3.Connection:
        with self._returned:
            if self._idle:
                return self._idle.pop()
        try:
            return self._connect()
        except sqlite3.Error:  # no file descriptors: wait for an open connection
            with self._returned:
                self._returned.wait_for(lambda: self._idle)
                return self._idle.pop()


def begin(connection: sqlite3.Connection) -> None:
    """Begin a read transaction, and fix the commit it reads."""
    connection.execute("BEGIN")
    connection.execute("SELECT id FROM totals").fetchone()


def read_hull(connection: sqlite3.Connection, hull: HullRows, until: int) -> Kept:
    """A hull at revision `until`, or at its last one if that is earlier.

    Args:
        connection: a connection whose transaction was open when `hull` was copied.
        hull: the rows of the hull.
        until: the revision.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    if until < hull.oldest:
        raise DamagedError(f"revision {until} of hull {hull.row.name!r} is no longer kept")
    with _as_damage(hull):
        kept = _newest_snapshot(connection, hull, until)
        rows = rows_by_id(connection, BATCH_COLUMNS, "batches", hull.between(kept.revision, until))
        _add_records(kept, hull, rows, until)
    return kept


def read_each(connection: sqlite3.Connection, hulls: Sequence[HullRows]) -> Iterator[Kept]:
    """Hulls at their last revisions, in this order. Those without snapshots share queries: they may be many.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    ids = array("q", (place for hull in hulls if not hull.snapshots for place in hull.ids))
    rows = rows_by_id(connection, BATCH_COLUMNS, "batches", ids)
    for hull in hulls:
        if hull.snapshots:
            yield read_hull(connection, hull, hull.last)
            continue
        kept = Kept()
        with _as_damage(hull):
            _add_records(kept, hull, islice(rows, len(hull.ids)), hull.last)
        yield kept


@contextmanager
def _as_damage(hull: HullRows) -> Iterator[None]:
    """Convert errors of SQLite while it reads this hull."""
    try:
        yield
    except sqlite3.Error as error:
        raise DamagedError(f"hull {hull.row.name!r} cannot be read ({error}): restore a backup") from error


def rows_by_id(
    connection: sqlite3.Connection, columns: str, table: str, ids: "array[int]"
) -> Iterator[tuple[Any, ...]]:
    """Some columns of rows, in the order of `ids`; missing rows are left out."""
    # The numbers as JSON make one query for many rows. SQLite runs a cross join from left to right.
    sql = f"SELECT {columns} FROM json_each(?) AS id CROSS JOIN {table} ON {table}.rowid = id.value"  # noqa: S608  (ours)
    for start in range(0, len(ids), ROWS_A_QUERY):
        some = ",".join(map(str, ids[start : start + ROWS_A_QUERY]))
        yield from connection.execute(sql, (f"[{some}]",))


def _newest_snapshot(connection: sqlite3.Connection, hull: HullRows, until: int) -> Kept:
    for snapshot in reversed(hull.snapshots):
        if snapshot.revision <= until:
            kept = _snapshot(connection, hull.row.number, snapshot)
            if kept is not None:
                return kept
    return Kept()


def _snapshot(connection: sqlite3.Connection, number: int, snapshot: Snapshot) -> Kept | None:
    """A snapshot, None if it is damaged."""
    query = "SELECT state, checksum FROM snapshots WHERE id = ? AND hull = ? AND revision = ? AND chunks = ?"
    keys = snapshot.id, number, snapshot.revision, len(snapshot.chunks)
    row = connection.execute(query, keys).fetchone()
    if row is None or checksum(row[0], *keys) != row[1]:
        return None
    kept, decode_chunk = state_from(row[0])
    parts = []
    found = rows_by_id(connection, "number, checksum, points", "chunks", array("q", snapshot.chunks))
    for expected, (number, stored, data) in enumerate(found):
        if number != expected or checksum(data, snapshot.id, number) != stored:
            return None
        parts.append(decode_chunk(data))
    if len(parts) != len(snapshot.chunks):
        return None
    kept.revision, kept.contents = snapshot.revision, joined(parts)
    return kept


def _add_records(kept: Kept, hull: HullRows, rows: Iterable[tuple[Any, ...]], until: int) -> None:
    """Add the revisions after the snapshot, up to `until` or the last one; `rows` are those that have them."""
    expected = kept.revision
    for first, last, stored, payload in rows:
        if checksum(payload, hull.row.number, first, last) != stored:
            raise DamagedError(f"hull {hull.row.name!r}: revisions {first} to {last} are damaged: restore a backup")
        for record in decode(payload, first):
            if not kept.revision < record.revision <= until:
                continue
            expected += 1
            if record.revision != expected:
                raise DamagedError(f"hull {hull.row.name!r}: revision {expected} is missing: restore a backup")
            kept.records.append(record)
    if expected < min(until, hull.last):
        raise DamagedError(f"hull {hull.row.name!r}: revision {expected + 1} is missing: restore a backup")
