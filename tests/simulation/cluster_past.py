"""The past in a simulated cluster: each owner files what the journal drops into a store that all owners share.

What is real are the steps of `RowStorage`, its ledger, which each owner has for itself, and the archive of an object
store. The rows are in SQLite in memory, and are changed and read in one turn. An owner that was replaced, and does not
know yet, reads them, too, and calls the store.
"""

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from dynhull_server.state.contents.joining import in_one
from dynhull_server.state.errors import HullNotFoundError, NotStoredError
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.records import CommitStamp, Kept, Parts, Record
from dynhull_server.state.requests import ReadHull
from dynhull_server.storage.port import DamagedError, Progress, StorageError, StoredContents, TakenOverError
from dynhull_server.storage.rows.examine import Findings, examine
from dynhull_server.storage.rows.group import Group
from dynhull_server.storage.rows.storage import RowStorage
from dynhull_server.storage.rows.tables import FORMAT
from dynhull_server.storage.segments.archive import Archive, Written
from dynhull_server.storage.sqlite.readers import SQLiteReader
from dynhull_server.storage.sqlite.schema import SCHEMAS, UPDATE_TOTALS, carry_out, renew_totals

from .clients import content
from .core_life import Answer, Wait
from .globe import points
from .past_archive import At, FaultyStore, Store
from .past_model import plain
from .store import ERRORS, FaultyStorage

if TYPE_CHECKING:
    from dynhull_server.state.hull import Hull

    from .cluster_life import Process
    from .model import Model, Truth

# Seconds from one round of an owner's housekeeping to the next.
ROUND = 1.1


class SharedRows(RowStorage):
    """The rows of a database as one owner sees them.

    Args:
        rows: the database.
        archive: what the owners share.
        process: the owner.
    """

    def __init__(self, rows: sqlite3.Connection, archive: Archive, process: "Process") -> None:
        super().__init__(archive)
        self._rows = rows
        self._process = process
        self.epoch = process.ownership.epoch

    def open(self, progress: Progress) -> StoredContents:
        """Examine and load everything."""
        findings = self._examined(progress)
        self._ledger = findings.ledger
        if findings.repairs:
            self._write(Group(self._ledger, findings.repairs))
        return self._contents(findings.notes)

    def commit(self, changes: Sequence[Any], now: int = 0) -> CommitStamp:
        """Keep the changes."""
        group = self._group(changes, now)
        self._write(group)
        return group.commit

    def doubt(self) -> None:
        """The owner does not know what became of its last commit."""
        self._unsettled = True

    def settle(self) -> CommitStamp:
        """Look what became of it."""
        if self._unsettled:
            self._renew(self._examined(lambda *_: None, contents=False))
        return self._latest

    @property
    def _place(self) -> str:
        return "the simulated rows"

    def _examined(self, progress: Progress, *, contents: bool = True) -> Findings:
        findings = Findings()
        examine(SQLiteReader(self._rows), FORMAT, findings, progress, contents=contents)
        if findings.fatal:
            raise DamagedError("; ".join(findings.fatal))
        return findings

    def _write(self, group: Group) -> None:
        carry_out(self._rows, group.statements)
        self._rows.execute(UPDATE_TOTALS, group.totals.row)
        group.adopt()

    @contextmanager
    def _lend(self) -> Iterator["_Reader"]:
        self._process.require_light()
        yield _Reader(self._rows)

    def _confirm(self) -> None:
        self._process.ownership.renew()

    def entitled(self) -> bool:
        """True: who calls an owner looks at its lease."""
        return True

    def sync(self) -> None:
        """Commits are durable."""

    def checkpoint(self) -> None:
        """Nothing is to be done."""

    def bytes_used(self) -> int:
        """None: it is in memory."""
        return 0

    def close(self) -> None:
        """The rows stay."""


class _Reader(SQLiteReader):
    """Reads what there is: nothing is committed while it does."""

    def begin(self) -> None:
        """Do nothing."""


class ClaimedStore(FaultyStore):
    """The store of a database, which a copy of that may claim, too.

    Args:
        past: that of the database.
        store: what is in it.
        at, give_way: as of any such store.
        model: hears of what must not be.
    """

    def __init__(self, past: "SharedPast", store: Store, at: At, give_way: Callable[[], None], model: "Model") -> None:
        super().__init__(store, 0, at, give_way, past)
        self._past, self._model = past, model

    def write(self, file: str, content: bytes) -> Written:
        """Write an object, unless another one has the place by now."""
        called = self._kept.calls
        found = super().write(file, content)
        if self._kept.owner(called) not in (None, self._past):
            raise self._model.finds(f"{file} is written into the place of another database, which may remove it")
        return found

    def remove(self, file: str) -> None:
        """Remove the objects of a segment, unless another one has the place by now."""
        owner = self._kept.owner(self._kept.calls)
        needed = isinstance(owner, SharedPast) and owner is not self._past and owner.names(file)
        super().remove(file)
        if needed:
            raise self._model.finds(f"{file} is removed, which the database needs that has the place")
        self._past.removed(file)


