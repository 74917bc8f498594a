"""Reading rows, also during commits, and even when the process has run out of file descriptors."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Condition
from typing import TYPE_CHECKING, Any

from ..opening import closed_on_error
from ..rows.tables import FORMAT, UnreadableError

if TYPE_CHECKING:
    from array import array

ROWS_A_QUERY = 1000
KEPT_OPEN = 4


@contextmanager
def as_unreadable() -> Iterator[None]:
    """Convert errors of SQLite while it reads."""
    try:
        yield
    except sqlite3.Error as error:
        raise UnreadableError(str(error)) from error


def _text(content: bytes) -> str:
    return content.decode(errors="surrogateescape")


class SQLiteReader:
    """Reads rows, as of one moment if a transaction is open.

    Args:
        connection: the connection.
        version: the format of the rows.

    Attributes:
        version: the same.
    """

    def __init__(self, connection: sqlite3.Connection, version: int = FORMAT) -> None:
        self._connection = connection
        # Damaged text is read, so that its checksum finds the row: SQLite would say of no row where it is.
        connection.text_factory = _text
        self.version = version

    def begin(self) -> None:
        """Begin a read transaction, and fix the commit it reads."""
        self._connection.execute("BEGIN")
        self._connection.execute("SELECT id FROM totals").fetchone()

    @as_unreadable()
    def count(self, table: str) -> int:
        """The number of rows of a table, or more where some between its first and its last were dropped.

        To count them SQLite would read the whole table.
        """
        first, last = (f"(SELECT {which}(rowid) FROM {table})" for which in ("min", "max"))  # noqa: S608  (ours)
        (rows,) = self._connection.execute(f"SELECT ifnull({last} - {first} + 1, 0)").fetchone()
        return int(rows)

    def every(self, table: str, columns: str) -> Iterator[tuple[Any, ...]]:
        """Some columns of all rows."""
        with as_unreadable():
            yield from self._connection.execute(f"SELECT {columns} FROM {table} ORDER BY rowid")  # noqa: S608  (ours)

    def some(self, table: str, columns: str, places: "array[int]") -> Iterator[tuple[Any, ...]]:
        """Some columns of some rows."""
        # The numbers as JSON make one query for many rows. SQLite runs a cross join from left to right.
        sql = f"SELECT {columns} FROM json_each(?) AS id CROSS JOIN {table} ON {table}.rowid = id.value"  # noqa: S608  (ours)
        with as_unreadable():
            for start in range(0, len(places), ROWS_A_QUERY):
                some = ",".join(map(str, places[start : start + ROWS_A_QUERY]))
                yield from self._connection.execute(sql, (f"[{some}]",))

    @as_unreadable()
    def totals(self) -> list[tuple[Any, ...]]:
        """The rows of the totals."""
        return [tuple(row) for _, *row in self._connection.execute("SELECT * FROM totals")]


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
        with closed_on_error(self):
            for _ in range(KEPT_OPEN):
                self._idle.append(connect())

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
