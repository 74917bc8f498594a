"""The tables of each format, and the statements to fill them."""

import sqlite3
from collections.abc import Iterable, Iterator
from typing import Any

from ..rows.tables import COLUMNS, FORMAT, TOTALS_COLUMNS, Insert, Remove, Replace, Statement
from ..rows.totals import COPIES, Totals

APPLICATION_ID = 0x64796E68  # "dynh"
PAGE_BYTES = 8192  # a large batch spans several pages, and wastes half of one

TABLES = {
    "batches": """CREATE TABLE batches (
    hull INTEGER NOT NULL,
    first INTEGER NOT NULL,
    last INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    payload BLOB NOT NULL
, commit_number INTEGER, committed INTEGER)""",  # as it reads after ADD COLUMN
    "snapshots": """CREATE TABLE snapshots (
    id INTEGER PRIMARY KEY,
    hull INTEGER NOT NULL,
    revision INTEGER NOT NULL,
    chunks INTEGER NOT NULL,
    state BLOB NOT NULL,
    checksum INTEGER NOT NULL
)""",
    "chunks": """CREATE TABLE chunks (
    snapshot INTEGER NOT NULL,
    number INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    points BLOB NOT NULL
)""",
    "segments": """CREATE TABLE segments (
    id INTEGER PRIMARY KEY,
    hull INTEGER NOT NULL,
    first INTEGER NOT NULL,
    last INTEGER NOT NULL,
    file TEXT NOT NULL,
    facts TEXT NOT NULL,
    checksum INTEGER NOT NULL
)""",
    "hulls": """CREATE TABLE hulls (
    id INTEGER PRIMARY KEY,
    name TEXT NOT NULL,
    uid TEXT NOT NULL,
    created REAL NOT NULL,
    settings TEXT NOT NULL,
    checksum INTEGER NOT NULL
)""",
    "totals": """CREATE TABLE totals (
    id INTEGER PRIMARY KEY,
    commits INTEGER NOT NULL,
    hulls INTEGER NOT NULL,
    batches INTEGER NOT NULL,
    sum INTEGER NOT NULL,
    next_number INTEGER NOT NULL,
    mode INTEGER NOT NULL,
    fence_rows INTEGER NOT NULL,
    committed INTEGER NOT NULL,
    checksum INTEGER NOT NULL
)""",
    "fences": """CREATE TABLE fences (
    id INTEGER PRIMARY KEY,
    name TEXT NOT NULL,
    uid TEXT NOT NULL,
    created REAL NOT NULL,
    config TEXT NOT NULL,
    checksum INTEGER NOT NULL
)""",
    "events": """CREATE TABLE events (
    fence INTEGER NOT NULL,
    first INTEGER NOT NULL,
    last INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    payload BLOB NOT NULL
)""",
    "insides": """CREATE TABLE insides (
    fence INTEGER NOT NULL,
    sequence INTEGER NOT NULL,
    part INTEGER NOT NULL,
    parts INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    payload BLOB NOT NULL
)""",
    "consumers": """CREATE TABLE consumers (
    fence INTEGER NOT NULL,
    name TEXT NOT NULL,
    acknowledged INTEGER NOT NULL,
    lost INTEGER NOT NULL,
    checksum INTEGER NOT NULL
)""",
    "delays": """CREATE TABLE delays (
    fence INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    payload BLOB NOT NULL
)""",
    "starts": """CREATE TABLE starts (
    fence INTEGER NOT NULL,
    first INTEGER NOT NULL,
    checksum INTEGER NOT NULL
)""",
}
FENCE_TABLES = ("fences", "events", "insides", "consumers", "delays", "starts")

# What migrates batches from formats that did not store their commits.
ADD_COMMITS = (
    "ALTER TABLE batches ADD COLUMN commit_number INTEGER",
    "ALTER TABLE batches ADD COLUMN committed INTEGER",
)

