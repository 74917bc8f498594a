"""Dividing a database that has one partition among several, while a cluster serves it.

The command takes the partition as a worker would, by a planned move (`member`): it enters itself among the workers and
is wished for, offers to take the partition, and raises its epoch when the owner has let go. Then it divides all rows in
one transaction, which holds only if the partition is still its own, and gives the partitions to the cluster. Callers
wait at the gateways meanwhile.

With the transaction the cluster gets another secret. So a gateway that does not know yet that there are more partitions
reaches none of their owners, and what waits in it is passed on as soon as it knows.

Whenever the command dies, there is either one partition, which the workers take back as that of any worker which has
died, or there are all of the new ones.
"""

import logging
import secrets
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from typing import NamedTuple

import psycopg
from psycopg.errors import LockNotAvailable

from dynhull_server.storage.port import LockedError, StorageError

from ..postgres.database import Connection, Database, as_storage_errors, storage_error
from ..postgres.ownership import CHANNEL, REQUIRE, Leases, Ownership, taken_over, writer_name
from ..postgres.processes import this_process, this_worker
from ..postgres.reader import BegunReader
from ..postgres.schema import PREPARING_SECONDS, partitions_of
from ..postgres.splitting import require_together, split_rows
from ..postgres.storage import IDLE_SECONDS
from ..versions import apart, own_versions
from .board import LOOK, OFFER, SPLITS, Owner, Worker, join, read
from .joining import RENEW

# The number of an advisory lock that a split holds: "split".
SPLITTING = 0x73706C6974
# Seconds in which the owner has to let go.
PATIENCE = 60.0
# Where the others would reach it, if it served anything; servers without --cluster have none.
HOST = "split"
# Connections of a partition that are open all the time: for its lease, and for commits.
CONNECTIONS = 2
WISH = b"INSERT INTO wishes VALUES (0, %s) ON CONFLICT (partition) DO UPDATE SET worker = excluded.worker"
# What a command takes back: its own, and what one has left that was killed.
WITHDRAWN = [f"DELETE FROM {table} WHERE starts_with(worker, %s)".encode() for table in ("wishes", "heirs", "workers")]  # noqa: S608

log = logging.getLogger(__name__)


class Split(NamedTuple):
    """What has come of a split.

    Attributes:
        database: the database, for people.
        hulls: the number of hulls in each partition; empty if it was divided before.
        seconds: the time in which nobody served them.
    """

    database: str
    hulls: list[int]
    seconds: float


def split(database: Database, partitions: int) -> Split:
    """Divide a database that has one partition.

    Args:
        database: the database.
        partitions: how many partitions it is to have.

    Raises:
        FencesApartError: fences would lie apart from hulls that they need. Nothing was changed.
        LockedError: a server without --cluster serves it, or another split is at work. Nothing was changed.
        StorageError: it is divided otherwise, or cannot be used.
    """
    with as_storage_errors(), closing(database.connect("dynhull cluster split")) as connection:
        _be_alone(connection, database)
        if _is_divided(connection, database, partitions):
            return Split(str(database), [], 0.0)
        _require_room(connection, partitions)
        with connection.transaction():
            _require_together(connection, partitions)
        join(database, 1)
        with _taken(database, connection) as (owner, since):
            hulls = _divide(database, owner, partitions)
        return Split(str(database), hulls, time.monotonic() - since)


def _be_alone(connection: Connection, database: Database) -> None:
    """Keep other splits out until the connection ends; one that was killed may end a little later."""
    try:
        with connection.transaction():
            connection.execute(f"SET LOCAL lock_timeout = '{PREPARING_SECONDS}s'".encode())
            connection.execute("SELECT pg_advisory_lock(%s)", [SPLITTING])
    except LockNotAvailable:
        raise LockedError(f"another `dynhull cluster split` divides {database}") from None


def _is_divided(connection: Connection, database: Database, partitions: int) -> bool:
    """Whether there are that many partitions already. Raises StorageError unless there is one."""
    there = partitions_of(connection, database)
    if there is None:
        raise StorageError(f"{database} has no tables of dynhull")
    if there not in (1, partitions):
        raise StorageError(f"{database} has {there} partitions: only one that has a single partition can be divided")
    return there == partitions


