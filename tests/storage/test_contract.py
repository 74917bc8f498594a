"""What every implementation of the storage promises."""

import gc
import io
import itertools
import sqlite3
import threading
from dataclasses import replace

import numpy as np
import pytest
from cases import slow
from folders import appended, event, events, fence_row, fill_fence, read_fence, same

from dynhull.keys import PackedKeys
from dynhull_cluster.postgres.database import Database
from dynhull_cluster.postgres.storage import PostgresStorage
from dynhull_server.state.feed_consumers import ConsumerId, DropFeedConsumer, FedBy, FeedConsumer, PutFeedConsumer
from dynhull_server.state.fences.events.block import AppendEvents, block_of
from dynhull_server.state.fences.model.records import (
    NO_WAITS,
    AddFence,
    ChangeFence,
    Consumer,
    Delay,
    DropConsumer,
    DropEvents,
    DropFence,
    EventType,
    Inside,
    Members,
    PutConsumer,
    PutDelays,
    Waits,
)
from dynhull_server.state.records import (
    FOREVER,
    NO_TIME,
    Append,
    Contents,
    Create,
    Delete,
    Division,
    Expiry,
    HeldChange,
    HeldRows,
    HullRow,
    HullSettings,
    Kept,
    KeyRows,
    PointRows,
    QuarantineRules,
    Record,
    Shares,
    Tally,
    Window,
)
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.memory import MemoryStorage
from dynhull_server.storage.port import NEWEST, DamagedError, NotCommittedError
from dynhull_server.storage.rows.chunks import CHUNK_BYTES
from dynhull_server.storage.sqlite.disk import Disk
from dynhull_server.storage.sqlite.folder import DATABASE
from dynhull_server.storage.sqlite.storage import SQLiteStorage

NOTHING = np.empty((0, 2))
SIMULATED = itertools.count()
CHUNK_POINTS = CHUNK_BYTES // 16


class MemoryDisk(Disk):
    """SQLite's own memory in place of files: what simulations run on."""

    def __init__(self):
        self._name = f"file:/simulated-{next(SIMULATED)}?vfs=memdb"
        self._keep = sqlite3.connect(self._name, uri=True, check_same_thread=False)

    def make(self, folder):
        """There are no folders."""

    def lock(self, _):
        return io.StringIO()

    def size(self, file):
        if file.name != DATABASE:
            return None
        return self._keep.execute("PRAGMA page_count").fetchone()[0]

    def identity(self, _):
        return 0, 0

    def birth(self, _):
        """There is no file."""

    def read(self, _):
        """Nor any other."""

    def open(self, _):
        return io.BytesIO()

    def sync(self, file):
        """There is nothing more durable."""

    def connect(self, *_):
        return sqlite3.connect(self._name, uri=True, isolation_level=None, check_same_thread=False)


def no_progress(done, total):
    assert 0 <= done <= total


def never(reason):
    raise AssertionError(reason)


# They differ in when a folder is synced; what becomes of commits that fail is tested of each in test_faults.py.
LESS_OFTEN = [
    pytest.param(each, marks=pytest.mark.only_with("LONG_CASES")) for each in Durability if each != Durability.SYNC
]
STORAGES = ["memory", "simulated", pytest.param("postgresql", marks=slow), Durability.SYNC, *LESS_OFTEN]


@pytest.fixture(params=STORAGES)
def make(request, tmp_path):
    """Makes the storage; again, as it is after a restart."""
    if request.param == "memory":
        storage = MemoryStorage()
        return lambda: storage
    if request.param == "postgresql":
        database = Database(request.getfixturevalue("postgres").new_database())
        return lambda: PostgresStorage(database, never)
    if request.param == "simulated":
        disk = MemoryDisk()
        return lambda: SQLiteStorage(tmp_path / "data", disk=disk)
    return lambda: SQLiteStorage(tmp_path / "data", request.param)


class Opened:
    """A storage, with shorter words for what tests do to it."""

    def __init__(self, make):
        self.make = make
        self.storage = make()
        self.contents = self.storage.open(no_progress)

    def reopen(self):
        self.storage.close()
        self.storage = self.make()
        self.contents = self.storage.open(no_progress)
        return self

    def commit(self, *changes):
        self.storage.commit(changes)

    def create(self, number, *first):
        self.commit(Create(row(number)), *first)

    def carry_out(self, steps):
        count = 0
        for step in steps:
            self.commit(step)
            count += 1
        return count

    def snapshot(self, number, revision, points):
        return self.carry_out(self.storage.snapshot(number, Kept(revision, Contents(points), {"w": revision})))


