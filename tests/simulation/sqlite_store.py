"""The real storage on SQLite, on a disk that fails when the plan says so.

A kill takes a copy of the database and its log, as they are between two calls, and leaves the rest behind. Torn pages
and checkpoints in the middle of a commit are not simulated: SQLite does its work within one turn.
"""

import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, NoReturn
from unittest.mock import patch

from dynhull_server.state.feed_consumers import DropFeedConsumer, PutFeedConsumer
from dynhull_server.state.fences.model.records import KeptFence
from dynhull_server.state.records import CommitStamp
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.memory import MemoryStorage
from dynhull_server.storage.port import Progress, StoredContents
from dynhull_server.storage.rows.group import (
    CloseSegment,
    DropDeadSegment,
    EraseKeys,
    NameFile,
    RetireSegment,
    SetHistory,
)
from dynhull_server.storage.rows.ledger import HullRows
from dynhull_server.storage.segments.archive import HISTORY
from dynhull_server.storage.sqlite import copies, readers
from dynhull_server.storage.sqlite.disk import Disk, OpenMode
from dynhull_server.storage.sqlite.storage import SQLiteStorage

from .incarnation import Backup
from .machine import SimulatedThreads
from .model import Model
from .past_archive import FaultyArchive, FaultyStore, Store, simulated_reading
from .past_retention import all_may_stay, may_go
from .store import ERRORS, FaultyStorage

FAILED = {"full": sqlite3.SQLITE_FULL, "lost": sqlite3.SQLITE_IOERR, "ghost": sqlite3.SQLITE_IOERR_FSYNC}
# Commits that fail on their own: those in which segments become part of the past, or leave it, those of what is to be
# kept, and those of consumers.
OF_STEPS = {
    "step": (NameFile, CloseSegment, EraseKeys, RetireSegment, DropDeadSegment),
    "settings": (SetHistory,),
    "consumer": (PutFeedConsumer, DropFeedConsumer),
}
# Where the folders of the lives are: in memory, where there is such a place.
SHARED_MEMORY = Path("/dev/shm")
# More events than a fence has.
MANY = 10**6