class SharedPast:
    """The rows and the store of a site.

    Args:
        faults: how calls of the store fail, for each owner; or it stands still before one, until a fate, or the end,
            lets it go on.
        elapsed: the seconds that have passed.

    Attributes:
        faults: the same.
        calm: whether nothing fails any more.
        away: how each call of the store fails at present; None while it answers.
        others: those that have the same store.
        has_shared: whether there was another one.
        lost: the uids of the hulls of which another one has removed files.
    """

    def __init__(self, faults: Sequence[dict[str, Any]], elapsed: Callable[[], float]) -> None:
        self.faults, self.calm = faults, False
        self.away: str | None = None
        self.others: list[SharedPast] = []
        self.has_shared = False
        self.lost: set[str] = set()
        self._elapsed = elapsed
        self._home = TemporaryDirectory()
        self._store = Store(Path(self._home.name) / "store", elapsed)
        self._rows = sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)
        for sql in filter(None, SCHEMAS[FORMAT].values()):
            self._rows.execute(sql)
        renew_totals(self._rows, Findings().ledger.totals)

    def of_owner(self, process: "Process", model: "Model") -> FaultyStorage:
        """What one owner opens."""
        faulty: FaultyStorage

        def at(place: str) -> str | None:
            process.give_way()
            kind = None if self.calm else faulty._fault(place) or self.away
            if kind == "still":
                process.stopped = True
                process.give_way()
                return None
            if kind in ERRORS:
                raise ERRORS[kind](f"the store fails at {place}, as planned")
            return kind

        archive = ClaimedStore(self, self._store, at, process.give_way, model)
        archive.owner = process.claimant()
        faulty = FaultyStorage(SharedRows(self._rows, archive, process), model, self.faults, immediate=False)
        return faulty

    def claimed_by(self, process: "Process") -> Archive:
        """What a server claims when it begins: whatever fails later does not fail then, but the store may be away."""

        def at(_: str) -> None:
            process.give_way()
            if self.away is not None and not self.calm:
                raise OSError("the store is away, as planned")

        return ClaimedStore(self, self._store, at, process.give_way, process.site.model)

    def copied(self, *, shares: bool) -> "SharedPast":
        """The same as of the last commits, in a database of its own, and unless it `shares` that, in such a store."""
        other = SharedPast(self.faults, self._elapsed)
        self._rows.backup(other._rows)
        if shares:
            other._store = self._store
            self.others, other.others = [other], [self]
            self.has_shared = other.has_shared = True
        else:
            other._store = self._store.apart(Path(other._home.name) / "copied")
        return other

    def move(self) -> None:
        """Have a store of its own, with the objects of the one that has been shared so far.

        What was late there never comes: the claim of who has gone would stand against the one who has stayed.
        """
        self._store.late.clear()
        self._store = self._store.apart(Path(self._home.name) / "copied")
        for other in self.others:
            other.others = []
        self.others = []

    @property
    def has_place(self) -> bool:
        """Whether nobody else has claimed the store since."""
        return not self.others or self._store.owner(self._store.calls) is self

    def names(self, file: str) -> bool:
        """Whether a file is one of a segment."""
        sql = "SELECT 1 FROM segments JOIN hulls ON hulls.id = segments.hull WHERE file = ?"
        return self._rows.execute(sql, [file]).fetchone() is not None

    def removed(self, file: str) -> None:
        """A file is gone: others that shared the store, and no longer had it, may have needed it."""
        for other in self.others:
            if other.names(file):
                other.lost.add(file.partition("/")[0])

    def needs_all(self, rows: SharedRows) -> bool:
        """Whether each object of a hull is one of a segment, and nothing is to be filed or removed.

        What a server sends that was replaced before the hull was deleted, nobody knows of.
        """
        hulls = rows._ledger.hulls.values()
        if any(hull.row.settings.history and hull.due != hull.filed for hull in hulls) or rows._ledger.dead["segments"]:
            return False
        archive, uids = rows._archive, {hull.row.uid for hull in hulls}
        assert isinstance(archive, FaultyStore)
        files = {each.file for hull in hulls for each in hull.segments}
        there = {name for name in archive.names() if name.partition("/")[0] in uids}
        if self.has_shared:  # what another one has written is its own, and it may have removed what was here
            foreign = {name.partition(".")[0] for name, by in self._store.writers.items() if by is not self}
            there = {name for name in there if name in files or name.partition("/")[2] not in foreign}
            there |= {file for file in files if file.partition("/")[0] in self.lost}
        return there == files

    def remove(self) -> None:
        """Nothing of it is needed any more."""
        self._rows.close()
        self._home.cleanup()