@pytest.fixture
def opened(make):
    opened = Opened(make)
    yield opened
    opened.storage.close()


def row(number, name=None):
    return HullRow(number, name or f"hull {number}", f"uid{number}", 12.5 + number, HullSettings(max_points=number))


def points(n, seed=0):
    return np.random.default_rng(seed).random((n, 2))


def record(revision, n=3, deletes=NOTHING, lenient=False, **fields):
    return Record(revision, PointRows(points(n, revision), deletes, lenient), **fields)


def records(first, last):
    return [record(revision) for revision in range(first, last + 1)]


def test_what_was_committed_comes_back(opened):
    assert (opened.contents.hulls, opened.contents.next_number, opened.contents.notes) == ([], 1, [])
    batches = [
        record(1, producer="truck é", sequence=7, may_skip=True),
        Record(2, PointRows(NOTHING, points(1, 1))),
        Record(3, PointRows(NOTHING, NOTHING)),
        record(4, n=20_000, deletes=np.array([[-0.5, 1e308], [5e-324, 0.0]]), lenient=True),
    ]
    fleet, other = row(1, "fleet"), row(2, "fl/é")
    opened.commit(Create(fleet), Append(1, batches[:2]))
    opened.commit(Append(1, batches[2:]), Create(other))
    for _ in range(2):
        assert opened.storage.row(1) == fleet
        assert opened.storage.row(3) is None
        kept = opened.storage.read(1)
        assert (kept.revision, kept.contents.points.shape, kept.producers, kept.last_revision) == (0, (0, 2), {}, 4)
        same(kept.records, batches)
        assert opened.storage.read(2).records == []
        assert opened.storage.oldest(1) == 0
        opened.reopen()
        assert (opened.contents.hulls, opened.contents.next_number) == ([other, fleet], 3)
        assert opened.contents.notes == []


NOW, HOUR = 1_800_000_000_000_000, 3_600_000_000


def test_batches_know_their_commits(opened):
    """What is committed together has one number; later numbers are greater. Times never go back, whatever clocks do."""
    assert opened.contents.committed == 0
    opened.create(1)
    opened.create(2)
    both = [Append(1, records(1, 2)), Append(2, [record(1)])]
    for changes, now in ((both, NOW), ([Append(1, [record(3)])], NOW - HOUR), ([Append(2, [record(2)])], NOW + HOUR)):
        opened.storage.commit(changes, now)
    opened.reopen()  # another process, whose clock is behind
    assert opened.contents.committed == NOW + HOUR
    opened.storage.commit([Append(1, [record(4)]), Append(2, [record(3)])], NOW - HOUR)
    opened.storage.commit([Append(1, [record(5, cause="expiry")])], NOW + HOUR + 1)
    for _ in range(2):
        first, second = (opened.storage.read(number).records for number in (1, 2))
        numbers, times = zip(*(each.committed for each in first), strict=True)
        assert times == (NOW, NOW, NOW, NOW + HOUR, NOW + HOUR + 1)
        assert numbers[0] == numbers[1] < numbers[2] < numbers[3] < numbers[4]
        assert [each.committed for each in second] == [
            (numbers[0], NOW),
            (second[1].committed.number, NOW + HOUR),
            (numbers[3], NOW + HOUR),
        ]
        assert numbers[2] < second[1].committed.number < numbers[3]
        assert [each.cause for each in first] == [None] * 4 + ["expiry"]
        opened.reopen()


def test_a_snapshot_knows_the_commit_of_its_revision(opened):
    """Also where the batch is dropped: when the last revision of a hull that rests was committed is not forgotten."""
    opened.create(1)
    for revision in range(1, 5):
        opened.storage.commit([Append(1, [record(revision)])], NOW + revision)
    for revision in (2, 4, 4):
        opened.snapshot(1, revision, points(3))
    for _ in range(2):
        kept = opened.storage.read(1)
        assert (kept.revision, kept.records, kept.committed.time) == (4, [], NOW + 4)
        opened.reopen()
    opened.storage.commit([Append(1, [record(5)])], NOW)
    opened.snapshot(1, 4, points(3))
    kept = opened.storage.read(1)
    assert kept.committed.time == NOW + 4 == kept.records[0].committed.time
    assert kept.committed.number < kept.records[0].committed.number


