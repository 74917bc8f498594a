"""Where the rows of a partition were committed last: in which cluster of PostgreSQL, database and timeline.

A database that `pg_restore` has filled is another one, and one that was led back to a moment, or was a standby, is on
another timeline. What it has may be older than what callers have. An owner that goes on there has compared the totals,
and notes the new place with its next commit. If there is no such owner, the next start makes another incarnation.
"""

import logging
from itertools import chain

from dynhull_server.storage.rows.group import Group
from dynhull_server.storage.rows.incarnation import anew, new_incarnation

from .database import Connection, Database
from .examination import examined
from .ownership import IS_CONNECTED
from .reader import PostgresReader
from .schema import put_totals, queries_of

log = logging.getLogger(__name__)

TABLE = b"CREATE TABLE IF NOT EXISTS places (partition integer PRIMARY KEY, place text NOT NULL)"
# Some services keep the first of these from their users.
CLUSTER = b"SELECT system_identifier FROM pg_control_system()"
MAY_KNOW_CLUSTER = b"SELECT has_function_privilege('pg_control_system()', 'EXECUTE')"
DATABASE = (
    b"SELECT oid, left(pg_walfile_name(pg_current_wal_lsn()), 8) FROM pg_database WHERE datname = current_database()"
)
NOTE = (
    b"INSERT INTO places SELECT unnest(%s::integer[]), %s ON CONFLICT (partition) DO UPDATE SET place = excluded.place "
    b"WHERE places.place <> excluded.place"
)


def place_of(connection: Connection) -> str:
    """Where what is committed now is."""
    cluster = ""
    if connection.execute(MAY_KNOW_CLUSTER).fetchone() == (True,):
        ((cluster,),) = connection.execute(CLUSTER).fetchall()
    ((database, timeline),) = connection.execute(DATABASE).fetchall()
    return f"{cluster}/{database}/{timeline}"


def begin_anew_if_copied(connection: Connection, database: Database, partitions: int) -> None:
    """Make another incarnation of all partitions if one of them was committed elsewhere, and nobody goes on with it.

    In a transaction in which the tables were prepared. All of them: a hull over shards has its uid in several.
    """
    connection.execute(TABLE)
    place = place_of(connection)
    noted = dict(connection.execute("SELECT partition, place FROM places").fetchall())
    if any(each != place for each in noted.values()):
        if connection.execute(f"SELECT FROM owners WHERE {IS_CONNECTED}".encode()).rowcount:
            return
        if not _begin_anew(connection, partitions):
            return
        log.warning(
            "the database is a copy, or was led back to a moment, and may lack what was committed since: hulls and "
            "fences have other uids, fences begin with who is inside, and writers with numbers that it lacks end with "
            "RESTORED",
            extra={"database": str(database), "noted": ", ".join(sorted(set(noted.values()))), "place": place},
        )
    if new := [each for each in range(partitions) if noted.get(each) != place]:
        connection.execute(NOTE, [new, place])


def _begin_anew(connection: Connection, partitions: int) -> bool:
    """Make another incarnation of all partitions; returns whether that was possible: damage is for the start to say."""
    connection.execute("SELECT epoch FROM owners FOR UPDATE")
    found = [examined(connection, partition, lambda *_: None) for partition in range(partitions)]
    if any(each.fatal for each in found):
        return False
    connection.execute("UPDATE owners SET epoch = epoch + 1")  # nobody commits what follows the rows of before
    incarnation = new_incarnation()
    for partition, findings in enumerate(found):
        ledger = findings.ledger
        for changes in chain([findings.repairs], anew(PostgresReader(connection, partition), ledger, incarnation)):
            group = Group(ledger, changes)
            for sql, values in queries_of(partition, group.statements):
                connection.execute(sql, values)
            group.adopt()
        put_totals(connection, partition, ledger.totals)
    return True
