"""Who owns a partition: one server at a time, with an epoch and a lease.

Taking a partition raises its epoch. Each commit first locks the row of the owner if the epoch is still its own, so that
a new owner waits for it, and so that nothing is committed under an old epoch. Renewing the lease does not wait for
commits, nor they for it: the lock is the one of a foreign key.

An owner shows that it is connected to the database by an advisory lock, which its session holds. All else that is known
of an owner is in tables, and so in every copy of the database, whose servers must not take it for theirs.

Reads are answered from memory, and so only within the lease. No wall clock decides when it ends, and clocks of
different machines are never compared. The owner counts from before it asked for the lease, and a margin less. A
successor counts from when it first saw the newest renewal. So the lease has ended for the owner first, if their clocks
run equally fast.
"""

import logging
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from psycopg.errors import LockNotAvailable

from dynhull_server.state.errors import words
from dynhull_server.storage.port import LockedError, StorageError, TakenOverError

from .database import Connection, Database, as_storage_errors
from .processes import is_known_dead, this_process, this_worker

# Seconds of a lease, between renewals, and by which an owner ends its own lease earlier.
LEASE, RENEWAL, MARGIN = 5.0, 1.0, 0.5
# Seconds between looks whether the lease of another server is renewed, for those who wait for that.
LOOK = 0.25
# Where it is said that a partition has changed hands.
CHANNEL = "dynhull"
# Seconds that an owner which was stopped inside of a transaction may hold up the next one.
LOCK_SECONDS = 1

log = logging.getLogger(__name__)

# The two numbers of the lock of an owner: the partition, from here on ("dyn"), and the epoch, up to a multiple.
HELD, EPOCHS = 0x64796E00, 2**31
HOLD = b"SELECT pg_advisory_lock_shared(%s, %s)"
# Whether the owner of a row is connected to this database, and not only to the one that this is a copy of.
IS_CONNECTED = (
    f"({HELD} + partition, mod(epoch, {EPOCHS})) IN (SELECT classid::bigint, objid::bigint FROM pg_locks "  # noqa: S608  (ours)
    "WHERE locktype = 'advisory' AND objsubid = 2 AND granted "
    "AND database = (SELECT oid FROM pg_database WHERE datname = current_database()))"
)
# The row of an owner. In a copy of the database, another one may have the same epoch.
OWN = "partition = %s AND epoch = %s AND worker = %s"
# Locks the row of an owner against the next one, but not against renewals.
REQUIRE = f"SELECT epoch FROM owners WHERE {OWN} FOR KEY SHARE".encode()  # noqa: S608  (ours)


@dataclass(frozen=True, slots=True)
class _Owner:
    epoch: int
    worker: str
    process: str
    until: str
    free: bool


