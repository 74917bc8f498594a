"""What the processes of a cluster know of each other: small tables that each of them reads, twice a second at least.

Nothing here decides who owns a partition, which is for `postgres.ownership`. A worker that does not renew its row in
`workers` gets no partitions, by the clock of PostgreSQL and nobody else's, with which `joining` compares that of each.
"""

import asyncio
import logging
import secrets
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

import psycopg

from dynhull_server.settings import Settings
from dynhull_server.state.errors import words
from dynhull_server.storage.port import StorageError

from ..postgres.database import Connection, Database, as_storage_errors, storage_error
from ..postgres.origin import begin_anew_if_copied
from ..postgres.ownership import CHANNEL, IS_CONNECTED, LEASE, Leases
from ..postgres.processes import is_known_dead, this_process
from ..postgres.schema import hold, partitions_of, prepare
from ..versions import UNSAID, Versions, own_versions
from .joining import BOARD, PRESENT, RENEW, VERSIONS, clock_difference, versions_of

# Seconds between looks at the tables, and until a look that gets no answer is given up.
LOOK, PATIENCE = 0.5, 10.0
# Seconds between two looks after which it is not known whether leases were renewed in between.
GAP = 2.0
# Seconds that a worker which ends takes to say so.
LAST_SECONDS = 1.0
# What the name of a worker begins with that serves nothing, but divides the database (`split`).
SPLITS = "split by "

log = logging.getLogger(__name__)

TABLES = (
    "CREATE TABLE IF NOT EXISTS cluster (secret text NOT NULL)",
    "ALTER TABLE cluster ADD COLUMN IF NOT EXISTS database text",
    "CREATE TABLE IF NOT EXISTS workers (worker text PRIMARY KEY, draining boolean, process text, seen timestamptz)",
    "ALTER TABLE workers ADD COLUMN IF NOT EXISTS process text NOT NULL DEFAULT ''",
    "ALTER TABLE workers ADD COLUMN IF NOT EXISTS host text NOT NULL DEFAULT ''",
    "ALTER TABLE workers ADD COLUMN IF NOT EXISTS versions text NOT NULL DEFAULT ''",
    "CREATE TABLE IF NOT EXISTS heirs (partition integer PRIMARY KEY, worker text, process text, epoch bigint)",
    "CREATE TABLE IF NOT EXISTS wishes (partition integer PRIMARY KEY, worker text NOT NULL)",
)
# Those of a standby are the same, those of what pg_restore has filled are not.
IDENTITY = (
    b"SELECT system_identifier || '/' || oid FROM pg_control_system(), pg_database WHERE datname = current_database()"
)
OWNERS = (
    "SELECT partition, epoch, worker, process, address, until::text, until = '-infinity', "  # noqa: S608  (ours)
    f"{IS_CONNECTED}, until > clock_timestamp() FROM owners"
).encode()
WORKERS = (
    f"SELECT worker, draining, process, host, {VERSIONS} FROM workers "  # noqa: S608  (ours)
    f"WHERE seen > clock_timestamp() - interval '{PRESENT}s' ORDER BY worker"
).encode()
WISHES = b"SELECT partition, worker FROM wishes"
HEIRS = b"SELECT partition, worker, process, epoch FROM heirs"
# Read last: who sees that an owner has let go, to divide the database, sees that it was divided.
PARTITIONS = b"SELECT partitions FROM format"
OFFER = (
    b"INSERT INTO heirs VALUES (%s, %s, %s, %s) ON CONFLICT (partition) "
    b"DO UPDATE SET worker = excluded.worker, process = excluded.process, epoch = excluded.epoch"
)
WITHDRAW = b"DELETE FROM heirs WHERE partition = %s AND worker = %s AND process = %s"
ALL = OWNERS, WORKERS, WISHES, HEIRS, PARTITIONS
GONE = (
    f"DELETE FROM workers WHERE seen < clock_timestamp() - interval '{20 * PRESENT}s'"  # noqa: S608  (ours)
).encode()


class Owner(NamedTuple):
    """The row of an owner: of which `until` changes with each renewal, and says nothing else to other machines.

    A copy of the database has the same rows, but none of the owners is `connected` to it. Whether the lease has been
    `renewed` is what PostgreSQL's clock says: for people, because nobody takes a partition by a clock.
    """

    epoch: int
    worker: str
    process: str
    address: str
    until: str
    free: bool
    connected: bool
    renewed: bool = True

    @property
    def serves(self) -> bool:
        """Whether callers can expect answers."""
        return not self.free and self.connected and self.renewed


