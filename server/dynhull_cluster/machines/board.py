"""What the processes of a cluster know of each other: small tables that each of them reads, twice a second at least.

Nothing here decides who owns a partition, which is for `postgres.ownership`. A worker that does not renew its row in
`workers` gets no partitions, by the clock of PostgreSQL and nobody else's, and that is all that this clock is for.
"""

import asyncio
import logging
import secrets
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

import psycopg

from dynhull_server.state.errors import words
from dynhull_server.storage.port import StorageError

from ..postgres.database import Connection, Database, as_storage_errors
from ..postgres.ownership import CHANNEL, LEASE
from ..postgres.schema import hold, partitions_of, prepare

# Seconds between looks at the tables, and until a look that gets no answer is given up.
LOOK, PATIENCE = 0.5, 10.0
# Seconds after which a worker that does not renew its row is one no longer.
PRESENT = 5

log = logging.getLogger(__name__)

TABLES = (
    "CREATE TABLE IF NOT EXISTS cluster (secret text NOT NULL)",
    "CREATE TABLE IF NOT EXISTS workers (worker text PRIMARY KEY, draining boolean NOT NULL, seen timestamptz)",
    "CREATE TABLE IF NOT EXISTS wishes (partition integer PRIMARY KEY, worker text NOT NULL)",
)
OWNERS = b"SELECT partition, epoch, worker, process, address, until::text, until = '-infinity' FROM owners"
WORKERS = (
    f"SELECT worker, draining FROM workers WHERE seen > clock_timestamp() - interval '{PRESENT}s' "  # noqa: S608  (ours)
    "ORDER BY worker"
).encode()
WISHES = b"SELECT partition, worker FROM wishes"
RENEW = (
    b"INSERT INTO workers VALUES (%s, %s, clock_timestamp()) ON CONFLICT (worker) "
    b"DO UPDATE SET seen = clock_timestamp(), draining = workers.draining OR excluded.draining"
)
GONE = (
    f"DELETE FROM workers WHERE seen < clock_timestamp() - interval '{20 * PRESENT}s'"  # noqa: S608  (ours)
).encode()


class Owner(NamedTuple):
    """The row of an owner: of which `until` changes with each renewal, and says nothing else to other machines."""

    epoch: int
    worker: str
    process: str
    address: str
    until: str
    free: bool


class Tables(NamedTuple):
    """The tables at one moment.

    Attributes:
        owners: the rows of the owners, by partition; a partition that nobody has had yet has none.
        workers: whether each of the workers that are present is to give up its partitions.
        wishes: the workers that are to have some of the partitions.
    """

    owners: dict[int, Owner]
    workers: dict[str, bool]
    wishes: dict[int, str]


class Cluster(NamedTuple):
    """What does not change while a cluster runs.

    Attributes:
        partitions: the number of partitions.
        secret: what its processes know each other by.
    """

    partitions: int
    secret: str


def join(database: Database, partitions: int) -> Cluster:
    """The cluster of a database, which is prepared for one, with this number of partitions if it has no tables yet.

    Raises:
        StorageError: the database cannot be used.
    """
    with as_storage_errors(), database.connect("dynhull start") as connection, connection.transaction():
        hold(connection, database)
        there = partitions_of(connection, database) or partitions
        prepare(connection, database, there)
        for each in TABLES:
            connection.execute(each.encode())
        connection.execute(GONE)
        found = connection.execute("SELECT secret FROM cluster").fetchone()
        if found is None:
            found = (secrets.token_hex(32),)
            connection.execute("INSERT INTO cluster VALUES (%s)", found)
    return Cluster(there, found[0])


def read(connection: Connection) -> Tables:
    """The tables now."""
    owners, workers, wishes = (connection.execute(sql).fetchall() for sql in (OWNERS, WORKERS, WISHES))
    return _tables(owners, workers, wishes)


class Board:
    """Reads the tables from `run` on, again and again; while the database is away, what it has read last stays.

    Args:
        database: the database.
        changed: called with the tables after each look.
        worker: the worker whose row it renews; empty for a process that only reads.

    Attributes:
        tables: the last tables.
        leaving: whether the worker gives up its partitions, and takes no others.
    """

    def __init__(self, database: Database, changed: Callable[[Tables], None], worker: str = "") -> None:
        self.tables = Tables({}, {}, {})
        self.leaving = False
        self._database = database
        self._changed = changed
        self._worker = worker
        self._since: dict[int, tuple[str, float]] = {}

    def lapsed(self, partition: int) -> str | None:
        """The lease of an owner that has not been renewed for so long that it has ended; None of another."""
        owner = self.tables.owners.get(partition)
        if owner is None or owner.free:
            return None
        until, since = self._since[partition]
        return until if time.monotonic() > since + LEASE else None

    def holders(self, partitions: int) -> list[str]:
        """Which worker has each partition, as far as is known; empty for none."""
        owners = self.tables.owners
        return [
            "" if (owner := owners.get(each)) is None or owner.free or self.lapsed(each) else owner.worker
            for each in range(partitions)
        ]

    async def run(self) -> None:
        """Read the tables until cancelled. An error of the database is logged once, until it answers again."""
        away = False
        while True:
            try:
                async with self._connected() as connection:
                    while True:
                        async with asyncio.timeout(PATIENCE):
                            await self._look(connection)
                        if away:
                            log.info("the tables of the cluster can be read again")
                        away = False
                        async for _ in connection.notifies(timeout=LOOK, stop_after=1):
                            pass
            except (StorageError, psycopg.Error, OSError, TimeoutError) as error:
                if not away:
                    log.warning("the tables of the cluster cannot be read", extra={"reason": words(error)})
                away = True
                await asyncio.sleep(LOOK)

    async def leave(self) -> None:
        """Remove the row of the worker; if the database is away, it expires."""
        try:
            async with asyncio.timeout(1.0), self._connected() as connection:
                await connection.execute("DELETE FROM workers WHERE worker = %s", [self._worker])
                await connection.execute(f"NOTIFY {CHANNEL}".encode())
        except (StorageError, psycopg.Error, OSError, TimeoutError) as error:
            log.warning("the worker has not signed off", extra={"reason": words(error)})

    async def _look(self, connection: "psycopg.AsyncConnection[tuple[Any, ...]]") -> None:
        if self._worker:
            await connection.execute(RENEW, [self._worker, self.leaving])
        rows = [await (await connection.execute(sql)).fetchall() for sql in (OWNERS, WORKERS, WISHES)]
        self.tables = _tables(*rows)
        now = time.monotonic()
        for partition, owner in self.tables.owners.items():
            if self._since.get(partition, ("", 0.0))[0] != owner.until:
                self._since[partition] = owner.until, now
        self._changed(self.tables)

    @asynccontextmanager
    async def _connected(self) -> AsyncIterator["psycopg.AsyncConnection[tuple[Any, ...]]"]:
        connection = await self._database.connect_async(f"dynhull board {self._worker}".strip())
        try:
            await connection.execute(f"LISTEN {CHANNEL}".encode())
            yield connection
        finally:
            await connection.close()


def _tables(owners: list[Any], workers: list[Any], wishes: list[Any]) -> Tables:
    return Tables({partition: Owner(*rest) for partition, *rest in owners}, dict(workers), dict(wishes))
