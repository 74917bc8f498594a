"""Connections to a PostgreSQL database, and its errors as those of the storage."""

import logging
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, LiteralString
from weakref import WeakSet

import psycopg
from psycopg.conninfo import conninfo_to_dict, make_conninfo

from dynhull_server.storage.databases import POSTGRESQL, kind_of
from dynhull_server.storage.opening import closed_on_error
from dynhull_server.storage.port import FormatError, StorageError
from dynhull_server.storage.rows.tables import UnreadableError

from .refusals import meaning_of

SCHEMA = "dynhull"
EXAMPLES = "write postgresql://USER@HOST:PORT/DATABASE, or host=HOST dbname=DATABASE"
OLDEST_VERSION = 15
# Seconds until a connection attempt ends; milliseconds until data that nobody acknowledges ends a connection.
CONNECT_SECONDS, UNACKNOWLEDGED_MS = 10, 10_000
# Whatever the defaults of the database are. An epoch that is lost would let two servers own the hulls.
SETTINGS = (
    f"search_path={SCHEMA}",
    "synchronous_commit=on",
    "statement_timeout=0",
    "lock_timeout=0",
    "idle_in_transaction_session_timeout=0",
    "idle_session_timeout=0",
)
# The same for settings that older versions refuse to hear of, each with the first version that has it.
NEWER_SETTINGS = ((17, "SET transaction_timeout = 0"),)
# What callers get of an error: PostgreSQL's own words are for the log of the server.
FOR_CALLERS = "the database of the server, PostgreSQL, cannot be used at present"
# Where the address does not say otherwise.
DEFAULTS = {
    "connect_timeout": CONNECT_SECONDS,
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": UNACKNOWLEDGED_MS,
    "target_session_attrs": "read-write",  # of several hosts the one that is no standby
}

# It warns of what it ignores while it ends a lost connection, of which callers hear as an error.
logging.getLogger("psycopg").setLevel(logging.ERROR)


class Connection(psycopg.Connection[tuple[Any, ...]]):
    """A connection that other threads may end while this one waits for an answer."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._since = time.monotonic()
        # A descriptor of its own: that of the connection may be closed meanwhile, and be another file's.
        self._socket = socket.socket(fileno=os.dup(self.fileno()))

    def close(self) -> None:
        """Close it."""
        super().close()
        self._socket.close()

    def end_if_older(self, seconds: float) -> None:
        """Have whoever waits for an answer get an error, unless the connection is younger."""
        if time.monotonic() > self._since + seconds:
            with suppress(OSError):  # it has ended
                self._socket.shutdown(socket.SHUT_RDWR)


class Database:
    """A PostgreSQL database.

    Args:
        address: a URL, or keywords as of libpq.

    Raises:
        ValueError: the address is invalid.
    """

    def __init__(self, address: str) -> None:
        if kind_of(address) is not POSTGRESQL:
            raise ValueError(f"no address of a PostgreSQL database; {EXAMPLES}")
        try:
            given: dict[str, Any] = {**DEFAULTS, **conninfo_to_dict(address)}
        except psycopg.ProgrammingError as error:
            raise ValueError(f"no address of a PostgreSQL database: {_words(error)}; {EXAMPLES}") from None
        given["options"] = " ".join([*filter(None, [given.get("options")]), *(f"-c {each}" for each in SETTINGS)])
        self._address = make_conninfo(**given)
        self._silence = (int(given["tcp_user_timeout"]) or UNACKNOWLEDGED_MS) / 1000
        self._open: WeakSet[Connection] = WeakSet()
        self._adding = threading.Lock()  # to them
        where = f"{given.get('host') or 'localhost'}{':' + str(given['port']) if given.get('port') else ''}"
        self._words = f"the database {given.get('dbname') or given.get('user') or 'of the user'} on {where}"

    def __str__(self) -> str:
        """How messages call it: without its password."""
        return self._words

    def connect(self, name: str) -> Connection:
        """A connection without an open transaction, which others see by this name.

        Raises:
            StorageError: the server cannot be reached, or refuses it.
            FormatError: the server is too old, the database has another encoding than UTF-8, or a pooler is in between.
        """
        try:
            connection = Connection.connect(
                self._address, autocommit=True, application_name=name, client_encoding="utf8"
            )
        except psycopg.Error as error:
            raise self._refused(error) from error
        with self._adding:
            self._open.add(connection)
        with closed_on_error(connection):
            if connection.info.server_version < OLDEST_VERSION * 10_000:
                version = connection.info.parameter_status("server_version")
                raise FormatError(f"{self} is of PostgreSQL {version}: {OLDEST_VERSION} or newer is needed")
            encoding = connection.info.parameter_status("server_encoding")
            if encoding != "UTF8":
                raise FormatError(f"{self} has the encoding {encoding}: create one with UTF8")
            self._require_own_session(connection)
            with as_storage_errors():
                for statement in _newer_settings(connection):
                    connection.execute(statement)
        return connection

    def _refused(self, error: psycopg.Error) -> StorageError:
        message = f"cannot connect to {self}: {_words(error)}"
        return StorageError(message, for_callers=FOR_CALLERS, meaning=meaning_of(error))

    def end_silent(self, seconds: float) -> None:
        """End the connections, if a small question has had no answer for so long; the next ones are others.

        The operating system ends those whose data nobody acknowledges. Behind a proxy, somebody does. How long is too
        long says `tcp_user_timeout`, for both.
        """
        if seconds >= self._silence:
            with self._adding:
                silent = list(self._open)
            for each in silent:
                each.end_if_older(self._silence)

    def _require_own_session(self, connection: Connection) -> None:
        """Refuse a pooler, which gives the connection a process of PostgreSQL for a while, with settings of its own."""
        with as_storage_errors():
            row = connection.execute("SELECT pg_backend_pid()").fetchone()
        if row != (connection.info.backend_pid,):
            raise FormatError(f"{self} is behind a pooler: connect to PostgreSQL itself, the server needs own sessions")

    async def connect_async(self, name: str) -> "psycopg.AsyncConnection[tuple[Any, ...]]":
        """The same for the event loop, of a database that `connect` has reached before. Raises StorageError."""
        try:
            connection = await psycopg.AsyncConnection.connect(
                self._address, autocommit=True, application_name=name, client_encoding="utf8"
            )
        except psycopg.Error as error:
            raise self._refused(error) from error
        try:
            with as_storage_errors():
                for statement in _newer_settings(connection):
                    await connection.execute(statement)
        except BaseException:
            await connection.close()
            raise
        return connection


@contextmanager
def as_storage_errors() -> Iterator[None]:
    """Convert errors of PostgreSQL to StorageError, and what it says about damage to UnreadableError."""
    try:
        yield
    except (psycopg.errors.DataCorrupted, psycopg.errors.IndexCorrupted) as error:
        raise UnreadableError(_words(error)) from error
    except psycopg.Error as error:
        raise storage_error(error) from error


def storage_error(error: psycopg.Error) -> StorageError:
    """An error of PostgreSQL as one of the storage."""
    return StorageError(f"PostgreSQL: {_words(error)}", for_callers=FOR_CALLERS, meaning=meaning_of(error))


def _newer_settings(connection: psycopg.BaseConnection[Any]) -> Iterator[LiteralString]:
    version = connection.info.server_version // 10_000
    return (statement for first, statement in NEWER_SETTINGS if version >= first)


def _words(error: psycopg.Error) -> str:
    return " ".join(str(error).split())