class Worker(NamedTuple):
    """A worker that is present, and whether it is to give up its partitions; without --cluster it has no host."""

    draining: bool
    process: str
    host: str = ""
    versions: Versions = UNSAID


class Heir(NamedTuple):
    """A worker that has read what an owner has, up to the last moment, and takes the partition once that lets go."""

    worker: str
    process: str
    epoch: int


class Tables(NamedTuple):
    """The tables at one moment.

    Attributes:
        owners: the rows of the owners, by partition; a partition that nobody has had yet has none.
        workers: the workers that are present.
        wishes: the workers that are to have some of the partitions.
        heirs: the workers that are ready to take some of the partitions.
        partitions: the number of partitions.
    """

    owners: dict[int, Owner]
    workers: dict[str, Worker]
    wishes: dict[int, str]
    heirs: dict[int, Heir]
    partitions: int = 1

    def apart(self) -> dict[str, str]:
        """The workers that have partitions and are not connected to the database, each with its process."""
        owners = self.owners.values()
        here = {each.worker for each in owners if each.connected} | set(self.strangers())
        return {each.worker: each.process for each in owners if not each.free and each.worker not in here}

    def alone(self) -> list[str]:
        """The servers without --cluster that are there: while they are, nobody else has any partition."""
        return [name for name, each in self.workers.items() if not each.host and not is_known_dead(each.process)]

    def strangers(self) -> dict[str, Versions]:
        """The workers that are present and have no version of the protocol in common with this program."""
        said = {worker: each.versions for worker, each in self.workers.items()}
        return {worker: versions for worker, versions in said.items() if not own_versions().meet(versions)}


class Cluster(NamedTuple):
    """What does not change while a cluster runs, unless the database is split (`split`).

    Attributes:
        partitions: the number of partitions.
        secret: what its processes know each other by.
    """

    partitions: int
    secret: str


def partitions_of_new(settings: Settings) -> int:
    """The number of partitions that a new database gets: without --cluster, one for each worker."""
    return settings.partitions if settings.cluster else settings.workers or 1


def join(database: Database, partitions: int) -> Cluster:
    """The cluster of a database, which is prepared for one, with this number of partitions if it has no tables yet.

    Raises:
        StorageError: the database cannot be used.
    """
    with as_storage_errors(), database.connect("dynhull start") as connection, connection.transaction():
        hold(connection, database)
        there = partitions_of(connection, database) or partitions
        prepare(connection, database, there)
        begin_anew_if_copied(connection, database, there)
        with connection.pipeline():
            for each in TABLES:
                connection.execute(each.encode())
            connection.execute(GONE)
        secret = _secret(connection)
    return Cluster(there, secret)


def _secret(connection: Connection) -> str:
    """The secret of the cluster.

    A copy of a database gets one of its own: its tables name workers of the original, which would take calls for it.
    """
    ((database,),) = connection.execute(IDENTITY).fetchall()
    found = connection.execute("SELECT secret, database FROM cluster").fetchone()
    secret, known = found or ("", "")
    if known not in (None, database):
        secret = secrets.token_hex(32)
    if known != database:
        connection.execute("DELETE FROM cluster")
        connection.execute("INSERT INTO cluster VALUES (%s, %s)", [secret, database])
    return str(secret)


def read(connection: Connection) -> Tables:
    """The tables now; of a database that was never that of a cluster, its owners."""
    if not is_of_cluster(connection):
        owners, partitions = (connection.execute(sql).fetchall() for sql in (OWNERS, PARTITIONS))
        return _tables([owners, [], [], [], partitions])
    return _tables([connection.execute(sql).fetchall() for sql in ALL])


def is_of_cluster(connection: Connection) -> bool:
    """Whether a database has the tables of a cluster."""
    return connection.execute("SELECT to_regclass('cluster') IS NOT NULL").fetchone() == (True,)