class SQLiteLives(FaultyStorage):
    """A folder with a database; each life has a storage of its own on it.

    `most_bytes` of the past of all hulls are kept at most, 0 for any number; `in_store`, not in the folder. With
    `one_reader` one connection for reading is always open, and others when they are needed.
    """

    def __init__(
        self,
        model: Model,
        faults: Sequence[dict[str, Any]],
        most_bytes: int = 0,
        *,
        in_store: bool = False,
        one_reader: bool = False,
    ) -> None:
        super().__init__(MemoryStorage(), model, faults, immediate=False)
        self._home = tempfile.TemporaryDirectory(dir=SHARED_MEMORY if SHARED_MEMORY.is_dir() else None)
        self._enter(1)
        self._disk = _FaultyDisk(self._fault_of_disk, self._landed, self.kill)
        self._store = Store(Path(self._home.name) / "store", lambda: model.elapsed) if in_store else None
        self._patches = ExitStack()
        self._patches.enter_context(simulated_reading(self._threads_of_life, lambda: model.elapsed))
        if one_reader:
            self._patches.enter_context(patch.object(readers, "KEPT_OPEN", 1))
        self._pending: tuple[Sequence[Any], int] = (), 0
        self._most_bytes = most_bytes
        self._backup: tuple[Path, Backup] | None = None
        self._restores = False

    def _enter(self, number: int) -> None:
        """The next life has a folder of its own."""
        self._folders, self._folder = number, Path(self._home.name) / str(number)

    def _fault_of_disk(self, place: str) -> str | None:
        """What fails at this call of a method of the disk."""
        kind = self._fault(place)
        if place == "commit":
            for step, changes in OF_STEPS.items():
                if any(isinstance(each, changes) for each in self._pending[0]):
                    kind = self._fault(step) or kind
        return kind

    def _threads_of_life(self) -> SimulatedThreads:
        assert self.threads is not None
        return self.threads

    def open(self, progress: Progress) -> StoredContents:
        """Take up what the life before has left."""
        if self.dead:
            left = self._folder
            self._enter(self._folders + 1)
            self._folder.mkdir()
            self._follow(left)
            self._disk.drop()
            shutil.rmtree(left)
        self._archive = self._new_archive()
        self._inner = SQLiteStorage(self._folder, Durability.SYNC, self._disk, archive=self._archive)
        contents = super().open(progress)
        self._inner.epoch = self._folders  # as where each life is another owner
        if self._restores and self._backup is not None:
            self._backup[1].restore(self._model, contents, self._fences(contents))
        self._restores = False
        return contents

    def _follow(self, left: Path) -> None:
        """Have the next folder begin as the last one was left, or as the last backup."""
        if self._restores and self._backup is not None:
            list(copies.copy_all([(self._backup[0], self._folder)], lambda *_: None, restores=True))
            return
        for file in left.iterdir():
            if file.is_dir():
                file.rename(self._folder / file.name)
            elif not file.name.endswith("-shm"):
                shutil.copyfile(file, self._folder / file.name)

    def _new_archive(self) -> FaultyArchive | FaultyStore:
        if self._store is None:
            return FaultyArchive(self._folder / HISTORY, self._most_bytes, self._at_file)
        return FaultyStore(self._store, self._most_bytes, self._at_file, lambda: self.give_way())

    def _at_file(self, place: str) -> str | None:
        self.give_way()
        kind = self._fault(place)
        if kind in ERRORS:
            raise ERRORS[kind](f"a file of the past fails at {place}, as planned")
        return kind

    def files_are_needed(self, now: int) -> bool:
        """Whether each file of the past is one of a segment, and nothing is to be filed or removed."""
        hulls = self._hulls().values()
        if any(hull.due != hull.filed for hull in hulls) or not all_may_stay(hulls, now, self._most_bytes):
            return False
        return self._archive.names() == {each.file for hull in hulls for each in hull.segments}

    def _fences(self, contents: StoredContents) -> list[KeptFence]:
        """The fences in the folder, each with all of its events."""
        numbers = [row.number for row in contents.fences]
        kept = [each for each in self._inner.read_fences(numbers) if each is not None]
        return [replace(each, events=self._inner.read_events(each.row.number, 0, MANY)) for each in kept]

    def back_up(self) -> None:
        """Copy the folder while a server uses it. Its server may hold it, so the copy is made as of its last commit."""
        backup = Path(self._home.name) / f"backup-{self._folders}-{self._model.commits}"
        if not backup.exists():
            copies.copy(self._folder, backup, lambda *_: None)
        self._backup = backup, Backup(self._model)

    def restore(self) -> None:
        """Have the next life find the last backup, if there is one."""
        self._restores = True

    def commit(self, changes: Sequence[Any], now: int = 0) -> CommitStamp:
        """Keep the changes."""
        self.give_way()
        self._pending = changes, now
        try:
            commit = self._inner.commit(changes, now)
        finally:
            self._pending = (), 0
        self.give_way()
        return commit

    def _landed(self) -> None:
        changes, now = self._pending
        self._model.landed(changes, now)
        steps = [each for each in changes if isinstance(each, SetHistory | RetireSegment)]
        hulls = {number: hull.copy() for number, hull in self._hulls().items()} if steps else {}
        for step in steps:
            hull = hulls.get(step.number)
            if hull is None:
                continue
            if isinstance(step, SetHistory):
                kept = replace(hull.row.settings, history=step.max_age, history_bytes=step.max_bytes)
                hull.change(replace(hull.row, settings=kept), 0)
            elif self._has_gone(step) and not may_go(hulls.values(), hull, step.segment, now, self._most_bytes):
                raise self._model.finds(f"a segment of {hull.row.name} goes, and should stay: {step.segment}")

    def _has_gone(self, step: RetireSegment) -> bool:
        """Whether a segment was there before the last commit, and is not any more."""
        if step.segment not in self._hulls()[step.number].segments:
            return False
        rows = self._disk.written("SELECT 1 FROM segments WHERE id = ? AND hull = ?", step.segment.id, step.number)
        return not rows

    def _hulls(self) -> dict[int, HullRows]:
        assert isinstance(self._inner, SQLiteStorage)
        return self._inner._ledger.hulls

    def close(self) -> None:
        """The server ends."""
        self._inner.close()
        self._disk.drop()

    def remove(self) -> None:
        """Nothing of it is needed any more."""
        self._disk.drop()
        self._patches.close()
        self._home.cleanup()