def test_a_hull_is_read_as_it_was(opened):
    opened.create(1)
    for revision in range(1, 6):
        opened.commit(Append(1, [record(revision)]))
    opened.commit(Append(1, records(6, 9)))
    for until in range(10):
        same(opened.storage.read(1, until).records, records(1, until))
    same(opened.storage.read(1, NEWEST).records, records(1, 9))


def test_many_hulls_are_read_like_each_alone(opened):
    for number in range(1, 6):
        opened.create(number)
    for revision in range(1, 8):
        opened.commit(*(Append(number, [record(revision)]) for number in (1, 3, 4)))
    opened.commit(Append(5, records(1, 3)))
    opened.snapshot(3, 7, points(4))
    for numbers in ([1, 2, 3, 4, 5], [4, 3, 1], []):
        together = list(opened.storage.read_each(numbers))
        for number, kept in zip(numbers, together, strict=True):
            alone = opened.storage.read(number)
            same(kept.records, alone.records)
            assert kept.revision == alone.revision
            np.testing.assert_array_equal(kept.contents.points, alone.contents.points)
    with pytest.raises(KeyError):
        list(opened.storage.read_each([1, 6]))


def test_a_snapshot_stands_for_the_batches_before_it(opened):
    opened.create(1)
    at = {}
    for revision in range(1, 41):
        opened.commit(Append(1, [record(revision)]))
        if revision % 10 == 0:
            at[revision] = points(2 * CHUNK_POINTS + 5, revision)
            opened.snapshot(1, revision, at[revision])
    opened.commit(Append(1, [record(41)]))
    for _ in range(2):
        kept = opened.storage.read(1)
        assert (kept.revision, kept.producers, kept.last_revision) == (40, {"w": 40}, 41)
        np.testing.assert_array_equal(kept.contents.points, at[40])
        same(kept.records, [record(41)])
        assert opened.storage.oldest(1) == 30
        kept = opened.storage.read(1, 33)
        assert (kept.revision, kept.producers) == (30, {"w": 30})
        np.testing.assert_array_equal(kept.contents.points, at[30])
        same(kept.records, records(31, 33))
        with pytest.raises(DamagedError, match="no longer kept"):
            opened.storage.read(1, 29)
        opened.reopen()


def strings(n, seed=0):
    """Keys of 1 to 255 bytes."""
    return PackedKeys.pack([f"{seed}.{i} é".ljust(i % 240 + 1, "x")[:254] for i in range(n)])


def integers(n, seed=0):
    return np.random.default_rng(seed).integers(0, 2**64 - 1, n, np.uint64, endpoint=True)


def times(n, seed=0):
    found = np.random.default_rng(seed).integers(-(2**53), 2**53, n)
    found[:1], found[1:2] = NO_TIME, FOREVER
    return found


def windowed(revision):
    rows = PointRows(points(4, revision), points(revision % 3, revision), False, times(4, revision))
    return Record(revision, Expiry(revision - 5, 2) if revision % 4 == 0 else rows, clock=-revision)