# Up to format 11 what the journal dropped was gone.
FORMAT_11 = {table: sql for table, sql in TABLES.items() if table != "segments"}
# Up to format 10 it was not stored when batches were committed.
FORMAT_10 = FORMAT_11 | {
    "batches": """CREATE TABLE batches (
    hull INTEGER NOT NULL,
    first INTEGER NOT NULL,
    last INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    payload BLOB NOT NULL
)""",
    "totals": TABLES["totals"].replace("    committed INTEGER NOT NULL,\n", ""),
}
# Up to format 6 the rows of events said where the events of a fence begin.
FORMAT_6 = {table: sql for table, sql in FORMAT_10.items() if table != "starts"}
# Format 5 had no fences whose events are delayed.
FORMAT_5 = {table: sql for table, sql in FORMAT_6.items() if table != "delays"}
# Format 3 had no fences.
FORMAT_3 = {table: sql for table, sql in FORMAT_10.items() if table not in FENCE_TABLES} | {
    "totals": FORMAT_10["totals"].replace("    fence_rows INTEGER NOT NULL,\n", ""),
}
# Format 2 had one setting of a hull, and in batches and snapshots neither keys nor times.
FORMAT_2 = FORMAT_3 | {
    "hulls": """CREATE TABLE hulls (
    id INTEGER PRIMARY KEY,
    name TEXT NOT NULL,
    uid TEXT NOT NULL,
    created REAL NOT NULL,
    max_points INTEGER NOT NULL,
    checksum INTEGER NOT NULL
)"""
}
# Format 1 had a blob for the settings of a hull, no totals, and indexes.
FORMAT_1 = {
    "hulls": """CREATE TABLE hulls (
    id INTEGER PRIMARY KEY,
    name TEXT NOT NULL UNIQUE,
    created REAL NOT NULL,
    config BLOB NOT NULL
)""",
    "sqlite_autoindex_hulls_1": None,
    "batches": FORMAT_10["batches"],
    "batches_by_revision": "CREATE UNIQUE INDEX batches_by_revision ON batches (hull, first)",
    "snapshots": TABLES["snapshots"],
    "chunks": TABLES["chunks"],
    "chunks_by_number": "CREATE UNIQUE INDEX chunks_by_number ON chunks (snapshot, number)",
}
SCHEMAS: dict[int, dict[str, str] | dict[str, str | None]] = {
    1: FORMAT_1,
    2: FORMAT_2,
    3: FORMAT_3,
    4: FORMAT_5,  # it had no centres in batches and snapshots, and no frames of hulls
    5: FORMAT_5,
    6: FORMAT_6,
    7: FORMAT_10,  # it wrote the events of a row in more bytes
    8: FORMAT_10,  # it had no hulls over shards
    9: FORMAT_10,  # the number of their shards did not change
    10: FORMAT_10,
    11: FORMAT_11,
    12: TABLES,  # it had no alarms among the fences
    13: TABLES,  # it had no consumers of feeds
    FORMAT: TABLES,
}

INSERT = {
    table: f"INSERT INTO {table} ({', '.join(columns)}) VALUES ({', '.join('?' * len(columns))})"  # noqa: S608  (ours)
    for table, columns in COLUMNS.items()
}
REPLACE_EVENTS = "UPDATE events SET checksum = ?, payload = ? WHERE rowid = ?"
UPDATE_TOTALS = f"UPDATE totals SET {', '.join(f'{column} = ?' for column in TOTALS_COLUMNS)}"  # noqa: S608  (ours)
INSERT_TOTALS = f"INSERT INTO totals ({', '.join(TOTALS_COLUMNS)}) VALUES ({', '.join('?' * len(TOTALS_COLUMNS))})"  # noqa: S608


def sql_of(statement: Statement) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """A change of rows as SQL, with its values."""
    match statement:
        case Insert(table, values):
            yield INSERT[table], values
        case Remove(table, places):
            for place in places:
                yield f"DELETE FROM {table} WHERE rowid = ?", (place,)  # noqa: S608  (ours)
        case Replace(place, checksum, payload):
            yield REPLACE_EVENTS, (checksum, payload, place)


def carry_out(connection: sqlite3.Connection, statements: Iterable[Statement]) -> None:
    """Carry out changes of rows, in their order."""
    for statement in statements:
        for sql, values in sql_of(statement):
            connection.execute(sql, values)


def found(connection: sqlite3.Connection) -> tuple[int, int, dict[str, str | None]]:
    """The application id, the format and the tables of a database."""
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    return application, version, dict(connection.execute("SELECT name, sql FROM sqlite_schema"))


def renew_totals(connection: sqlite3.Connection, totals: Totals) -> None:
    """Rewrite both copies of the totals."""
    connection.execute("DELETE FROM totals")
    connection.executemany(INSERT_TOTALS, [totals.row] * COPIES)


def stamp(connection: sqlite3.Connection) -> None:
    """Set the application id and the format."""
    connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    connection.execute(f"PRAGMA user_version = {FORMAT}")
