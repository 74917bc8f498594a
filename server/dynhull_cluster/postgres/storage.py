"""The storage on PostgreSQL: an implementation of the port.

Outcomes. Everything of a commit but its COMMIT is sent in one piece, and nothing of it stays if that fails. After an
error of COMMIT itself the outcome is unknown: `settle` ends the connection that it was sent on, waits until its
transaction has ended, and reads what there is.

A commit takes place only if the epoch is still that of this server, and if the totals are those of its last commit.
The second fails if PostgreSQL has lost commits, as it may in a crash without `synchronous_commit`, or if it was
replaced by a copy. In both cases what this server has in memory is not what the database has, and its process must end.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from functools import partial

import psycopg
from psycopg.errors import DiskFull

from dynhull_server.state.changes import Change
from dynhull_server.state.errors import words, words_for_callers
from dynhull_server.state.records import CommitStamp
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.opening import closed_on_error
from dynhull_server.storage.port import (
    DamagedError,
    NotCommittedError,
    Progress,
    StorageError,
    StorageStep,
    StoredContents,
    TakenOverError,
)
from dynhull_server.storage.refusals import Meaning
from dynhull_server.storage.rows.examine import Findings
from dynhull_server.storage.rows.group import Group
from dynhull_server.storage.rows.storage import RowStorage
from dynhull_server.storage.rows.totals import COPIES
from dynhull_server.storage.segments.archive import Archive

from .database import Connection, Database, as_storage_errors, storage_error
from .examination import examined
from .follower import Follower
from .origin import NOTE, begin_anew_if_copied, place_of
from .ownership import REQUIRE, Leases, Ownership, taken_over, writer_name
from .reader import BegunReader, PostgresReader, ReaderPool
from .schema import UPDATE_TOTALS, hold, prepare, put_totals, queries_of, require_partitions

# With `off` commits survive the end of this process; a crash of PostgreSQL may lose those since the last `sync`.
SYNCHRONOUS = {Durability.SYNC: "on", Durability.INTERVAL: "off", Durability.NONE: "off"}
# Seconds after which PostgreSQL ends a transaction of a process that was stopped.
IDLE_SECONDS = 10
# Seconds between looks at the size of the database.
SIZE_SECONDS = 10.0

SIZE = b"""
SELECT coalesce(sum(pg_total_relation_size(oid)), 0)::bigint FROM pg_class
WHERE relnamespace = to_regnamespace(current_schema()) AND relkind = 'r'
"""


class PostgresStorage(RowStorage):
    """Hulls in a partition of a database.

    A thread of its own renews the lease from `open` to `close`.

    Args:
        database: the database.
        lost: called, in a thread, with the reason when another server has taken the partition over.
        durability: the durability of a commit.
        partition: the partition.
        partitions: the number of partitions of the database.
        worker: what others call this server.
        leases: what this process has seen of leases.
        archive: has what the journal drops of hulls with a history; None for a server that reads and writes none of it.
    """

    def __init__(
        self,
        database: Database,
        lost: Callable[[str], None],
        durability: Durability = Durability.SYNC,
        *,
        partition: int = 0,
        partitions: int = 1,
        worker: str = "",
        leases: Leases | None = None,
        archive: Archive | None = None,
    ) -> None:
        super().__init__(archive)
        self._database = database
        self._durability = durability
        self._partition = partition
        self._partitions = partitions
        self._owner = Ownership(database, partition, lost, worker)
        self._leases = leases or Leases()
        self._follower: Follower | None = None
        self._spare: Connection | None = None
        self._writer: Connection | None = None
        self._not_durable = False
        self._size = 0
        self._size_due = 0.0
        self._open = ExitStack()

    def entitled(self) -> bool:
        """Whether this server may answer reads: no other one owns the partition."""
        return self._owner.holds()

    @property
    def followed_epoch(self) -> int:
        """The epoch of the owner that is followed; 0 before `follow`, and after `open`."""
        return 0 if self._follower is None else self._follower.epoch

    def announce(self, address: str) -> None:
        """Say where callers reach this server. Raises TakenOverError, or StorageError."""
        self._owner.announce(address)

    # Opening and closing

    def follow(self, progress: Progress) -> StoredContents:
        """Read the partition while another server owns it, and later what has come since."""
        if self._follower is None:
            with ExitStack() as stack:
                self._follower = Follower(self._prepared(), self._partition, self._place)
                stack.callback(self._follower.close)
                stack.callback(self._owner.release)
                self._owner.connect()
                self._spare = self._connect_writer(f"dynhull ahead {self._partition}")
                stack.callback(self._spare.close)
                self._follower.begin(progress)
                self._open = stack.pop_all()
        else:
            self._follower.go_on()
        self._ledger = self._follower.ledger
        return self._contents([])

    def open(self, progress: Progress) -> StoredContents:
        """Own the partition, examine it, repair what can be repaired, and load it."""
        with ExitStack() as stack:
            stack.push(self._open.pop_all())
            findings = self._examine(stack, progress) if self._follower is None else self._take_followed(self._follower)
            if findings.fatal:
                raise DamagedError(f"{self._place}: {'; '.join(findings.fatal)}: restore a backup")
            stack.callback(self._disconnect)
            self.epoch = self._owner.epoch
            self._ledger = findings.ledger
            if not findings.both_totals:
                self._restore_totals()
            if self._follower is None or findings.repairs:
                self._write(Group(self._ledger, findings.repairs))
            idle = () if self._follower is None else (self._follower.connection,)
            self._follower = None
            self._readers = ReaderPool(
                partial(self._database.connect, f"dynhull reader {self._partition}"), self._partition, idle
            )
            stack.callback(self._readers.close)
            self._open = stack.pop_all()
        return self._contents([f"{self._place}: {note}" for note in findings.notes])

    def _examine(self, stack: ExitStack, progress: Progress) -> Findings:
        """Own the partition, and examine it."""
        with closing(self._prepared()) as connection, as_storage_errors():
            stack.callback(self._owner.release)
            self._owner.take(self._leases)
            connection.execute("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY")
            require_partitions(connection, self._database, self._partitions)  # an owner before may have split it
            return examined(connection, self._partition, progress)

    def _take_followed(self, follower: Follower) -> Findings:
        """Own the partition, and follow what its last owner has left."""
        before = follower.epoch
        self._owner.take(self._leases)
        if self._owner.epoch != before + 1:
            raise StorageError(f"{self._place} is to be read anew: another server has owned it meanwhile")
        follower.go_on(self._owner.epoch)
        with as_storage_errors():
            follower.connection.execute("COMMIT")
            assert self._spare is not None  # `follow` has connected it
            name = writer_name(self._partition, self._owner.epoch)
            self._spare.execute("SELECT set_config('application_name', %s, false)", [name])
        self._writer, self._spare = self._spare, None
        return Findings(follower.ledger, repairs=follower.repairs)

    def _prepared(self) -> Connection:
        """A connection to the database, whose tables are there, and in the present format."""
        connection = self._database.connect("dynhull start")
        with closed_on_error(connection), as_storage_errors(), connection.transaction():
            hold(connection, self._database)
            prepare(connection, self._database, self._partitions)
            begin_anew_if_copied(connection, self._database, self._partitions)
        return connection

    def close(self) -> None:
        """Make all commits durable, and let another server own the partition."""
        try:
            self.sync()
        finally:
            self._open.close()

    # Committing

    def commit(self, changes: Sequence[Change | StorageStep], now: int = 0) -> CommitStamp:
        """Commit all of the changes or none."""
        group = self._group(changes, now)
        self._write(group)
        return group.commit

    def settle(self) -> CommitStamp:
        """Decide the outcome of the last commit, as described at the top of this file."""
        if not self._unsettled:
            return self._latest
        self._disconnect()
        connection = self._writer = self._connect_writer(writer_name(self._partition, self._owner.epoch))
        with as_storage_errors():
            self._owner.end_writers(connection, self._owner.epoch)
            connection.execute("BEGIN")
            self._require_ownership(connection.execute(REQUIRE, self._owner.own).rowcount)
            findings = examined(connection, self._partition, lambda *_: None, contents=False)
            connection.execute("COMMIT")
        if findings.fatal:
            raise DamagedError(f"{self._place}: {'; '.join(findings.fatal)}: restore a backup")
        self._renew(findings)
        return self._latest

    def _write(self, group: Group) -> None:
        try:
            writer = self._sent(group)
        except TakenOverError:
            self._disconnect()
            raise
        except BaseException as error:
            # It ends the transaction. After an error psycopg also takes statements for prepared that are not.
            self._disconnect()
            if isinstance(error, psycopg.Error | StorageError | OSError | MemoryError):
                raise _not_committed(error) from error
            raise
        with self._visible:
            self._unsettled = True
            with as_storage_errors():
                ended = writer.execute("COMMIT").statusmessage
            if ended != "COMMIT":
                raise StorageError(f"PostgreSQL: the commit ended with {ended}")
            group.adopt()
            self._unsettled = False
        self._not_durable = self._durability is not Durability.SYNC

    def _sent(self, group: Group) -> Connection:
        """Send all of a transaction but its COMMIT; on another connection if the present one is lost."""
        if self._writer is not None:
            try:
                self._send(self._writer, group)
                return self._writer
            except psycopg.Error:
                if not self._writer.broken:
                    raise
                self._disconnect()
        connection = self._writer = self._connect_writer(writer_name(self._partition, self._owner.epoch))
        self._send(connection, group, place_of(connection))
        return connection

    def _send(self, connection: Connection, group: Group, place: str | None = None) -> None:
        """Send all of a transaction but its COMMIT; on a new connection it notes the place that this leads to."""
        with connection.pipeline():
            connection.execute("BEGIN")
            owned = connection.execute(REQUIRE, self._owner.own)
            for sql, values in queries_of(self._partition, group.statements):
                connection.execute(sql, values)
            *_, last = group.before.row
            keys = self._partition, group.before.commits, last
            renewed = connection.execute(UPDATE_TOTALS, [*group.totals.row, *keys])
            if place is not None:
                connection.execute(NOTE, [[self._partition], place])
        self._require_ownership(owned.rowcount)
        if renewed.rowcount != COPIES:
            raise TakenOverError(
                f"{self._place} is not as this server has left it: it has lost commits, or was replaced"
            )

    def _require_ownership(self, rows: int) -> None:
        if rows != 1:
            raise taken_over(self._database, self._partition)

    def _restore_totals(self) -> None:
        """Renew both copies of the totals, one of which is damaged."""
        connection = self._writer = self._connect_writer(writer_name(self._partition, self._owner.epoch))
        with as_storage_errors(), connection.transaction():
            self._require_ownership(connection.execute(REQUIRE, self._owner.own).rowcount)
            put_totals(connection, self._partition, self._ledger.totals)

    def _connect_writer(self, name: str) -> Connection:
        connection = self._database.connect(name)
        with closed_on_error(connection), as_storage_errors():
            connection.execute(f"SET synchronous_commit = {SYNCHRONOUS[self._durability]}".encode())
            connection.execute(f"SET idle_in_transaction_session_timeout = '{IDLE_SECONDS}s'".encode())
        return connection

    def _disconnect(self) -> None:
        """Close the connection, which also ends its transaction."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    # Reading

    @property
    def _place(self) -> str:
        return str(self._database) + (f", partition {self._partition}" if self._partitions > 1 else "")

    @contextmanager
    def _lend(self) -> Iterator[PostgresReader]:
        if self._follower is not None:
            with as_storage_errors():
                yield BegunReader(self._follower.connection, self._partition)
            return
        with self._readers.lend() as reader:
            yield reader

    # Housekeeping

    def sync(self) -> None:
        """Make earlier commits durable: a later one that is makes them so, too."""
        if self._not_durable:
            self._not_durable = False
            try:
                self._owner.renew()
            except BaseException:
                self._not_durable = True
                raise

    def _confirm(self) -> None:
        self._owner.renew()

    def checkpoint(self) -> None:
        """Look at the size of the database now and then. Its housekeeping is PostgreSQL's own."""
        if time.monotonic() < self._size_due:
            return
        with self._readers.lend() as reader:
            self._size = reader.number(SIZE)
        self._size_due = time.monotonic() + SIZE_SECONDS  # only now: a call that does not look would count as a success

    def bytes_used(self) -> int:
        """The size of the tables of all partitions in bytes, as of the last look."""
        return self._size


def _not_committed(error: BaseException) -> NotCommittedError:
    if isinstance(error, DiskFull):
        return NotCommittedError(
            "the disk of PostgreSQL is full: free some space, and writes are accepted again",
            full=True,
            meaning=Meaning.PASSES,
        )
    if isinstance(error, psycopg.Error):
        error = storage_error(error)
    nothing = "nothing was written"
    return NotCommittedError(
        f"{nothing}: {words(error)}",
        for_callers=f"{nothing}: {words_for_callers(error)}",
        meaning=error.meaning if isinstance(error, StorageError) else Meaning.FINAL,
    )
