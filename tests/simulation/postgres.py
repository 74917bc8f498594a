"""A simulated PostgreSQL: the table of owners, sessions, their locks and transactions, and copies made while it serves.

It understands the statements of `dynhull_cluster.postgres.ownership` and `marks`, and says what the board of a cluster
reads.
Sessions give way before and after each statement, and wait for rows that others have locked.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field, fields
from operator import eq, ge
from typing import Any

from psycopg.errors import LockNotAvailable

from dynhull_cluster.postgres.ownership import EPOCHS, HELD, HOLD, LOCK_SECONDS
from dynhull_server.storage.port import StorageError

FREE = "-infinity"
COMPARED = {"=": eq, ">=": ge}
# How a statement locks rows, and which of these locks exclude each other.
KEY_SHARE, UPDATE, NO_KEY_UPDATE = "FOR KEY SHARE", "FOR UPDATE", "UPDATE"
CONFLICTS = {KEY_SHARE: {UPDATE}, UPDATE: {KEY_SHARE, UPDATE, NO_KEY_UPDATE}, NO_KEY_UPDATE: {UPDATE, NO_KEY_UPDATE}}


@dataclass
class Row:
    """The row of an owner. `until` says which renewal it was: no clock of anybody is compared with it."""

    partition: int
    epoch: int
    worker: str
    process: str
    address: str
    until: str


@dataclass
class Result:
    """What a statement has found or changed."""

    rows: Sequence[tuple[Any, ...]] = ()
    rowcount: int = 0

    def fetchone(self) -> tuple[Any, ...] | None:
        return self.rows[0] if self.rows else None

    def fetchall(self) -> Sequence[tuple[Any, ...]]:
        return self.rows


@dataclass(eq=False)
class Session:
    """One connection; `locked` are the partitions whose rows its transaction has locked, and how."""

    database: "Postgres"
    wait: Callable[[Callable[[], object], float | None], bool]
    name: str
    owner: object
    open: bool = True
    begun: bool = False
    before: dict[int, Row] = field(default_factory=dict)
    locked: dict[int, str] = field(default_factory=dict)
    held: set[tuple[int, int]] = field(default_factory=set)

    def execute(self, sql: str | bytes, values: Sequence[Any] = ()) -> Result:
        """Carry out a statement, at some time between now and the answer."""
        self.wait(lambda: True, None)
        self._require_open()
        found = self.database.carry_out(self, sql if isinstance(sql, str) else sql.decode(), list(values))
        self.wait(lambda: True, None)
        self._require_open()
        return found

    def _require_open(self) -> None:
        if not self.open:
            raise StorageError("the connection to the database is lost, as planned")

    def close(self) -> None:
        """End it, and its transaction."""
        self.database.end(self)

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """A transaction that is committed at the end of the block."""
        self.execute("BEGIN")
        try:
            yield
        except BaseException:
            self.execute("ROLLBACK")
            raise
        self.execute("COMMIT")


class Postgres:
    """A database, as sessions see it.

    Attributes:
        owners: the rows, by partition.
        marks: what the database has put into its claim on the place of its past.
        sessions: the sessions that are open.
        reachable: whether anybody can connect.
    """

    def __init__(self) -> None:
        self.owners: dict[int, Row] = {}
        self.marks: set[str] = set()
        self.sessions: list[Session] = []
        self.reachable = True
        self._renewals = 0

    def __str__(self) -> str:
        return "the simulated database"

    def copied(self) -> "Postgres":
        """A physical copy as of the last commits: it has all rows, and no sessions."""
        other = Postgres()
        begun = {partition: row for each in self.sessions for partition, row in each.before.items()}
        other.owners = {partition: copy(begun.get(partition, row)) for partition, row in self.owners.items()}
        other.marks = self.marks.copy()
        other._renewals = self._renewals
        return other

    def connect(self, wait: Any, name: str, owner: object) -> Session:
        """A session of a process."""
        if not self.reachable:
            raise StorageError("the database cannot be reached, as planned")
        session = Session(self, wait, name, owner)
        self.sessions.append(session)
        return session

    def end(self, session: Session) -> None:
        """A session ends: its transaction is rolled back, its locks are free."""
        session.open = False
        self._rollback(session)
        if session in self.sessions:
            self.sessions.remove(session)

    def end_all_of(self, owner: object) -> None:
        """The sessions of a process end."""
        for each in [each for each in self.sessions if each.owner is owner]:
            self.end(each)

    def told(self) -> list[tuple[Any, ...]]:
        """What the board reads of owners: none of those of whom this is a copy is connected."""
        held = {lock for each in self.sessions for lock in each.held}
        return [
            (*row, row[-1] == FREE, (HELD + row[0], row[1] % EPOCHS) in held)
            for row in (tuple(getattr(each, one.name) for one in fields(Row)) for each in self.owners.values())
        ]

    # Statements

    def carry_out(self, session: Session, sql: str, values: list[Any]) -> Result:
        if sql.startswith(("NOTIFY", "SET LOCAL", "CREATE TABLE")):
            return Result()
        if sql.startswith("SELECT mark "):
            return Result([(mark,) for mark in sorted(self.marks)])
        if sql.startswith("INSERT INTO marks"):  # nothing comes between it and its COMMIT but the end of the session
            self.marks.add(values[0])
            return Result()
        match sql.split()[0]:
            case "BEGIN":
                session.begun = True
                return Result()
            case "COMMIT":
                session.before, session.begun = {}, False
                self._unlock(session)
                return Result()
            case "ROLLBACK":
                self._rollback(session)
                return Result()
            case "INSERT":
                return self._insert(values)
            case "UPDATE":
                return self._update(session, sql, values)
        if sql == HOLD.decode():
            session.held.add((values[0], values[1]))
            return Result()
        if "pg_terminate_backend" in sql:
            return self._end_writers(session, *values[1:])
        return self._select(session, sql, values)

    def _end_writers(self, own: Session, prefix: str, until: int) -> Result:
        for each in list(self.sessions):
            if each is not own and each.name.startswith(prefix) and int(each.name.split("/")[1]) <= until:
                self.end(each)
        return Result()

    def _insert(self, values: list[Any]) -> Result:
        partition, worker, process, _ = values
        if partition in self.owners:
            return Result()
        self.owners[partition] = Row(partition, 1, worker, process, "", self._renewed())
        return Result(rowcount=1)

    def _select(self, session: Session, sql: str, values: list[Any]) -> Result:
        lock = next((each for each in (KEY_SHARE, UPDATE) if sql.endswith(each)), "")
        row = self._found(sql, values)
        if row is not None and lock:
            self._lock(session, row.partition, lock)
            row = self._found(sql, values)
        if row is None:
            return Result()
        return Result([(row.epoch, row.worker, row.process, row.until, row.until == FREE)], 1)

    def _update(self, session: Session, sql: str, values: list[Any]) -> Result:
        conditions = sql.partition(" WHERE ")[2].count("%s")
        new, keys = values[:-conditions], values[-conditions:]
        row = self._found(sql, keys)
        if row is not None:
            self._lock(session, row.partition, NO_KEY_UPDATE)
            row = self._found(sql, keys)
        if row is None:
            self._unlock(session)
            return Result()
        if session.begun:
            session.before.setdefault(row.partition, copy(row))
        if "epoch + 1" in sql:
            row.epoch += 1
            row.worker, row.process, row.address = *new[:2], ""
            row.until = self._renewed()
        elif "clock_timestamp()" in sql:
            row.until = self._renewed()
        elif FREE in sql:
            row.until, row.process = FREE, ""
        else:
            row.address = new[0]
        self._unlock(session)
        return Result(rowcount=1)

    def _found(self, sql: str, values: list[Any]) -> Row | None:
        """The row that the conditions of a statement name."""
        conditions = re.findall(r"(\w+) (=|>=) %s", sql.partition(" WHERE ")[2])
        wanted = [(name, COMPARED[sign], value) for (name, sign), value in zip(conditions, values, strict=True)]
        row = self.owners.get(values[0])
        if row is None or not all(compare(getattr(row, name), value) for name, compare, value in wanted):
            return None
        return row

    def _renewed(self) -> str:
        self._renewals += 1
        return str(self._renewals)

    # Locks of rows

    def _lock(self, session: Session, partition: int, lock: str) -> None:
        """Wait until nobody else has a lock on a row that excludes this one, but not for long."""

        def is_free() -> bool:
            others = (each.locked.get(partition, "") for each in self.sessions if each is not session)
            return not session.open or not CONFLICTS[lock].intersection(others)

        if not session.wait(is_free, LOCK_SECONDS if lock == UPDATE else None):
            raise LockNotAvailable("the row is locked, as planned")
        session._require_open()
        if session.begun:
            session.locked[partition] = lock

    def _unlock(self, session: Session) -> None:
        """Nothing is locked beyond a transaction, or, without one, beyond a statement."""
        if not session.begun:
            session.locked = {}

    def _rollback(self, session: Session) -> None:
        self.owners |= session.before
        session.before, session.begun = {}, False
        self._unlock(session)