class Filer:
    """The housekeeping of an owner: snapshots and segments.

    Args:
        process: the owner, whose core is there.
        storage: what it has opened.
    """

    def __init__(self, process: "Process", storage: Any) -> None:
        self._process, self._storage = process, storage
        self._kept: dict[int, int] = {}

    def run(self) -> None:
        """Go on until the process ends."""
        while True:
            self._process.wait(lambda: False, ROUND)
            try:
                self._round()
            except TakenOverError:
                raise
            except DamagedError as error:
                if self._process.ownership.holds():
                    raise self._process.site.model.finds(f"an owner finds damage: {error}") from error
            except (StorageError, NotStoredError, OSError):  # the database or the store is away
                continue
            except (HullNotFoundError, KeyError):  # it was deleted meanwhile
                continue

    def _round(self) -> None:
        core = self._process.core
        assert core is not None
        for hull in list(core.core.hulls.values()):
            if self._kept.get(hull.row.number, 0) < hull.counts.revision:
                kept = self._read(hull)
                self._carry_out(self._storage.snapshot(hull.row.number, kept))
                self._kept[hull.row.number] = kept.revision
        self._carry_out(self._storage.file_history(core.commit_time()))

    def _read(self, hull: "Hull") -> Kept:
        core = self._process.core
        assert core is not None
        work = core._ask(ReadHull(Answer(), hull, HullState.kept))
        while True:
            try:
                condition = work.send(None)
            except StopIteration as end:
                kept: Kept = end.value[1]
                return kept
            self._process.waits(condition)

    def _carry_out(self, steps: Any) -> None:
        """Commit steps one after the other, as the engine does."""
        core = self._process.core
        assert core is not None
        heard: list[Exception | None] = []

        def hear(error: Exception | None, _: bool) -> None:
            heard.append(error)

        def wait(made: int) -> None:
            self._process.waits(lambda: len(heard) > made)
            if (error := heard[-1]) is not None:
                raise error

        if core._commits.undecided:
            core._commits.settle(hear)
            wait(0)
        with closing(steps):
            for step in steps:
                made = len(heard)
                core._commits.submit([step], hear)
                wait(made)


async def read_past(process: "Process", model: "Model", name: str) -> None:
    """Read the whole past of a hull from an owner, and compare it with what was committed."""
    core = process.core
    assert core is not None
    if name not in core.core.hulls:
        return
    hull = core.core.hulls[name]
    truth, last = model.truth_of(hull.row.number), hull.counts.revision
    reading = process.reads.submit(partial(_read, process.storage, hull.row.number, last))
    await Wait(lambda: reading.done() or not process.alive)
    if not reading.done():
        return
    error = reading.exception()
    past = process.site.past
    if isinstance(error, DamagedError) and past is not None and truth.row.uid in past.lost:
        if not any(hole.number == truth.row.number for hole in process.storage.holes()):
            raise model.finds(f"the past of {name} cannot be read, and no hole is named: {error}") from error
        return
    if isinstance(error, DamagedError) and process.ownership.holds() and not truth.deleted:
        raise model.finds(f"the past of {name} cannot be read: {error}") from error
    if isinstance(error, StorageError | OSError | KeyError):  # it is away, replaced, or the hull deleted
        return
    first, records, kept = reading.result()
    if truth.past.whole and first:
        raise model.finds(f"the past of {name} was to be kept for ever, and begins with {first}")
    _compare(model, truth, first, records)
    for state, parts in kept:
        found = content(points(name, in_one(parts.parts).points))
        if found != truth.contents[state.revision]:
            raise model.finds(f"{name} was {found} at {state.revision} in the past: {truth.contents[state.revision]}")


def _read(storage: Any, number: int, last: int) -> tuple[int, list[Record], list[tuple[Kept, Parts]]]:
    """The first revision, all batches after it, and the states on the way."""
    first = after = storage.oldest_moment(number).revision
    records: list[Record] = []
    while after < last:
        records += storage.batches(number, after, last)
        after = records[-1].revision
    return first, records, [storage.state(number, until) for until in {first, (first + last) // 2, last}]


def _compare(model: "Model", truth: "Truth", first: int, records: list[Record]) -> None:
    for revision, record in enumerate(records, first + 1):
        times = record.revision, None if record.committed is None else record.committed.time
        if times != (revision, truth.past.times[revision]):
            raise model.finds(f"{truth.row.name} has {times} in the past for {revision}: {truth.past.times}")
        if plain(record) != truth.past.batch(revision):
            raise model.finds(f"revision {revision} of {truth.row.name} is {plain(record)} in the past")