def keyed(keys):
    def record(revision):
        conditions = (None, "absent", "present")
        columns = keys(6, revision), points(6, revision), keys(revision % 3, -revision % 7)
        rows = KeyRows(*columns, times(6, revision), times(6, -revision % 7), conditions[revision % 3])
        rows.accuracies = np.arange(6) * 0.25
        some = KeyRows(*columns) if revision % 2 else KeyRows(keys(0), NOTHING, keys(1))
        of = {0: rows, 1: some, 2: Expiry(None, 3)}[revision // 3 % 3]
        return Record(revision, of, f"gateway {revision % 2}", revision, clock=2**53 - revision)

    return record


WINDOW = Window(max_age=5, max_points=7, clock="data", max_skew=0, clamps=True)
KINDS = {
    "windowed": (HullSettings(window=WINDOW), windowed, lambda n: Contents(points(n), times=times(n))),
    "strings": (
        HullSettings("str", 9, Window(max_points=1), by_event_time=True),
        keyed(strings),
        lambda n: Contents(points(n), strings(n), times(n), times(n, 1)),
    ),
    "integers": (
        HullSettings("int"),
        keyed(integers),
        lambda n: Contents(points(n), integers(n), accuracies=np.arange(n) % 3 / 7),
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_hulls_with_keys_and_times(opened, kind):
    settings, record, contents = KINDS[kind]
    hull = HullRow(3, kind, "uid", 0.5, settings)
    opened.commit(Create(hull))
    everything = [record(revision) for revision in range(1, 31)]
    skipping = frozenset({"gateway 1"})
    kept = {
        20: Kept(20, contents(40_000), {"gateway 1": 19}, [], -7, skipping=skipping),
        30: Kept(30, contents(0), {}, [], 2**53),
    }
    for revision in (10, 20, 30):
        opened.commit(Append(3, everything[revision - 10 : revision]))
        if revision in kept:
            opened.carry_out(opened.storage.snapshot(3, kept[revision]))
    for _ in range(2):
        assert opened.storage.row(3) == hull
        for revision in range(20, 31):
            base = kept[revision // 10 * 10]
            expected = replace(base, records=everything[base.revision : revision])
            same(opened.storage.read(3, revision), expected)
        opened.reopen()
        assert opened.contents.hulls == [hull]


def held(keys, n, seed=0):
    measures = np.random.default_rng(seed).random((2, n))
    measures[:, 1::3] = np.nan
    revisions = np.arange(n) + 1
    whens = times(n, seed), times(n, seed + 1)
    accuracies = np.arange(n) % 2 * 1.5
    return HeldRows(keys(n, seed), points(n, seed), *whens, *measures, revisions, revisions, accuracies)


@pytest.mark.parametrize(("kind", "keys"), [("str", strings), ("int", integers)])
def test_what_is_in_quarantine_comes_back(opened, kind, keys):
    rules = QuarantineRules(12.5, None, 3)
    hull = HullRow(3, kind, "uid", 0.5, HullSettings(kind, quarantine=rules))
    opened.commit(Create(hull))
    nothing = keys(0), NOTHING, keys(0)
    changes = [
        Record(1, KeyRows(*nothing, held=HeldChange(held(keys, 5), keys(0)))),
        Record(2, KeyRows(*nothing, held=HeldChange(held(keys, 0), keys(2), QuarantineRules(None, 1.5, 0)))),
        Record(3, KeyRows(keys(2), points(2), keys(0), held=HeldChange(held(keys, 4, 7), keys(3, 1)))),
    ]
    opened.commit(Append(3, changes[:2]))
    kept = Kept(2, Contents(points(9), keys(9), held=held(keys, 40_000)), rules=QuarantineRules(None, 1.5, 0))
    opened.carry_out(opened.storage.snapshot(3, kept))
    opened.commit(Append(3, changes[2:]))
    for _ in range(2):
        assert opened.storage.row(3) == hull
        same(opened.storage.read(3), replace(kept, records=changes[2:]))
        opened.reopen()


def test_a_snapshot_counts_once_it_is_whole(opened):
    opened.create(1, Append(1, records(1, 2)))
    steps = opened.storage.snapshot(1, Kept(2, Contents(points(3 * CHUNK_POINTS))))
    opened.commit(next(steps))
    steps.close()
    for _ in range(2):
        kept = opened.storage.read(1)
        assert kept.last_revision == 2
        assert kept.revision in (0, 2)
        opened.reopen()
    opened.carry_out(opened.storage.sweep())
    assert opened.carry_out(opened.storage.sweep()) == 0
    assert opened.storage.read(1).last_revision == 2


def test_an_empty_hull_has_a_snapshot_too(opened):
    opened.create(1, Append(1, [record(1)]))
    opened.snapshot(1, 1, NOTHING)
    kept = opened.storage.read(1)
    assert (kept.revision, kept.contents.points.shape, kept.records) == (1, (0, 2), [])


def test_snapshots_of_hulls_are_written_beside_each_other_and_beside_a_sweep(opened):
    for number in (1, 2, 3):
        opened.create(number, Append(number, records(1, 3)))
    opened.snapshot(3, 3, points(CHUNK_POINTS + 1))
    opened.commit(Delete(3))
    large = {number: points(2 * CHUNK_POINTS + 1, number) for number in (1, 2)}
    writing = [opened.storage.snapshot(number, Kept(3, Contents(large[number]))) for number in (1, 2)]
    writing.append(opened.storage.sweep())
    while writing:
        for steps in list(writing):
            step = next(steps, None)
            if step is None:
                writing.remove(steps)
            else:
                opened.commit(step)
    for _ in range(2):
        for number in (1, 2):
            np.testing.assert_array_equal(opened.storage.read(number).contents.points, large[number])
        opened.reopen()


def test_a_deleted_hull_is_gone(opened):
    opened.create(1, Append(1, records(1, 30)))
    opened.create(2, Append(2, [record(1)]))
    opened.snapshot(1, 30, points(3))
    steps = opened.storage.snapshot(1, Kept(30, Contents(points(3))))  # is under way
    opened.commit(next(steps))
    opened.commit(Delete(1))
    opened.carry_out(steps)
    for _ in range(2):
        assert opened.storage.row(1) is None
        for read in (opened.storage.read, opened.storage.oldest):
            with pytest.raises(KeyError):
                read(1)
        opened.reopen()
        assert opened.contents.hulls == [row(2)]
    opened.carry_out(opened.storage.sweep())
    assert opened.carry_out(opened.storage.sweep()) == 0
    same(opened.reopen().storage.read(2).records, [record(1)])


def test_a_name_is_free_again_in_the_commit_that_deletes_it(opened):
    opened.commit(Create(row(1, "a")), Append(1, [record(1)]))
    opened.commit(Delete(1), Create(row(2, "a")), Append(2, records(1, 2)))
    opened.reopen()
    assert opened.contents.hulls == [row(2, "a")]
    same(opened.storage.read(2).records, records(1, 2))


def test_numbers_are_never_used_again(opened):
    opened.create(7)
    opened.create(5)
    opened.commit(Delete(7))
    assert opened.reopen().contents.next_number == 8
    opened.carry_out(opened.storage.sweep())
    opened.commit(Create(row(8)), Delete(8))
    assert opened.reopen().contents.next_number == 9


@pytest.mark.parametrize(
    "change",
    [
        Create(row(1)),
        Append(1, records(4, 5)),
        Append(1, records(6, 7)),
        Append(2, records(1, 1)),
        Delete(2),
    ],
)
def test_a_group_is_kept_whole_or_not_at_all(opened, change):
    opened.create(1, Append(1, records(1, 3)))
    with pytest.raises(NotCommittedError):
        opened.commit(Create(row(3)), Append(1, [record(4)]), change, Delete(3))
    for _ in range(2):
        same(opened.storage.read(1).records, records(1, 3))
        assert opened.storage.row(3) is None
        opened.reopen()
    opened.commit(Append(1, [record(4)]))
    same(opened.storage.read(1).records, records(1, 4))


def test_a_group_of_much(opened):
    numbers = range(1, 40)
    opened.commit(*(Create(row(number)) for number in numbers))
    for revision in range(1, 8):
        opened.commit(*(Append(number, [record(revision, number)]) for number in numbers))
    opened.commit(*(Delete(number) for number in numbers if number % 3 == 0))
    opened.reopen()
    opened.carry_out(opened.storage.sweep())
    for number in numbers:
        if number % 3:
            expected = [record(revision, number) for revision in range(1, 8)]
            same(opened.storage.read(number).records, expected)
    assert len(opened.contents.hulls) == sum(number % 3 > 0 for number in numbers)


@pytest.mark.parametrize("make", [each for each in STORAGES if each != "simulated"], indirect=True)
def test_reading_goes_on_beside_commits(opened):
    """Not in SQLite's own memory, which readers lock."""
    opened.create(1)
    done = threading.Event()
    wrong = []

    def read():
        while not done.is_set():
            try:
                found = opened.storage.read(1)
                same(found.records, records(found.revision + 1, found.last_revision))
            except BaseException as error:
                wrong.append(error)
                return

    threads = [threading.Thread(target=read) for _ in range(6)]
    for thread in threads:
        thread.start()
    try:
        for revision in range(1, 61):
            opened.commit(Append(1, [record(revision)]))
            if revision % 20 == 0:
                opened.snapshot(1, revision, points(10))
    finally:
        done.set()
        for thread in threads:
            thread.join()
    assert wrong == []


def test_housekeeping_changes_nothing(opened):
    opened.create(1)
    commit = opened.storage.commit([Append(1, records(1, 3))], 5_000_000)
    opened.storage.sync()
    opened.storage.checkpoint()
    assert opened.storage.settle() == commit
    assert opened.storage.bytes_used() >= 0
    same(opened.storage.read(1).records, records(1, 3))


# Fences


def fenced(opened, last, number=9):
    """A fence with `last` events, and the hull that it depends on."""
    if opened.storage.row(1) is None:
        opened.commit(Create(row(1, "fleet")))
    fill_fence(opened.storage, last, number)


def inside_of(opened, number=9):
    kept = read_fence(opened.storage, number)
    return {each.hull: list(each.keys) for each in kept.inside.members}


def test_a_fence_comes_back_with_its_events(opened):
    assert opened.contents.fences == []
    fenced(opened, 3)
    opened.commit(appended(9, events(4, 6)), PutConsumer(9, Consumer("mail", 5, 2)))
    for _ in range(2):
        kept = read_fence(opened.storage, 9)
        assert kept.row == fence_row()
        assert kept.events == events(1, 6)
        assert (kept.first, kept.last, kept.consumers) == (1, 6, {"mail": Consumer("mail", 5, 2)})
        assert inside_of(opened) == {"fleet": ["a"]}
        assert opened.storage.read_events(9, 2, 2) == events(3, 4)
        assert opened.storage.read_events(9, 6, 2) == []
        opened.reopen()
        assert opened.contents.fences == [fence_row()]
        assert opened.contents.next_number == 10
    assert read_fence(opened.storage, 1) is None


def test_all_kinds_of_events_come_back(opened):
    members = (Members("fleet", PackedKeys.pack(["a", "é"]), 7), Members("b", np.array([2, 2**63], np.uint64), 2**40))
    kinds = [
        event(1)._replace(type=EventType.SNAPSHOT, key=None, hull="", position=None, previous=None, distance=None),
        event(2)._replace(key=2**64 - 1, event_time=NO_TIME, area_revision=5, causes=255, distance=float("inf")),
        event(3)._replace(hull="other", time=3, first_time=1, previous=None, distance=5e-324),
        event(4)._replace(position=None, distance=None, previous=(-1e308, 5e-324), subject_revision=2**50),
        event(5)._replace(type=EventType.BEGIN, key=None, position=None, previous=None, distance=0.0),
    ]
    kinds[0] = kinds[0]._replace(inside=members)
    fenced(opened, 0)
    opened.commit(appended(9, kinds))
    same(read_fence(opened.reopen().storage, 9).events[0].inside[0].keys.data, members[0].keys.data)
    found = opened.storage.read_events(9, 0, 10)
    assert found[1:] == kinds[1:]
    assert [(each.hull, list(each.keys), each.revision) for each in found[0].inside] == [
        ("fleet", ["a", "é"], 7),
        ("b", [2, 2**63], 2**40),
    ]


def test_who_is_inside_replaces_earlier_events(opened):
    fenced(opened, 6)
    members = (Members("fleet", PackedKeys.pack(f"key {i:05}" for i in range(40_000)), 4),)
    opened.carry_out(opened.storage.inside(9, Inside(4, members, 2**61)))
    for _ in range(2):
        kept = read_fence(opened.storage, 9)
        assert (kept.inside.sequence, kept.inside.time, kept.events, kept.first) == (4, 2**61, events(5, 6), 1)
        assert [key for each in kept.inside.members for key in each.keys] == list(members[0].keys)
        opened.reopen()
    assert opened.storage.boundary(9, 7) == 5  # later events lead from there to who is inside now
    opened.commit(DropEvents(9, 5))
    for _ in range(2):
        assert opened.storage.read_events(9, 0, 10) == events(5, 6)
        assert opened.storage.read_events(9, 0, 1) == events(5, 5)
        assert read_fence(opened.storage, 9).first == 5
        opened.reopen()


def test_since_when_who_is_inside_waits_comes_back(opened):
    fenced(opened, 2)
    strings = Members("fleet", PackedKeys.pack(f"é{i:05}" for i in range(40_000)), 4, np.arange(40_000) - 3)
    integers = Members("b", np.array([2, 2**63], np.uint64), 5, np.array([NO_TIME, 2**62]))
    opened.carry_out(opened.storage.inside(9, Inside(2, (strings, integers, Members("c", PackedKeys.pack(["a"]), 6)))))
    for _ in range(2):
        kept = read_fence(opened.storage, 9).inside.members
        found = {each.hull: [] for each in kept}
        for each in kept:
            found[each.hull] += [None] if each.since is None else each.since.tolist()
        assert found == {"fleet": strings.since.tolist(), "b": [NO_TIME, 2**62], "c": [None]}
        opened.reopen()


def test_since_when_a_fence_asks_for_how_long_comes_back(opened):
    fenced(opened, 2)
    for waits in (Waits(2, 2**60), NO_WAITS):
        changed = replace(fence_row(), config=replace(fence_row().config, dwell=waits.time), waits=waits)
        opened.commit(ChangeFence(changed))
        for _ in range(2):
            assert read_fence(opened.storage, 9).row == changed
            opened.reopen()


def test_delays_come_back_until_they_end(opened):
    fenced(opened, 2)
    first = read_fence(opened.storage, 9).delays
    assert list(first) == [("fleet", "é")]
    some = {("fleet", "b"): Delay(False, -1, 0, 255), ("b", 2**64 - 1): Delay(True, 2**62, 2**32 - 1, 0)}
    opened.commit(PutDelays(9, some), PutDelays(9, {("fleet", "é"): None, ("b", 7): None}))
    for _ in range(2):
        assert read_fence(opened.storage, 9).delays == some
        opened.reopen()
    opened.commit(PutDelays(9, {("b", 2**64 - 1): Delay(True, 3, 2, 1)}))
    opened.commit(PutDelays(9, {("fleet", "b"): None, ("fleet", "é"): Delay(True, 4, 1, 1)}))
    opened.commit(PutDelays(9, {("fleet", "é"): None}))
    for _ in range(2):
        assert read_fence(opened.storage, 9).delays == {("b", 2**64 - 1): Delay(True, 3, 2, 1)}
        opened.reopen()


def test_settings_and_consumers_of_a_fence_change(opened):
    fenced(opened, 2)
    changed = replace(fence_row(), config=replace(fence_row().config, margin=0.0, max_events=7))
    opened.commit(ChangeFence(changed), PutConsumer(9, Consumer("post")), DropConsumer(9, "mail"))
    for _ in range(2):
        kept = read_fence(opened.storage, 9)
        assert (kept.row, kept.consumers) == (changed, {"post": Consumer("post")})
        opened.reopen()


def test_consumers_of_feeds_come_back(opened):
    fenced(opened, 1)
    of_hull, of_prefix = ConsumerId(FedBy("fleet"), "index"), ConsumerId(FedBy("", True), "index")
    first, second = FeedConsumer(of_hull, "uid", 2**62), FeedConsumer(of_prefix, "7", 3, 2**50)
    opened.commit(PutFeedConsumer(FeedConsumer(of_hull, "before", 1)), PutFeedConsumer(second))
    opened.commit(PutFeedConsumer(FeedConsumer(of_hull, "between", 2)), PutFeedConsumer(first))
    opened.carry_out(opened.storage.sweep())
    for _ in range(2):
        assert sorted(opened.storage.feed_consumers(), key=lambda each: each.id) == [second, first]
        opened.reopen()
    opened.commit(DropFeedConsumer(of_hull), DropFeedConsumer(of_hull), Delete(1), DropFence(9))
    for _ in range(2):
        assert opened.storage.feed_consumers() == [second]
        opened.reopen()


def test_a_deleted_fence_leaves_nothing(opened):
    fenced(opened, 3)
    opened.commit(appended(9, events(4, 4)), DropFence(9))
    fenced(opened, 1, number=10)
    opened.carry_out(opened.storage.sweep())
    assert opened.carry_out(opened.storage.inside(9, Inside(3))) <= 1
    for _ in range(2):
        assert read_fence(opened.storage, 9) is None
        assert read_fence(opened.storage, 10).events == events(1, 1)
        assert opened.contents.next_number in (1, 11)
        opened.reopen()


def test_commits_leave_nothing_to_the_garbage_collector(opened):
    """Cycles of references would have it look at all objects of a server with many fences, again and again."""
    fenced(opened, 3)
    gc.collect()
    gc.disable()
    try:
        opened.commit(appended(9, events(4, 6)), Append(1, records(1, 1)))
        opened.commit(PutConsumer(9, Consumer("post")), DropEvents(9, 2))
        assert gc.collect() == 0
    finally:
        gc.enable()


def test_fences_that_share_commits_keep_their_own_events(opened):
    """Also when some of them are deleted, and others drop events."""
    for number in (9, 10, 11, 12):
        opened.commit(
            *([Create(row(1, "fleet"))] * (number == 9)), AddFence(fence_row(number, f"gate {number}"), Inside())
        )
    for first in (1, 3, 5):
        made = {number: events(first, first + 1) for number in (9, 10, 11, 12)}
        opened.commit(AppendEvents(block_of(made)))
    for number in (10, 11):
        opened.carry_out(opened.storage.inside(number, Inside(6)))
        opened.commit(DropEvents(number, 4))
    opened.commit(DropFence(12))
    for _ in range(2):
        opened.carry_out(opened.storage.sweep())
        assert opened.storage.read_events(9, 0, 10) == events(1, 6)
        assert opened.storage.read_events(9, 3, 2) == events(4, 5)
        assert opened.storage.read_events(10, 0, 10) == opened.storage.read_events(11, 0, 10) == events(4, 6)
        kept = opened.storage.read_fences([9, 12, 10])
        assert [each and (each.first, each.last, each.events) for each in kept] == [
            (1, 6, events(1, 6)),
            None,
            (4, 6, []),
        ]
        opened.reopen()
    opened.commit(DropFence(9), appended(10, events(7, 7)))
    opened.carry_out(opened.storage.sweep())
    assert opened.storage.read_events(10, 0, 10) == events(4, 7)


@pytest.mark.parametrize(
    "change",
    [
        AddFence(fence_row(), Inside()),
        appended(9, events(2, 3)),
        appended(9, events(4, 4)),
        appended(8, events(1, 1)),
        ChangeFence(fence_row(8)),
        DropFence(8),
        PutConsumer(8, Consumer("mail")),
    ],
)
def test_changes_of_fences_that_do_not_fit_are_refused(opened, change):
    fenced(opened, 2)
    with pytest.raises(NotCommittedError):
        opened.commit(appended(9, events(3, 3)), PutConsumer(9, Consumer("post")), change, change)
    for _ in range(2):
        kept = read_fence(opened.storage, 9)
        assert (kept.events, list(kept.consumers)) == (events(1, 2), ["mail"])
        opened.reopen()


def test_the_newest_revisions_of_a_shard_can_be_dropped(make):
    """What a shard has logged beyond the last decision of its root did not happen."""
    storage = make()
    storage.open(no_progress)
    storage.commit([Create(HullRow(1, "hull#0", "u", 0.0, HullSettings(shards=2, shard=0)))])
    for revision in range(1, 7):
        storage.commit([Append(1, [steps_record(revision)])])
    assert storage.cut(1, 6) is None
    storage.commit([storage.cut(1, 3), Append(1, [steps_record(4, 40.0)])])
    kept = storage.read(1)
    assert [record.rows.inserts[0, 0] for record in kept.records] == [1, 2, 3, 40]
    storage.close()
    storage = make()
    assert storage.open(no_progress).notes == []
    kept = storage.read(1)
    assert [record.rows.inserts[0, 0] for record in kept.records] == [1, 2, 3, 40]
    assert (kept.records[-1].producer, kept.records[-1].sequence) == ("steps", 40)
    storage.commit([Append(1, [steps_record(5)])])
    storage.close()


def steps_record(revision, x=0.0):
    points = np.array([[x or revision, 0.0]])
    return Record(revision, PointRows(points, NOTHING), "steps", 10 * revision, may_skip=True)


def test_a_deleted_shard_has_nothing_to_drop(make):
    storage = make()
    storage.open(no_progress)
    storage.commit([Create(HullRow(1, "hull#0", "u", 0.0, HullSettings(shards=2, shard=0)))])
    for revision in (1, 2):
        storage.commit([Append(1, [steps_record(revision)])])
    cut = storage.cut(1, 1)
    storage.commit([Delete(1)])
    storage.commit([cut])
    assert storage.row(1) is None
    storage.close()


def test_what_a_root_knows_of_its_shards_comes_back(make):
    storage = make()
    storage.open(no_progress)
    settings = HullSettings(shards=3)
    storage.commit([Create(HullRow(1, "hull", "u", 0.0, settings))])
    decided = [
        Record(1, PointRows(np.eye(2), NOTHING), "ship", 1, shares=Shares({0: Tally(1, 2, 1), 2: Tally(1, 5, 5)})),
        Record(2, PointRows(NOTHING, np.eye(2)), clock=7, shares=Shares({2: Tally(2, 4, 4)}, expiry=True)),
        Record(3, PointRows(NOTHING, NOTHING), shares=Shares({0: Tally(9, 4, 4)}, division=Division(1, 2**40))),
    ]
    storage.commit([Append(1, decided)])
    same(storage.read(1).records, decided)
    tallies = {0: Tally(1, 2, 1), 1: Tally(), 2: Tally(2, 4, 4)}
    division = Division(3, 5)
    for step in storage.snapshot(1, Kept(2, Contents(), {"ship": 1}, tallies=tallies, division=division)):
        storage.commit([step])
    storage.close()
    storage = make()
    (row,) = storage.open(no_progress).hulls
    kept = storage.read(1)
    assert (row.settings, kept.revision, kept.tallies, kept.division) == (settings, 2, tallies, division)
    assert kept.divided(settings) == (Division(1, 2**40), {0: Tally(9, 4, 4)})
    storage.close()