def _require_room(connection: Connection, partitions: int) -> None:
    """Raise StorageError if PostgreSQL has too few connections for these partitions: there is no way back."""
    ((most,),) = connection.execute("SELECT current_setting('max_connections')::integer").fetchall()
    needed = CONNECTIONS * partitions
    if needed > most:
        raise StorageError(
            f"{partitions} partitions need {needed} connections to PostgreSQL at the least, and its max_connections is "
            f"{most}: raise that, or choose fewer partitions"
        )


def _require_together(connection: Connection, partitions: int) -> None:
    require_together(BegunReader(connection, 0), partitions)


@contextmanager
def _taken(database: Database, connection: Connection) -> Iterator[tuple[Ownership, float]]:
    """Own partition 0 within the block; yields since when nobody else does, too.

    Raises:
        LockedError: a server without --cluster has it, or the owner does not let go.
    """
    worker = f"{SPLITS}{this_worker()}"
    owner = Ownership(database, 0, log.error, worker)
    try:
        _withdraw(connection)
        connection.execute(f"LISTEN {CHANNEL}".encode())
        yield owner, _take(database, connection, owner, worker)
    finally:
        try:
            with suppress(psycopg.Error):  # then it is void in some seconds, as if the command had been killed
                _withdraw(connection)
        finally:
            owner.release()


def _withdraw(connection: Connection) -> None:
    for sql in WITHDRAWN:
        connection.execute(sql, [SPLITS])


def _take(database: Database, connection: Connection, owner: Ownership, worker: str) -> float:
    """Own partition 0, once its owner has let go; returns when that was seen."""
    begun = time.monotonic()
    leases = Leases()
    while True:
        connection.execute(RENEW, [worker, False, this_process(), HOST, own_versions().text])
        tables = read(connection)
        if strangers := tables.strangers():
            raise StorageError(apart(*min(strangers.items())))
        there = tables.owners.get(0)
        now = time.monotonic()
        with suppress(LockedError):  # of a worker that has it still, or was faster
            owner.take(leases)
            return now
        if there is not None and not there.free:
            _ask(database, connection, worker, there, tables.workers.get(there.worker))
        if now > begun + PATIENCE:
            raise LockedError(f"the owner of {database} does not let go of it: see its log, and run the command again")
        for _ in connection.notifies(timeout=LOOK, stop_after=1):
            continue


def _ask(database: Database, connection: Connection, worker: str, owner: Owner, present: Worker | None) -> None:
    """Have the owner let go for this worker. Raises LockedError if it never does."""
    if owner.connected and present is not None and not present.host:
        raise LockedError(
            f"{database} is served by {owner.worker} without --cluster, which nobody else can take over from: start "
            "`dynhull serve --cluster` beside it, then stop that server, whose hulls the cluster takes at once"
        )
    connection.execute(WISH, [worker])
    connection.execute(OFFER, [0, worker, this_process(), owner.epoch])
    connection.execute(f"NOTIFY {CHANNEL}".encode())


def _divide(database: Database, owner: Ownership, partitions: int) -> list[int]:
    """Divide all rows, as the owner of partition 0; returns the number of hulls in each partition."""
    with closing(database.connect(writer_name(0, owner.epoch))) as connection:
        try:
            hulls = _send(database, connection, owner, partitions)
        except psycopg.Error as error:
            raise StorageError(f"{database} was not divided: {storage_error(error)}") from error
        try:
            connection.execute("COMMIT")
        except psycopg.Error as error:
            raise StorageError(
                f"it is not known whether {database} is divided, because the connection was lost at the end: run the "
                "command again"
            ) from error
    return hulls


def _send(database: Database, connection: Connection, owner: Ownership, partitions: int) -> list[int]:
    """All of the transaction but its COMMIT."""
    # Whoever takes over from a command that stands still ends its transaction, by the name of the connection.
    connection.execute(f"SET idle_in_transaction_session_timeout = '{IDLE_SECONDS}s'".encode())
    connection.execute("BEGIN")
    if connection.execute(REQUIRE, owner.own).rowcount != 1:
        raise taken_over(database, 0)
    _require_together(connection, partitions)  # some may have been made meanwhile
    hulls = split_rows(connection, owner.epoch, partitions)
    connection.execute("UPDATE cluster SET secret = %s", [secrets.token_hex(32)])
    _withdraw(connection)
    connection.execute(f"NOTIFY {CHANNEL}".encode())
    return hulls