def _now() -> float:
    """A clock in seconds; on Linux one that goes on while the machine is suspended, as the time of others does."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) if sys.platform == "linux" else time.monotonic()


class Leases:
    """Which leases have ended: those that this process has seen for as long as a lease lasts, without a renewal."""

    def __init__(self) -> None:
        self._seen: dict[int, tuple[str, float]] = {}

    def see(self, partition: int, until: str) -> None:
        """Notice until when the owner of a partition has said last that it has it."""
        if self._seen.get(partition, ("", 0.0))[0] != until:
            self._seen[partition] = until, _now()

    def seconds(self, partition: int) -> float:
        """For how long the owner of a partition, or that it has none, has been seen as it is."""
        seen = self._seen.get(partition)
        return 0.0 if seen is None else _now() - seen[1]

    def ended(self, partition: int) -> bool:
        """Whether the lease that was seen last has ended."""
        return self.seconds(partition) > LEASE

    def forget(self) -> None:
        """Begin anew."""
        self._seen.clear()


def writer_name(partition: int, epoch: int) -> str:
    """What the connection of an owner that commits is called."""
    return f"dynhull writer {partition}/{epoch}"


class Ownership:
    """The ownership of a partition, renewed by a thread of its own until `release`.

    Args:
        database: the database.
        partition: the partition.
        lost: called in the thread with the reason, when another server owns the partition or the thread has failed.
        worker: the name of the owner.

    Attributes:
        epoch: the epoch; 0 before `take`.
    """

    def __init__(self, database: Database, partition: int, lost: Callable[[str], None], worker: str = "") -> None:
        self._database = database
        self._partition = partition
        self._lost = lost
        self._worker = worker or this_worker()
        self._until = 0.0
        self._asked: float | None = None  # when the question was asked that has no answer yet
        self._turn = threading.Lock()  # of the connection
        self._connection: Connection | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self.epoch = 0

    @property
    def own(self) -> list[object]:
        """The values of OWN."""
        return [self._partition, self.epoch, self._worker]

    def holds(self) -> bool:
        """Whether the lease has not ended."""
        return _now() < self._until

    def connect(self) -> None:
        """Connect, so that `take` need not. Raises StorageError."""
        with self._turn, self._working():
            return

    def take(self, leases: Leases) -> None:
        """Own the partition, if nobody does, or a process that has ended, or one whose lease has ended.

        Args:
            leases: what this process has seen of leases; it sees that of the owner, too.

        Raises:
            LockedError: another server owns the partition.
            StorageError: the database cannot be used.
        """
        with self._turn, self._working() as connection:
            owner = self._try_to_take(connection, leases)
        if owner is not None:
            raise LockedError(
                f"{self._database} is served by {owner.worker}: stop that server first, or choose another database"
            )
        self._thread = threading.Thread(target=self._keep, name="lease", daemon=True)
        self._thread.start()
        threading.Thread(target=self._watch, name="lease watch", daemon=True).start()

    def announce(self, address: str) -> None:
        """Say where callers reach the owner from now on.

        Raises:
            TakenOverError: another server owns the partition.
            StorageError: the database cannot be reached.
        """
        with self._turn, self._working() as connection:
            said = connection.execute(
                f"UPDATE owners SET address = %s WHERE {OWN}".encode(),  # noqa: S608  (ours)
                [address, *self.own],
            )
            if said.rowcount != 1:
                raise taken_over(self._database, self._partition)
            connection.execute(f"NOTIFY {CHANNEL}".encode())

    def renew(self) -> None:
        """Renew the lease, and make all earlier commits durable.

        Raises:
            TakenOverError: another server owns the partition.
            StorageError: the database cannot be reached.
        """
        with self._turn, self._working() as connection:
            before = _now()
            renewed = connection.execute(
                f"UPDATE owners SET until = clock_timestamp() + make_interval(secs => %s) WHERE {OWN}".encode(),  # noqa: S608
                [LEASE, *self.own],
            )
            if renewed.rowcount != 1:
                self._until = 0.0
                raise taken_over(self._database, self._partition)
            self._until = before + LEASE - MARGIN

    def release(self) -> None:
        """Let another server own the partition at once; if the database does not answer, when the lease has ended."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(LOCK_SECONDS)
        self._until = 0.0
        if not self._turn.acquire(timeout=LOCK_SECONDS):
            return
        try:
            if self.epoch:
                with self._working() as connection:
                    connection.execute(
                        f"UPDATE owners SET until = '-infinity', process = '' WHERE {OWN}".encode(),  # noqa: S608
                        self.own,
                    )
                    connection.execute(f"NOTIFY {CHANNEL}".encode())
        except StorageError as error:
            log.warning("the lease was not returned", extra={"reason": words(error)})
        finally:
            self._disconnect()
            self._turn.release()

    def end_writers(self, connection: Connection, until: int) -> None:
        """End the other connections that could commit under an epoch, or an earlier one."""
        connection.execute(
            "SELECT pg_terminate_backend(pid, %s) FROM pg_stat_activity WHERE datname = current_database() "
            "AND pid <> pg_backend_pid() AND starts_with(application_name, %s) "
            "AND split_part(application_name, '/', 2)::bigint <= %s",
            [1000 * LOCK_SECONDS, writer_name(self._partition, 0)[:-1], until],
        )

    def _try_to_take(self, connection: Connection, leases: Leases) -> _Owner | None:
        """Own the partition if its last owner has ended; else that owner."""
        while (owner := self._owner(connection)) is None or self._has_ended(owner, leases):
            before = _now()
            try:
                epoch = self._succeed(connection, owner)
            except LockNotAvailable:  # it was stopped inside of a transaction, which has locked the row
                connection.execute("ROLLBACK")
                self.end_writers(connection, until=0 if owner is None else owner.epoch)
                continue
            if epoch is not None:
                self.epoch, self._until = epoch, before + LEASE - MARGIN
                self._show(connection)
                return None
        return owner

    def _has_ended(self, owner: _Owner, leases: Leases) -> bool:
        leases.see(self._partition, owner.until)
        return owner.free or leases.ended(self._partition) or is_known_dead(owner.process)

    def _owner(self, connection: Connection) -> _Owner | None:
        row = connection.execute(
            "SELECT epoch, worker, process, until::text, until = '-infinity' FROM owners WHERE partition = %s",
            [self._partition],
        ).fetchone()
        return None if row is None else _Owner(*row)

    def _succeed(self, connection: Connection, owner: _Owner | None) -> int | None:
        """Follow an owner, or nobody. The new epoch; None if another server was faster."""
        own = self._worker, this_process(), LEASE
        values = "%s, %s, '', clock_timestamp() + make_interval(secs => %s)"
        if owner is None:
            sql = f"INSERT INTO owners VALUES (%s, 1, {values}) ON CONFLICT DO NOTHING"  # noqa: S608  (ours)
            return 1 if connection.execute(sql.encode(), [self._partition, *own]).rowcount else None
        connection.execute("BEGIN")
        connection.execute(f"SET LOCAL lock_timeout = '{LOCK_SECONDS}s'".encode())
        same = "partition = %s AND epoch = %s AND until = %s::timestamptz"
        of_owner = self._partition, owner.epoch, owner.until
        locked = connection.execute(f"SELECT epoch FROM owners WHERE {same} FOR UPDATE".encode(), of_owner)  # noqa: S608
        if locked.rowcount:
            sql = f"UPDATE owners SET (epoch, worker, process, address, until) = (epoch + 1, {values}) WHERE {same}"  # noqa: S608
            connection.execute(sql.encode(), [*own, *of_owner])
        connection.execute("COMMIT")
        return owner.epoch + 1 if locked.rowcount else None

    def _keep(self) -> None:
        """Renew the lease until `release`. While the database is away, the lease ends, and begins anew afterwards."""
        away = False
        try:
            while not self._stop.wait(RENEWAL):
                try:
                    self.renew()
                except TakenOverError:
                    raise
                except StorageError as error:
                    if not away:
                        log.warning("the lease cannot be renewed; reads end with it", extra={"reason": words(error)})
                    away = True
                    continue
                if away:
                    log.info("the lease is renewed again")
                away = False
        except BaseException as error:
            self._until = 0.0
            self._lost(words(error))

    def _watch(self) -> None:
        """End connections to a database that is silent until `release`: who waits for an answer cannot."""
        while not self._stop.wait(RENEWAL):
            asked = self._asked
            if asked is not None:
                self._database.end_silent(_now() - asked)

    @contextmanager
    def _working(self) -> Iterator[Connection]:
        """The connection; after an error, the next one is another."""
        try:
            with as_storage_errors():
                self._asked = _now()
                if self._connection is None:
                    self._connection = self._database.connect(f"dynhull lease {self._partition}")
                    self._show(self._connection)
                yield self._connection
        except BaseException:
            self._disconnect()
            raise
        finally:
            self._asked = None

    def _show(self, connection: Connection) -> None:
        """Show that the owner is connected, to those who are connected to the same database."""
        if self.epoch:
            connection.execute(HOLD, [HELD + self._partition, self.epoch % EPOCHS])

    def _disconnect(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None


def follow_owner(connection: Connection, partition: int, epoch: int) -> None:
    """Have the first owner of a partition follow an epoch that an owner had in another database."""
    connection.execute("INSERT INTO owners VALUES (%s, %s, '', '', '', '-infinity')", [partition, epoch])


def taken_over(database: Database, partition: int) -> TakenOverError:
    """The error of an owner that is no longer one."""
    return TakenOverError(f"another server has taken over partition {partition} of {database}")
