"""The tables of each format, and the statements to fill them."""

import sqlite3

APPLICATION_ID = 0x64796E68  # "dynh"
FORMAT = 7
# The first formats with fences, with delayed events, and with events of many fences in a row.
FENCES_SINCE, DELAYS_SINCE, STARTS_SINCE = 4, 6, 7
PAGE_BYTES = 8192  # a large batch spans several pages, and wastes half of one

TABLES = {
    "batches": """CREATE TABLE batches (
    hull INTEGER NOT NULL,
    first INTEGER NOT NULL,
    last INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    payload BLOB NOT NULL
)""",
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
# The fence, and the first and last sequence, of a row with the events of many fences. A row that a format up to 6 has
# written has events of one fence, and another encoding.
MANY = (0, 0, 0)

# Up to format 6 the rows of events said where the events of a fence begin.
FORMAT_6 = {table: sql for table, sql in TABLES.items() if table != "starts"}
# Format 5 had no fences whose events are delayed.
FORMAT_5 = {table: sql for table, sql in FORMAT_6.items() if table != "delays"}
# Format 3 had no fences.
FORMAT_3 = {table: sql for table, sql in TABLES.items() if table not in FENCE_TABLES} | {
    "totals": """CREATE TABLE totals (
    id INTEGER PRIMARY KEY,
    commits INTEGER NOT NULL,
    hulls INTEGER NOT NULL,
    batches INTEGER NOT NULL,
    sum INTEGER NOT NULL,
    next_number INTEGER NOT NULL,
    mode INTEGER NOT NULL,
    checksum INTEGER NOT NULL
)""",
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
    "batches": TABLES["batches"],
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
    FORMAT: TABLES,
}

INSERT_HULL = "INSERT INTO hulls (id, name, uid, created, settings, checksum) VALUES (?, ?, ?, ?, ?, ?)"
INSERT_BATCH = "INSERT INTO batches (rowid, hull, first, last, checksum, payload) VALUES (?, ?, ?, ?, ?, ?)"
INSERT_CHUNK = "INSERT INTO chunks (rowid, snapshot, number, checksum, points) VALUES (?, ?, ?, ?, ?)"
INSERT_SNAPSHOT = "INSERT INTO snapshots (id, hull, revision, chunks, state, checksum) VALUES (?, ?, ?, ?, ?, ?)"
INSERT_FENCE = "INSERT INTO fences (id, name, uid, created, config, checksum) VALUES (?, ?, ?, ?, ?, ?)"
INSERT_EVENTS = "INSERT INTO events (rowid, fence, first, last, checksum, payload) VALUES (?, ?, ?, ?, ?, ?)"
SHRINK_EVENTS = "UPDATE events SET checksum = ?, payload = ? WHERE rowid = ?"
INSERT_INSIDE = (
    "INSERT INTO insides (rowid, fence, sequence, part, parts, checksum, payload) VALUES (?, ?, ?, ?, ?, ?, ?)"
)
INSERT_CONSUMER = "INSERT INTO consumers (rowid, fence, name, acknowledged, lost, checksum) VALUES (?, ?, ?, ?, ?, ?)"
INSERT_DELAY = "INSERT INTO delays (rowid, fence, checksum, payload) VALUES (?, ?, ?, ?)"
INSERT_START = "INSERT INTO starts (rowid, fence, first, checksum) VALUES (?, ?, ?, ?)"
UPDATE_TOTALS = (
    "UPDATE totals SET commits=?, hulls=?, batches=?, sum=?, next_number=?, mode=?, fence_rows=?, checksum=?"
)


def found(connection: sqlite3.Connection) -> tuple[int, int, dict[str, str | None]]:
    """The application id, the format and the tables of a database."""
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    return application, version, dict(connection.execute("SELECT name, sql FROM sqlite_schema"))


def stamp(connection: sqlite3.Connection) -> None:
    """Set the application id and the format."""
    connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    connection.execute(f"PRAGMA user_version = {FORMAT}")
