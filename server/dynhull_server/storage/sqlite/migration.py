"""Creation of the tables, migration from older formats, and other incarnations; each inside a transaction."""

import sqlite3
from collections.abc import Iterable, Mapping

from ...state.changes import Change
from ..rows.fence_runs import Start
from ..rows.group import AnyStep, Group
from ..rows.hull_rows import values
from ..rows.incarnation import anew
from ..rows.ledger import Ledger
from ..rows.tables import COMMITS_SINCE
from ..rows.totals import Totals
from .readers import SQLiteReader
from .schema import ADD_COMMITS, FENCE_TABLES, INSERT, SCHEMAS, TABLES, carry_out, renew_totals, stamp


def make_tables(connection: sqlite3.Connection) -> None:
    """Create the tables in an empty database."""
    for sql in TABLES.values():
        connection.execute(sql)
    renew_totals(connection, Totals())
    stamp(connection)


def migrate(connection: sqlite3.Connection, version: int, ledger: Ledger, starts: Mapping[int, int]) -> None:
    """Migrate a database of an older format. O(hulls and fences): batches, snapshots and events are not rewritten.

    Args:
        connection: a connection to the database.
        version: its format.
        ledger: its rows.
        starts: where the events of fences begin that have dropped some, by number, if the format does not store it.
    """
    if version == 1:
        for index in ("batches_by_revision", "chunks_by_number"):
            connection.execute(f"DROP INDEX {index}")
    else:
        connection.execute("DROP TABLE totals")
    for table in ("totals", *(table for table in (*FENCE_TABLES, "segments") if table not in SCHEMAS[version])):
        connection.execute(TABLES[table])
    for sql in ADD_COMMITS if version < COMMITS_SINCE else ():
        connection.execute(sql)
    connection.execute("DROP TABLE hulls")
    connection.execute(TABLES["hulls"])
    connection.executemany(INSERT["hulls"], (values(hull.row) for hull in ledger.hulls.values()))
    for number, first in starts.items():
        start, stored = Start.at(next(ledger.start_ids), number, first)
        connection.execute(INSERT["starts"], (start.place, number, first, stored))
        ledger.fences[number].begin(start, 0)
        ledger.totals = ledger.totals.plus(0, 0, start.weight, 1)
    renew_totals(connection, ledger.totals)
    stamp(connection)


def begin_anew(connection: sqlite3.Connection, ledger: Ledger, incarnation: str) -> None:
    """Make another incarnation of a database, whose fences begin with who is inside. O(hulls, fences and who is in)."""
    for changes in anew(SQLiteReader(connection), ledger, incarnation):
        change(connection, ledger, changes)
    renew_totals(connection, ledger.totals)


def change(connection: sqlite3.Connection, ledger: Ledger, changes: Iterable[Change | AnyStep]) -> None:
    """Change rows, but not the totals in the database."""
    group = Group(ledger, changes)
    carry_out(connection, group.statements)
    group.adopt()
