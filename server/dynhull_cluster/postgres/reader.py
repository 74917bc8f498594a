"""Reading rows of a partition during commits."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import TYPE_CHECKING, Any

from psycopg.pq import TransactionStatus

from dynhull_server.storage.port import StorageError
from dynhull_server.storage.rows.tables import COLUMNS, FORMAT, TOTALS_COLUMNS

from .database import Connection, as_storage_errors

if TYPE_CHECKING:
    from array import array

# Rows of one query at first, and at most: of small rows each query has twice as many as the one before it.
FEW, MANY = 64, 4096
SMALL_BYTES = 2**20
KEPT_OPEN = 4

OPEN = TransactionStatus.INTRANS, TransactionStatus.INERROR


class PostgresReader:
    """Reads the rows of a partition, as of one moment if a transaction is open.

    Args:
        connection: the connection.
        partition: the partition.

    Attributes:
        version: the format of the rows.
    """

    version = FORMAT

    def __init__(self, connection: Connection, partition: int) -> None:
        self._connection = connection
        self._partition = partition

    def begin(self) -> None:
        """Begin a read transaction, and fix the commit it reads."""
        self._connection.execute("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY")
        self._connection.execute("SELECT commits FROM totals WHERE partition = %s", [self._partition])

    @as_storage_errors()
    def count(self, table: str) -> int:
        """The number of rows of a table."""
        sql = f"SELECT count(*) FROM {table} WHERE partition = %s".encode()  # noqa: S608  (ours)
        (rows,) = self._connection.execute(sql, [self._partition]).fetchall()[0]
        return int(rows)

    @as_storage_errors()
    def number(self, sql: bytes) -> int:
        """The only value of the only row of a query."""
        (value,) = self._connection.execute(sql).fetchall()[0]
        return int(value)

    def every(self, table: str, columns: str) -> Iterator[tuple[Any, ...]]:
        """Some columns of all rows."""
        sql = f"SELECT {columns} FROM {table} WHERE partition = %s ORDER BY {COLUMNS[table][0]}".encode()  # noqa: S608
        with as_storage_errors(), self._connection.cursor() as cursor:
            yield from cursor.stream(sql, [self._partition], binary=True)

    def after(self, table: str, columns: str, place: int) -> Iterator[tuple[Any, ...]]:
        """Some columns of the rows with greater numbers."""
        key = COLUMNS[table][0]
        sql = f"SELECT {columns} FROM {table} WHERE partition = %s AND {key} > %s ORDER BY {key}".encode()  # noqa: S608
        with as_storage_errors(), self._connection.cursor() as cursor:
            yield from cursor.stream(sql, [self._partition, place], binary=True)

    def some(self, table: str, columns: str, places: "array[int]") -> Iterator[tuple[Any, ...]]:
        """Some columns of some rows."""
        sql = (
            f"SELECT {columns} FROM unnest(%s::bigint[]) WITH ORDINALITY AS given (place, position) "  # noqa: S608  (ours)
            f"JOIN {table} ON {table}.partition = %s AND {table}.{COLUMNS[table][0]} = place ORDER BY position"
        ).encode()
        with as_storage_errors():
            start, size = 0, FEW
            while start < len(places):
                values = [list(places[start : start + size]), self._partition]
                rows = self._connection.execute(sql, values, binary=True).fetchall()
                yield from rows
                start += size
                if sum(len(value) for row in rows for value in row if isinstance(value, bytes)) < SMALL_BYTES:
                    size = min(2 * size, MANY)

    @as_storage_errors()
    def totals(self) -> list[tuple[Any, ...]]:
        """The rows of the totals."""
        sql = f"SELECT {', '.join(TOTALS_COLUMNS)} FROM totals WHERE partition = %s ORDER BY copy".encode()  # noqa: S608
        return self._connection.execute(sql, [self._partition]).fetchall()


class BegunReader(PostgresReader):
    """A reader within a transaction that others have begun, and end."""

    def begin(self) -> None:
        """Read on as of the same moment."""


class ReaderPool:
    """Connections for reading. Some are kept; one that has failed is not used again.

    Args:
        connect: opens a connection; raises StorageError.
        partition: the partition.
        idle: connections that there are.
    """

    def __init__(self, connect: Callable[[], Connection], partition: int, idle: Sequence[Connection] = ()) -> None:
        self._connect = connect
        self._partition = partition
        self._turn = Lock()
        self._idle = list(idle)
        self._closed = False

    @contextmanager
    def lend(self) -> Iterator[PostgresReader]:
        """A reader without an open transaction."""
        connection = self._take()
        try:
            with as_storage_errors():
                yield PostgresReader(connection, self._partition)
        finally:
            self._give_back(connection)

    def close(self) -> None:
        """Close the idle connections, and the others when they are returned."""
        with self._turn:
            self._closed = True
            idle, self._idle = self._idle, []
        for connection in idle:
            connection.close()

    def _take(self) -> Connection:
        while True:
            with self._turn:
                if not self._idle:
                    break
                connection = self._idle.pop()
            try:
                connection.execute("SELECT 1")  # it may have been lost while nobody used it
            except Exception:
                connection.close()
            else:
                return connection
        return self._connect()

    def _give_back(self, connection: Connection) -> None:
        try:
            if connection.info.transaction_status in OPEN:
                connection.execute("ROLLBACK")
            if connection.info.transaction_status is not TransactionStatus.IDLE:  # lost, or an answer is not read
                raise StorageError("the connection cannot be used again")
        except Exception:
            connection.close()
            return
        with self._turn:
            keep = not self._closed and len(self._idle) < KEPT_OPEN
            if keep:
                self._idle.append(connection)
        if not keep:
            connection.close()
