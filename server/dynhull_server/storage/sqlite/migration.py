"""Creation of the tables, and migration from older formats. Each function runs inside a transaction."""

import sqlite3

from .encoding import hull_checksum
from .ledger import Ledger
from .schema import INSERT_HULL, TABLES, stamp
from .totals import Totals, renew_totals


def make_tables(connection: sqlite3.Connection) -> None:
    """Create the tables in an empty database."""
    for sql in TABLES.values():
        connection.execute(sql)
    renew_totals(connection, Totals())
    stamp(connection)


def migrate(connection: sqlite3.Connection, ledger: Ledger) -> None:
    """Migrate a database of format 1. Batches and snapshots are not rewritten.

    Args:
        connection: a connection to the database.
        ledger: its rows.
    """
    for index in ("batches_by_revision", "chunks_by_number"):
        connection.execute(f"DROP INDEX {index}")
    connection.execute("DROP TABLE hulls")
    for table in ("hulls", "totals"):
        connection.execute(TABLES[table])
    rows = (hull.row for hull in ledger.hulls.values())
    connection.executemany(
        INSERT_HULL,
        ((row.number, row.name, row.uid, row.created, row.settings.max_points, hull_checksum(row)) for row in rows),
    )
    renew_totals(connection, ledger.totals)
    stamp(connection)
