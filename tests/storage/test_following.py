"""A partition that is read ahead, while its owner goes on, is the same as one that is read at once."""

import asyncio
import random
from pathlib import Path
from typing import Any

import pytest
from cases import slow
from folders import append, appended, committed_at, events, fence_row, no_progress, record, same
from live_engine import LIMITS
from postgresql import query

from dynhull_cluster.postgres.database import Database
from dynhull_cluster.postgres.storage import PostgresStorage
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.state.fences.model.records import AddFence, DropFence, Inside
from dynhull_server.state.records import FOREVER, Append, Contents, Create, Delete, HullRow, HullSettings, Kept
from dynhull_server.storage.port import DamagedError, StorageError
from dynhull_server.storage.segments.archive import Archive


@pytest.fixture
def url(postgres):
    return postgres.new_database()


def on(url: str, history: Path | None = None) -> PostgresStorage:
    return PostgresStorage(Database(url), pytest.fail, archive=None if history is None else Archive(history))


class Owner:
    """A storage that somebody uses, in all the ways that change which rows there are."""

    def __init__(self, url: str, seed: int, history: Path) -> None:
        self.storage = on(url, history)
        self.storage.open(no_progress)
        self._random = random.Random(seed)
        self._revisions: dict[int, int] = {}
        self._decided: dict[int, int] = {}  # of each shard, the revision before which nothing is undone
        self._numbers = iter(range(1, 10_000))
        self._fences: dict[int, int] = {}
        self._work = []

    def step(self) -> None:
        """A random change."""
        ways = {
            self._create: 1,
            self._append: 8,
            self._delete: 0.3,
            self._undo: 2 if self._decided else 0,
            self._snapshot: 1,
            self._sweep: 0.5,
            self._file: 1,
            self._keep: 0.3,
            self._go_on: 4,
            self._fence: 0.3,
            self._events: 1 if self._fences else 0,
            self._drop_fence: 0.2,
        }
        self._random.choices(list(ways), list(ways.values()))[0]()

    def _create(self) -> None:
        number = next(self._numbers)
        later = next(self._numbers)
        for each in (later, number) if self._random.random() < 0.5 else (number,):  # in any order
            name = f"hull-{each}" if self._revisions else "fleet"
            shard = self._random.choice((None, 0)) if self._revisions else None
            kept = self._random.choice((0, FOREVER, FOREVER))
            settings = HullSettings(shards=1, shard=0) if shard == 0 else HullSettings(history=kept)
            self.storage.commit([Create(HullRow(each, name, f"uid-{each}", 1.5, settings))])
            self._revisions[each] = 0
            if shard == 0:
                self._decided[each] = 0

    def _append(self) -> None:
        for number in self._random.sample(sorted(self._revisions), min(2, len(self._revisions))):
            last = self._revisions[number] + self._random.randint(1, 4)
            append(self.storage, self._revisions[number] + 1, last, number)
            self._revisions[number] = last

    def _delete(self) -> None:
        number = self._random.choice(sorted(self._revisions))
        if number != next(iter(self._revisions)):  # fences need that one
            self.storage.commit([Delete(number)])
            del self._revisions[number]
            self._decided.pop(number, None)

    def _undo(self) -> None:
        """Drop the newest batches of a shard, and perhaps add others in the same commit."""
        number = self._random.choice(sorted(self._decided))
        last = self._random.randint(self._decided[number], self._revisions[number])
        step = self.storage.cut(number, last)
        if step is not None:
            others = self._random.randint(0, 2)
            added = [Append(number, [record(last + 1 + each, n=7)]) for each in range(others)]
            self.storage.commit([step, *added])
            self._revisions[number] = last + others

    def _snapshot(self) -> None:
        number = self._random.choice(sorted(self._revisions))
        if number in self._decided:
            self._decided[number] = self._revisions[number]
        kept = Kept(self._revisions[number], Contents(record(1, n=self._random.choice((3, 50_000))).rows.inserts))
        self._work.append(self.storage.snapshot(number, kept))

    def _sweep(self) -> None:
        if not any(each.__name__ == "sweep" for each in self._work):
            self._work.append(self.storage.sweep())

    def _file(self) -> None:
        if not any(each.__name__ == "file_history" for each in self._work):
            self._work.append(self.storage.file_history(0))

    def _keep(self) -> None:
        """Keep the past of a hull from now on, or remove it."""
        kept = sorted(self.hulls())
        number, age = self._random.choice(kept), self._random.choice((0, FOREVER))
        self.storage.commit([self.storage.set_history(number, age, 0)])

    def _go_on(self) -> None:
        """The next steps of something that takes many."""
        if self._work:
            work = self._random.choice(self._work)
            for _ in range(self._random.randint(1, 4)):
                step = next(work, None)
                if step is None:
                    self._work.remove(work)
                    return
                self.storage.commit([step])

    def _fence(self) -> None:
        number = next(self._numbers)
        self.storage.commit([AddFence(fence_row(number, f"fence-{number}"), Inside())])
        self._fences[number] = 0

    def _events(self) -> None:
        number = self._random.choice(sorted(self._fences))
        last = self._fences[number] + self._random.randint(1, 3)
        self.storage.commit([appended(number, events(self._fences[number] + 1, last))])
        self._fences[number] = last

    def _drop_fence(self) -> None:
        if self._fences:
            number = self._random.choice(sorted(self._fences))
            self.storage.commit([DropFence(number)])
            del self._fences[number]

    def hulls(self) -> dict[int, int]:
        return {number: last for number, last in self._revisions.items() if number not in self._decided}

    def shards(self) -> dict[int, int]:
        return {number: self._revisions[number] for number in self._decided}