class Board:
    """Reads the tables from `run` on, again and again; while the database is away, what it has read last stays.

    Args:
        database: the database.
        changed: called with the tables after each look.
        leases: what this process sees of leases.
        worker: the worker whose row it renews; empty for a process that only reads.
        host: where the worker listens for the others.

    Attributes:
        tables: the last tables.
        leaving: whether the worker gives up its partitions, and takes no others.
        clock_difference: seconds by which the clock of a worker's machine is ahead of that of the database.
    """

    def __init__(
        self,
        database: Database,
        changed: Callable[[Tables], None],
        leases: Leases,
        worker: str = "",
        host: str = "",
    ) -> None:
        self.tables = Tables({}, {}, {}, {}, 0)
        self.leaving = False
        self.clock_difference = 0.0
        self._database = database
        self._changed = changed
        self._worker = worker
        self._host = host
        self._leases = leases
        self._renewed = 0.0, False
        self._looked: float | None = None

    def is_free(self, partition: int) -> bool:
        """Whether a partition can be taken at once."""
        owner = self.tables.owners.get(partition)
        return owner is None or owner.free or self._leases.ended(partition) or is_known_dead(owner.process)

    def forsaken(self, partition: int, worker: str) -> bool:
        """Whether nobody has a partition, and the worker that should take it has died, or does not do it."""
        owner = self.tables.owners.get(partition)
        if owner is None:
            return False
        if self._leases.seconds(partition) > (LEASE if owner.free else 2 * LEASE):
            return True
        there = self.tables.workers.get(worker)
        return owner.free and there is not None and is_known_dead(there.process)

    def heir(self, partition: int) -> str:
        """The worker that has read what the owner has, or had when it let go; empty for none."""
        owner, heir = self.tables.owners.get(partition), self.tables.heirs.get(partition)
        if owner is None or heir is None or heir.epoch != owner.epoch:
            return ""
        there = self.tables.workers.get(heir.worker)
        known = there is not None and there.process == heir.process and not is_known_dead(heir.process)
        return heir.worker if known else ""

    def holders(self, partitions: int) -> list[str]:
        """Which worker has each partition, as far as is known; empty for none."""
        owners = self.tables.owners
        return [
            "" if (owner := owners.get(each)) is None or owner.free or self._leases.ended(each) else owner.worker
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

    async def offer(self, partition: int, epoch: int) -> None:
        """Say that the worker has read what the owner of that epoch has, and waits for it to let go.

        Raises:
            StorageError, OSError: the database cannot be used.
        """
        await self._say(OFFER, [partition, self._worker, this_process(), epoch])

    async def withdraw(self, partition: int) -> None:
        """Say that the worker does not wait any more."""
        await self._say(WITHDRAW, [partition, self._worker, this_process()])

    async def leave(self) -> None:
        """Remove the row of the worker; if the database is away, it expires."""
        try:
            async with asyncio.timeout(LAST_SECONDS):
                await self._say(b"DELETE FROM workers WHERE worker = %s", [self._worker])
        except (StorageError, OSError) as error:
            log.warning("the worker has not signed off", extra={"reason": words(error)})

    async def _say(self, sql: bytes, values: list[object]) -> None:
        """Write into the tables, and have all processes look at them."""
        try:
            async with asyncio.timeout(PATIENCE), self._connected() as connection:
                await connection.execute(sql, values)
                await connection.execute(f"NOTIFY {CHANNEL}".encode())
        except psycopg.Error as error:
            raise storage_error(error) from error

    async def _look(self, connection: "psycopg.AsyncConnection[tuple[Any, ...]]") -> None:
        now = time.monotonic()
        renewed, leaving = self._renewed
        if self._worker and (now >= renewed + LOOK or leaving != self.leaving):
            before = time.time()
            said = await connection.execute(
                RENEW, [self._worker, self.leaving, this_process(), self._host, own_versions().text]
            )
            ((there,),) = await said.fetchall()
            self.clock_difference = clock_difference(before, there, time.time())
            self._renewed = now, self.leaving
        async with connection.pipeline():
            cursors = [await connection.execute(sql) for sql in ALL]
        self.tables = _tables([await each.fetchall() for each in cursors])
        now = time.monotonic()
        if self._looked is not None and now > self._looked + GAP:  # perhaps the owners could not renew them either
            self._leases.forget()
        self._looked = now
        for partition, owner in self.tables.owners.items():
            self._leases.see(partition, owner.until)
        self._changed(self.tables)

    @asynccontextmanager
    async def _connected(self) -> AsyncIterator["psycopg.AsyncConnection[tuple[Any, ...]]"]:
        connection = await self._database.connect_async(f"{BOARD} {self._worker}".strip())
        try:
            await connection.execute(f"LISTEN {CHANNEL}".encode())
            yield connection
        finally:
            await connection.close()


def _tables(rows: list[list[Any]]) -> Tables:
    owners, workers, wishes, heirs, ((partitions,),) = rows
    return Tables(
        {partition: Owner(*rest) for partition, *rest in owners},
        {
            worker: Worker(draining, process, host, versions_of(*said))
            for worker, draining, process, host, *said in workers
        },
        dict(wishes),
        {partition: Heir(*rest) for partition, *rest in heirs},
        partitions,
    )