class _Connection(sqlite3.Connection):
    """A connection that may fail at BEGIN and COMMIT."""

    disk: "_FaultyDisk"

    def execute(self, sql: str, *values: Any) -> sqlite3.Cursor:
        if sql == "BEGIN IMMEDIATE":
            _fail(self.disk.fault("begin"), sqlite3.OperationalError)
            self.disk.writing = self
        elif sql == "COMMIT" and self.disk.writing is self:
            return self._commit(self.disk.fault("commit"))
        return super().execute(sql, *values)

    def _commit(self, kind: str | None) -> sqlite3.Cursor:
        if kind is None or kind.startswith("ghost"):
            cursor = super().execute("COMMIT")
            self.disk.landed()
            if kind is None:
                return cursor
        if kind == "ghost kill":
            self.disk.kill()
        if kind in ("memory", "ghost memory"):
            raise MemoryError("no memory for a commit, as planned")
        assert kind is not None
        error = sqlite3.OperationalError("a commit fails, as planned")
        error.sqlite_errorcode = FAILED[kind]
        raise error


class _FaultyDisk(Disk):
    def __init__(
        self, fault: Callable[[str], str | None], landed: Callable[[], None], kill: Callable[[], NoReturn]
    ) -> None:
        self.fault = fault
        self.landed = landed
        self.kill = kill
        self.writing: sqlite3.Connection | None = None
        self._opened: list[Any] = []

    def written(self, sql: str, *values: Any) -> list[tuple[Any, ...]]:
        """What who writes sees."""
        assert self.writing is not None
        return self.writing.execute(sql, values).fetchall()

    def lock(self, file: Path) -> IO[str] | None:
        lock = super().lock(file)
        self._opened.append(lock)
        return lock

    def size(self, file: Path) -> int | None:
        _fail(self.fault("stat"), OSError)
        return super().size(file)

    def birth(self, _: Path) -> None:
        """Not known: a folder is the same in all lives, though its files are copied from one to the next."""

    def open(self, file: Path) -> IO[bytes]:
        _fail(self.fault("open"), OSError)
        opened = super().open(file)
        self._opened.append(opened)
        return opened

    def sync(self, _: IO[bytes]) -> None:
        _fail(self.fault("fsync"), OSError)

    def connect(self, database: Path, access: OpenMode) -> sqlite3.Connection:
        _fail(self.fault("connect"), sqlite3.OperationalError)
        address = f"{database.absolute().as_uri()}?{access.value}"
        connection = sqlite3.connect(
            address, uri=True, isolation_level=None, check_same_thread=False, timeout=0, factory=_Connection
        )
        assert isinstance(connection, _Connection)
        connection.disk = self
        self._opened.append(connection)
        return connection

    def drop(self) -> None:
        """Close everything that a life has opened, the last first: while the first one reads, no log is copied."""
        for each in reversed(self._opened):
            if each is not None:
                each.close()
        self._opened = []


def _fail(kind: str | None, error: type[Exception]) -> None:
    if kind is not None:
        raise (MemoryError if kind == "memory" else error)("the disk fails, as planned")