class Reader:
    """What a worker that reads ahead has in memory."""

    def __init__(self, storage: PostgresStorage) -> None:
        self.storage = storage
        self.hulls: dict[int, Kept] = {}

    def adopt(self, numbers: list[int]) -> None:
        """Read the hulls that are new, and what has come since to the others."""
        self.hulls = {number: kept for number, kept in self.hulls.items() if number in numbers}
        after = {number: kept.last_revision for number, kept in self.hulls.items()}
        for number, records in self.storage.read_since(after):
            assert records
            self.hulls[number].records += records
        new = [number for number in numbers if number not in self.hulls]
        self.hulls.update(zip(new, self.storage.read_each(new), strict=True))


def loaded(contents: Any) -> list[int]:
    """The hulls that an engine loads ahead: of shards it reads nothing but which rows there are."""
    return [row.number for row in contents.hulls if row.settings.shard is None]


@slow
@pytest.mark.every(3)
@pytest.mark.parametrize("seed", range(4))
def test_what_is_read_ahead_is_what_is_there(url, seed, tmp_path):
    fenced = seed % 2 == 1
    owner = Owner(url, seed, tmp_path)
    if not fenced:
        owner._fence = owner._append
    owner._create()
    reader = Reader(on(url, tmp_path))
    dice = random.Random(seed)
    for _ in range(150):
        owner.step()
        if dice.random() < 0.2:
            reader.adopt(loaded(reader.storage.follow(no_progress)))
    reader.adopt(loaded(reader.storage.follow(no_progress)))
    for _ in range(dice.randint(0, 5)):
        owner.step()
    expected, shards = owner.hulls(), owner.shards()
    owner.storage.close()
    contents = reader.storage.open(no_progress)
    assert {row.number for row in contents.hulls} == expected.keys() | shards.keys()
    reader.adopt(sorted(expected))
    assert {number: kept.last_revision for number, kept in reader.hulls.items()} == expected
    expected |= shards
    assert {number: reader.storage.read(number).last_revision for number in expected} == expected
    # It goes on as an owner: commits, snapshots, and sweeps of what is left behind.
    for number, last in expected.items():
        append(reader.storage, last + 1, last + 2, number)
        kept = Kept(last + 2, Contents(record(1).rows.inserts))
        for steps in (reader.storage.snapshot(number, kept), reader.storage.sweep(), reader.storage.file_history(0)):
            for step in steps:
                reader.storage.commit([step])
    filed = {number: reader.storage.history(number) for number in expected}
    reader.storage.close()
    again = on(url, tmp_path)
    found = again.open(no_progress)
    assert found.notes == []
    assert {number: again.history(number) for number in expected} == filed
    assert found.hulls == contents.hulls
    assert found.fences == contents.fences
    assert found.next_number == contents.next_number
    for number, last in expected.items():
        assert again.read(number).last_revision == last + 2
        stored = again.read(number, last + 1)
        assert stored.last_revision == last + 1
    again.close()
    assert query(url, "SELECT count(*) FROM chunks WHERE snapshot NOT IN (SELECT id FROM snapshots)") == [(0,)]
    assert query(url, "SELECT count(*) FROM batches WHERE hull NOT IN (SELECT id FROM hulls)") == [(0,)]


def test_the_batches_are_those_that_the_owner_has_committed(url):
    owner = on(url)
    owner.open(no_progress)
    owner.commit([Create(HullRow(1, "fleet", "u", 1.5))])
    append(owner, 1, 3)
    heir = on(url)
    heir.follow(no_progress)
    reader = Reader(heir)
    reader.adopt([1])
    append(owner, 4, 9)
    heir.follow(no_progress)
    reader.adopt([1])
    append(owner, 10, 12)
    owner.close()
    assert heir.open(no_progress).committed == committed_at(12)
    reader.adopt([1])
    same(reader.hulls[1], heir.read(1))
    assert [each.committed.time for each in reader.hulls[1].records] == [*map(committed_at, range(1, 13))]
    heir.commit([Append(1, [record(13)])], committed_at(0))  # its clock is behind
    assert heir.read(1).records[-1].committed.time == committed_at(12)
    heir.close()


