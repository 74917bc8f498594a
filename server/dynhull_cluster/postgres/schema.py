"""The tables in PostgreSQL, and the statements to fill them.

Every table has the columns of `COLUMNS`, and before them the partition. Payloads are not compressed: they are points
and keys, and compressing them would take longer than writing them.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, assert_never

from psycopg.errors import InsufficientPrivilege, LockNotAvailable
from psycopg.sql import Identifier

from dynhull_server.storage.port import FormatError, LockedError, StorageError
from dynhull_server.storage.refusals import Meaning
from dynhull_server.storage.rows.encoding import checksum
from dynhull_server.storage.rows.tables import (
    COLUMNS,
    COMMITS_SINCE,
    FORMAT,
    OPTIONAL,
    TOTALS_COLUMNS,
    Insert,
    Remove,
    Replace,
    Statement,
)
from dynhull_server.storage.rows.totals import COPIES, Totals

from .database import SCHEMA, Connection, Database
from .processes import is_known_dead

# The first format in PostgreSQL, and the statements that lead from each format to the next one.
FIRST_FORMAT = 8
MIGRATIONS: dict[int, Sequence[str]] = {
    8: (),  # it had no hulls over shards
    9: (),  # the number of their shards did not change
    10: (  # it was not stored when batches were committed
        "ALTER TABLE batches ADD COLUMN commit_number bigint, ADD COLUMN committed bigint",
        "ALTER TABLE totals ADD COLUMN committed bigint NOT NULL DEFAULT 0",
    ),
    11: (  # what the journal dropped was gone
        (
            "CREATE TABLE segments (partition integer NOT NULL, id bigint NOT NULL, hull bigint NOT NULL, "
            "first bigint NOT NULL, last bigint NOT NULL, file text NOT NULL, facts text NOT NULL, "
            "checksum bigint NOT NULL, PRIMARY KEY (partition, id))"
        ),
    ),
    12: (),  # it had no alarms among the fences
    13: (),  # it had no consumers of feeds
}
# The number of an advisory lock, held while tables are created, migrated, or filled from a folder: "dynhull".
PREPARING = 0x64796E68756C6C
PREPARING_SECONDS = 10
# Bytes of the rows that one statement inserts, unless one row is larger.
INSERTED_BYTES = 2**22

TYPES = {
    "name": "text",
    "uid": "text",
    "created": "double precision",
    "settings": "text",
    "config": "text",
    "file": "text",
    "facts": "text",
    "payload": "bytea",
    "points": "bytea",
    "state": "bytea",
}
INTEGER = "bigint"
BINARY = "%b"  # bytes as they are: as text they would be twice as long, and take far longer

Query = tuple[bytes, Sequence[Any]]


def _columns(columns: Sequence[str]) -> str:
    return ", ".join(
        f"{column} {TYPES.get(column, INTEGER)}{'' if column in OPTIONAL else ' NOT NULL'}" for column in columns
    )


def _tables() -> Iterator[str]:
    yield "CREATE TABLE format (format integer NOT NULL, partitions integer NOT NULL)"
    yield (
        "CREATE TABLE owners (partition integer PRIMARY KEY, epoch bigint NOT NULL, worker text NOT NULL, "
        "process text NOT NULL, address text NOT NULL, until timestamptz NOT NULL)"
    )
    # Rows that every commit renews stay on their page.
    yield (
        f"CREATE TABLE totals (partition integer NOT NULL, copy integer NOT NULL, {_columns(TOTALS_COLUMNS)}, "
        "PRIMARY KEY (partition, copy)) WITH (fillfactor = 30)"
    )
    for table, columns in COLUMNS.items():
        key = f"PRIMARY KEY (partition, {columns[0]})"
        yield f"CREATE TABLE {table} (partition integer NOT NULL, {_columns(columns)}, {key})"
        for column in columns:
            if TYPES.get(column) == "bytea":
                yield f"ALTER TABLE {table} ALTER COLUMN {column} SET STORAGE EXTERNAL"


INSERT_TOTALS = (
    f"INSERT INTO totals (partition, copy, {', '.join(TOTALS_COLUMNS)}) "  # noqa: S608  (ours)
    f"VALUES (%s, %s, {', '.join(['%s'] * len(TOTALS_COLUMNS))})"
).encode()
UPDATE_TOTALS = (
    f"UPDATE totals SET {', '.join(f'{column} = %s' for column in TOTALS_COLUMNS)} "  # noqa: S608  (ours)
    "WHERE partition = %s AND commits = %s AND checksum = %s"
).encode()


def _insert(table: str) -> bytes:
    columns = COLUMNS[table]
    types = [TYPES.get(column, INTEGER) for column in columns]
    given = ", ".join(f"{BINARY if each == 'bytea' else '%s'}::{each}[]" for each in types)
    return f"INSERT INTO {table} (partition, {', '.join(columns)}) SELECT %s, * FROM unnest({given})".encode()  # noqa: S608


INSERT = {table: _insert(table) for table in COLUMNS}
REMOVE = {
    table: f"DELETE FROM {table} WHERE partition = %s AND {columns[0]} = ANY(%s::bigint[])".encode()  # noqa: S608
    for table, columns in COLUMNS.items()
}
REPLACE_EVENTS = b"UPDATE events SET checksum = %s, payload = %b WHERE partition = %s AND rowid = %s"


def queries_of(partition: int, statements: Sequence[Statement]) -> Iterator[Query]:
    """Changes of rows as SQL, in their order; rows that are inserted one after the other share statements."""
    for (_, table), run in groupby(statements, lambda each: (type(each), getattr(each, "table", ""))):
        inserted = []
        for each in run:
            match each:
                case Insert():
                    inserted.append(each.values)
                case Remove(_, places):
                    yield REMOVE[table], [partition, list(places)]
                case Replace(place, checksum, payload):
                    yield REPLACE_EVENTS, [checksum, payload, partition, place]
                case _:
                    assert_never(each)
        for rows in _some(inserted):
            yield INSERT[table], [partition, *map(list, zip(*rows, strict=True))]


def _some(rows: Sequence[tuple[Any, ...]]) -> Iterator[list[tuple[Any, ...]]]:
    some: list[tuple[Any, ...]] = []
    size = 0
    for row in rows:
        row_bytes = sum(len(value) for value in row if isinstance(value, bytes | str))
        if some and size + row_bytes > INSERTED_BYTES:
            yield some
            some, size = [], 0
        some.append(row)
        size += row_bytes
    if some:
        yield some


def put_totals(connection: Connection, partition: int, totals: Totals) -> None:
    """Write both copies of the totals of a partition anew."""
    connection.execute("DELETE FROM totals WHERE partition = %s", [partition])
    for copy in range(COPIES):
        connection.execute(INSERT_TOTALS, [partition, copy, *totals.row])


def hold(connection: Connection, database: Database) -> None:
    """Keep others from preparing the database, until the end of the transaction. Raises StorageError."""
    connection.execute(f"SET LOCAL lock_timeout = '{PREPARING_SECONDS}s'".encode())
    try:
        connection.execute("SELECT pg_advisory_xact_lock(%s)", [PREPARING])
    except LockNotAvailable:
        raise StorageError(
            f"{database} is being prepared by another server, or filled by `dynhull move`", meaning=Meaning.PASSES
        ) from None


def partitions_of(connection: Connection, database: Database) -> int | None:
    """The number of partitions; None if the database has no tables of dynhull.

    Raises:
        FormatError: the tables are of a newer version.
        StorageError: the tables are not those of dynhull.
    """
    (there,) = _one(connection, "SELECT to_regclass(%s) IS NOT NULL", [f"{SCHEMA}.format"])
    if not there:
        if _one(connection, "SELECT to_regnamespace(%s) IS NOT NULL", [SCHEMA])[0] and _has_tables(connection):
            raise FormatError(f"{database} has a schema {SCHEMA} of another program: choose another database")
        return None
    rows = connection.execute("SELECT format, partitions FROM format").fetchall()
    if len(rows) != 1:
        raise FormatError(
            f"{database}: the table {SCHEMA}.format has {len(rows)} rows instead of one: restore a backup"
        )
    version, partitions = rows[0]
    if version not in range(FIRST_FORMAT, FORMAT + 1):
        raise FormatError(
            f"{database} has format {version}, this version reads formats {FIRST_FORMAT} to {FORMAT}: run the newer "
            "version of dynhull that wrote it"
        )
    return int(partitions)


def prepare(connection: Connection, database: Database, partitions: int) -> None:
    """Create the tables for `partitions` partitions, or migrate those there are. Inside a transaction, after `hold`.

    Raises:
        FormatError: the database belongs to another program, or to a newer version.
        LockedError: it is served in an older format.
        StorageError: it has another number of partitions, or the user may not create tables.
    """
    present = partitions_of(connection, database)
    if present is None:
        try:
            connection.execute(f"CREATE SCHEMA IF NOT EXISTS {SCHEMA}".encode())
        except InsufficientPrivilege:
            base, user = (Identifier(each).as_string(None) for each in (connection.info.dbname, connection.info.user))
            raise StorageError(
                f"{user} may not create the schema {SCHEMA} in {database}: have its owner say "
                f"GRANT CREATE ON DATABASE {base} TO {user}"
            ) from None
        with connection.pipeline():  # others wait for it, and not for long
            for statement in _tables():
                connection.execute(statement.encode())
            connection.execute("INSERT INTO format (format, partitions) VALUES (%s, %s)", [FORMAT, partitions])
            for partition in range(partitions):
                put_totals(connection, partition, Totals())
        return
    require_partitions(connection, database, partitions)
    (version,) = _one(connection, "SELECT format FROM format")
    if version == FORMAT:
        return
    _end_owners(connection, database, version)
    for before in range(version, FORMAT):
        for sql in MIGRATIONS[before]:
            connection.execute(sql.encode())
    if version < COMMITS_SINCE:
        _renew_checksums(connection)
    connection.execute("UPDATE format SET format = %s", [FORMAT])


def _renew_checksums(connection: Connection) -> None:
    """Have the checksums of the totals include the time, which formats before had not; one that is wrong stays so."""
    *columns, _ = TOTALS_COLUMNS
    sql = f"SELECT partition, copy, checksum, {', '.join(columns)} FROM totals".encode()  # noqa: S608  (ours)
    for partition, copy, stored, *values in connection.execute(sql).fetchall():
        *before, _ = values
        if checksum(b"", *before) == stored:
            renewed = [checksum(b"", *values), partition, copy]
            connection.execute("UPDATE totals SET checksum = %s WHERE partition = %s AND copy = %s", renewed)


def require_partitions(connection: Connection, database: Database, partitions: int) -> None:
    """Raise StorageError if the database, which has tables of dynhull, has another number of partitions."""
    present = partitions_of(connection, database)
    if present is not None and present != partitions:
        raise divided_otherwise(database, present)


def divided_otherwise(database: Database, partitions: int) -> StorageError:
    """The error of a server that cannot serve this number of partitions."""
    remedy = f"start the server with --workers {partitions}, or with --cluster"
    return StorageError(f"{database} is divided among {partitions} workers: {remedy}")


def _end_owners(connection: Connection, database: Database, version: int) -> None:
    """Have nobody write in an older format any more. Raises LockedError if somebody serves in it."""
    owners = connection.execute("SELECT worker, process FROM owners WHERE until > clock_timestamp()").fetchall()
    for worker, process in owners:
        if not is_known_dead(process):
            raise LockedError(
                f"{database} is served by {worker} in format {version}, and this version would change it to format "
                f"{FORMAT}: stop all servers of older versions first"
            )
    # Who was only slow is one no longer; what it commits at this moment is waited for.
    connection.execute("SELECT epoch FROM owners FOR UPDATE")
    connection.execute("UPDATE owners SET epoch = epoch + 1")


def _has_tables(connection: Connection) -> bool:
    (tables,) = _one(connection, "SELECT count(*) FROM pg_class WHERE relnamespace = to_regnamespace(%s)", [SCHEMA])
    return bool(tables)


def _one(connection: Connection, sql: Any, values: Sequence[Any] = ()) -> tuple[Any, ...]:
    row = connection.execute(sql, values).fetchone()
    assert row is not None  # these queries have one row
    return row