def test_a_fence_that_has_come_and_gone_meanwhile_is_not_written_over(url):
    """Its rows may be there, though there is no fence: those of the next one get other numbers."""
    owner = on(url)
    owner.open(no_progress)
    owner.commit([Create(HullRow(1, "fleet", "u", 1.5))])
    heir = on(url)
    heir.follow(no_progress)
    owner.commit([AddFence(fence_row(2, "first"), Inside()), appended(2, events(1, 3))])
    owner.commit([DropFence(2)])
    heir.follow(no_progress)
    owner.close()
    heir.open(no_progress)
    heir.commit([AddFence(fence_row(3, "second"), Inside()), appended(3, events(1, 2))])
    heir.close()
    again = on(url)
    assert [row.name for row in again.open(no_progress).fences] == ["second"]
    assert len(again.read_events(3, 0, 9)) == 2
    again.close()


def test_nothing_is_taken_from_an_owner_by_following_it(url):
    owner = on(url)
    owner.open(no_progress)
    owner.commit([Create(HullRow(1, "fleet", "u", 1.5))])
    heir = on(url)
    heir.follow(no_progress)
    append(owner, 1, 3)
    heir.close()
    append(owner, 4, 5)
    assert owner.entitled()
    owner.close()


@pytest.mark.parametrize(
    ("change", "words"),
    {
        "another owner": ("UPDATE owners SET epoch = epoch + 1", "another server owns it"),
        "lost commits": ("UPDATE totals SET (commits, batches) = (0, 0)", "a copy of the totals is damaged"),
    }.values(),
    ids=["another owner", "lost commits"],
)
def test_what_does_not_follow_is_read_anew(url, change, words):
    owner = on(url)
    owner.open(no_progress)
    owner.commit([Create(HullRow(1, "fleet", "u", 1.5))])
    owner.close()
    heir = on(url)
    heir.follow(no_progress)
    query(url, change)
    with pytest.raises(StorageError, match=words):
        heir.follow(no_progress)
    heir.close()


def test_lost_commits_are_noticed_when_it_is_taken(url):
    """As after a crash of PostgreSQL that has lost commits: what was read ahead must not be served."""
    owner = on(url)
    owner.open(no_progress)
    owner.commit([Create(HullRow(1, "fleet", "u", 1.5))])
    before = query(url, "SELECT * FROM totals"), query(url, "SELECT * FROM batches")
    append(owner, 1, 3)
    heir = on(url)
    heir.follow(no_progress)
    owner.close()
    query(url, "DELETE FROM batches")
    query(url, "DELETE FROM totals")
    for row in before[0]:
        query(url, f"INSERT INTO totals VALUES ({', '.join(['%s'] * len(row))})", *row)
    with pytest.raises(StorageError, match="commits are missing"):
        heir.open(no_progress)
    heir.close()
    again = on(url)
    again.open(no_progress)
    assert again.read(1).last_revision == 0
    again.close()


def test_damage_is_not_taken_over(url):
    """The owner still has in memory what the rows do not have any more."""
    owner = on(url)
    owner.open(no_progress)
    owner.commit([Create(HullRow(1, "fleet", "u", 1.5))])
    append(owner, 1, 3)
    query(url, "UPDATE batches SET payload = set_byte(payload, 30, get_byte(payload, 30) # 1) WHERE first = 3")
    heir = on(url)
    with pytest.raises(DamagedError, match="revisions 3 to 3 are damaged"):
        heir.follow(no_progress)
    heir.close()
    owner.close()


@pytest.mark.parametrize("ahead", [False, True])
def test_an_engine_that_cannot_load_leaves_the_partition_to_others(url, ahead):
    """Its rows are whole, but there is not enough memory for a hull, say."""
    owner = on(url)
    owner.open(no_progress)
    owner.commit([Create(HullRow(1, "fleet", "u", 1.5))])
    append(owner, 1, 3)
    owner.close()

    class Small(PostgresStorage):
        def read_each(self, numbers):
            raise MemoryError(numbers)

    async def fail():
        machine, storage = Machine(), Small(Database(url), pytest.fail)
        engine = Engine(LIMITS, storage, Supervisor(machine.clock, pytest.fail, pytest.fail), machine)
        with pytest.raises(MemoryError):
            await (engine.read_ahead(storage, no_progress) if ahead else engine.start(no_progress))
        await engine.close()

    asyncio.run(fail())
    assert query(url, "SELECT until FROM owners WHERE until > now()") == [], "nobody has to wait for a lease"
    again = on(url)
    again.open(no_progress)
    again.close()
