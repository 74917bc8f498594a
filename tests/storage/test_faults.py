"""Commits that fail, at each place where they can, and a machine without memory, disk space or descriptors."""

import os
import resource
import shutil
import sqlite3
import threading
from dataclasses import replace

import numpy as np
import pytest
from faulty_disk import FaultyDisk, failure
from folders import DATABASE, LOG, append, fill, killed, no_progress, opened, points, record, records, same

from dynhull.keys import PackedKeys
from dynhull_server.state.records import Append, Contents, Create, Delete, HullRow, Kept, KeyRows, Record
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.port import NotCommittedError, StorageError
from dynhull_server.storage.sqlite.disk import OpenMode
from dynhull_server.storage.sqlite.storage import SQLiteStorage


@pytest.fixture
def disk():
    return FaultyDisk()


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data"


@pytest.fixture(params=Durability)
def storage(request, folder, disk):
    storage = SQLiteStorage(folder, request.param, disk)
    storage.open(no_progress)
    fill(storage, 3)
    yield storage
    storage.close()


FULL = sqlite3.SQLITE_FULL
ERRORS = [
    failure(FULL),
    failure(sqlite3.SQLITE_IOERR_WRITE),
    failure(sqlite3.SQLITE_IOERR_READ),
    failure(sqlite3.SQLITE_CANTOPEN),
    MemoryError(),
]


@pytest.mark.every(7)
@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("error", ERRORS, ids=lambda error: str(getattr(error, "sqlite_errorcode", "memory")))
@pytest.mark.parametrize("statement", ["BEGIN IMMEDIATE", "INSERT INTO batches", "UPDATE totals"])
def test_what_fails_before_the_commit_changes_nothing(storage, folder, disk, statement, error, late, tmp_path):
    disk.fail(statement, error, late=late)
    with pytest.raises(NotCommittedError) as refused:
        storage.commit([Append(1, [record(4)]), Create(HullRow(2, "b", "", 0.0))])
    assert refused.value.full == (getattr(error, "sqlite_errorcode", None) == FULL)
    assert str(refused.value)
    same(storage.read(1).records, records(1, 3))
    append(storage, 4, 5)
    crash, contents = opened(killed(folder, tmp_path / "crash"))
    same(crash.read(1).records, records(1, 5))
    assert len(contents.hulls) == 1
    crash.close()


def test_no_room_at_the_commit_itself_changes_nothing(storage, disk):
    disk.fail("COMMIT", failure(FULL))
    with pytest.raises(NotCommittedError, match="the disk is full") as refused:
        append(storage, 4, 4)
    assert refused.value.full
    append(storage, 4, 5)
    same(storage.read(1).records, records(1, 5))


UNKNOWN = [failure(sqlite3.SQLITE_IOERR_FSYNC), failure(sqlite3.SQLITE_IOERR_SHMSIZE), MemoryError()]


@pytest.mark.parametrize("kept", [False, True])
@pytest.mark.parametrize("error", UNKNOWN, ids=str)
def test_an_unknown_outcome_is_decided(storage, folder, disk, error, kept, tmp_path):
    disk.fail("COMMIT", error, late=kept)
    with pytest.raises(MemoryError if isinstance(error, MemoryError) else StorageError):
        storage.commit([Append(1, [record(4)]), Create(HullRow(2, "b", "", 0.0))])
    for asked in (lambda: storage.read(1), lambda: storage.row(2), lambda: append(storage, 5, 5)):
        with pytest.raises(StorageError, match="not known yet"):
            asked()
    disk.no_connection = True
    with pytest.raises(StorageError, match="injected"):
        storage.settle()
    disk.no_connection = False
    disk.fail("COMMIT", failure(sqlite3.SQLITE_IOERR_FSYNC))
    with pytest.raises(StorageError, match="injected"):
        storage.settle()
    last = 4 if kept else 3
    settled = storage.settle()
    assert settled.number >= storage.batches(1, last - 1, last)[0].committed.number
    assert storage.settle() == settled
    same(storage.read(1).records, records(1, last))
    assert (storage.row(2) is not None) == kept
    append(storage, last + 1, last + 2)
    crash, contents = opened(killed(folder, tmp_path / "crash"))
    same(crash.read(1).records, records(1, last + 2))
    assert (len(contents.hulls), contents.notes) == (1 + kept, [])
    crash.close()


def leave_a_ghost(folder, work, change):
    """Put the frames of a commit behind the end of the log, as a sync that fails leaves them."""
    copy = killed(folder, work)
    log = copy / LOG
    other = sqlite3.connect(copy / DATABASE, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    change(other)
    other.execute("COMMIT")
    frames = log.read_bytes()
    other.close()
    shutil.rmtree(copy)
    with (folder / LOG).open("r+b") as live:
        live.write(frames)


@pytest.mark.parametrize("rounds", [1, 3])
def test_a_commit_that_was_settled_is_never_found_later(tmp_path, disk, rounds):
    """Frames with a commit mark lie in the log: without `settle` a crash brings the commit back."""
    folder = tmp_path / "data"
    storage = SQLiteStorage(folder, disk=disk)
    storage.open(no_progress)
    fill(storage, 3)
    for each in range(rounds):
        disk.fail("COMMIT", failure(sqlite3.SQLITE_IOERR_FSYNC))
        with pytest.raises(StorageError, match="injected"):
            append(storage, 4, 4)
        leave_a_ghost(
            folder,
            tmp_path / f"ghost {each}",
            lambda other: other.execute("UPDATE hulls SET name = 'ghost', created = zeroblob(60000)"),
        )
        found = killed(folder, tmp_path / f"found {each}")
        with sqlite3.connect(found / DATABASE) as database:
            assert database.execute("SELECT name FROM hulls").fetchone() == ("ghost",)
        storage.settle()
        after = killed(folder, tmp_path / f"after {each}")
        with sqlite3.connect(after / DATABASE) as database:
            assert database.execute("SELECT name FROM hulls").fetchone() == ("fleet",)
    append(storage, 4, 5)
    crash, _ = opened(killed(folder, tmp_path / "crash"))
    same(crash.read(1).records, records(1, 5))
    crash.close()
    storage.close()


def test_a_sync_that_failed_is_made_good_by_a_checkpoint(folder, disk):
    storage = SQLiteStorage(folder, Durability.INTERVAL, disk)
    storage.open(no_progress)
    fill(storage, 3)
    disk.no_sync = True
    with pytest.raises(OSError, match="injected"):
        storage.sync()
    storage.sync()  # does without
    raw = disk.connect(folder / DATABASE, OpenMode.RAW)
    assert raw.execute("SELECT max(last) FROM batches").fetchone() == (3,)
    raw.close()
    disk.no_sync = False
    storage.sync()
    storage.close()


def test_a_snapshot_that_fails_leaves_nothing_behind_for_long(storage, disk):
    steps = storage.snapshot(1, Kept(3, Contents(points(100_000))))
    storage.commit([next(steps)])
    disk.fail("INSERT INTO chunks", failure(FULL))
    with pytest.raises(NotCommittedError):
        storage.commit([next(steps)])
    steps.close()
    assert storage.read(1).revision == 0
    assert len([storage.commit([step]) for step in storage.sweep()]) == 1
    assert list(storage.sweep()) == []


def test_settling_spares_a_snapshot_that_is_under_way(storage, disk):
    storage.commit([Create(HullRow(2, "gone", "", 0.0)), Delete(2)])
    whole = points(100_000)
    steps = storage.snapshot(1, Kept(3, Contents(whole)))
    storage.commit([next(steps)])
    disk.fail("COMMIT", failure(sqlite3.SQLITE_IOERR_FSYNC))
    with pytest.raises(StorageError, match="injected"):
        append(storage, 4, 4)
    storage.settle()
    for step in storage.sweep():
        storage.commit([step])
    for step in steps:
        storage.commit([step])
    assert storage.read(1).contents.points.tobytes() == whole.tobytes()


def test_reading_and_writing_need_no_new_descriptors(storage):
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    taken = []
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (256, hard))
        while len(taken) < 256:
            try:
                taken.append(os.open("/dev/null", os.O_RDONLY))
            except OSError:
                break
        results = []
        threads = [threading.Thread(target=lambda: results.append(storage.read(1).last_revision)) for _ in range(16)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert results == [3] * 16
        append(storage, 4, 6)
        for step in storage.snapshot(1, Kept(6, Contents(points(10)))):
            storage.commit([step])
        storage.sync()
        storage.checkpoint()
        assert storage.bytes_used() > 0
    finally:
        for descriptor in taken:
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert storage.read(1).last_revision == 6


def test_a_start_without_descriptors_is_refused_and_can_be_tried_again(folder, disk):
    disk.no_connection = True
    for _ in range(2):
        with pytest.raises(StorageError, match="cannot be opened"):
            SQLiteStorage(folder, disk=disk).open(no_progress)
    disk.no_connection = False
    storage = SQLiteStorage(folder, disk=disk)
    storage.open(no_progress)
    storage.close()


@pytest.mark.parametrize("connections", range(1, 10))
@pytest.mark.parametrize("state", ["new", "stopped", "killed"])
def test_a_start_that_fails_half_way_can_be_tried_again(tmp_path, disk, state, connections):
    folder = tmp_path / "data"
    if state != "new":
        storage, _ = opened(folder)
        fill(storage, 3)
        crash = killed(folder, tmp_path / "crash")
        storage.close()
        folder = crash if state == "killed" else folder
    disk.connections_left = connections
    try:
        storage = SQLiteStorage(folder, disk=disk)
        storage.open(no_progress)
        storage.close()
    except StorageError:
        assert connections < 9
    storage, contents = opened(folder)
    assert contents.notes == []
    if state != "new":
        same(storage.read(1).records, records(1, 3))
    storage.close()


@pytest.mark.parametrize("statement", ["UPDATE totals", "COMMIT"])
@pytest.mark.parametrize("error", [failure(FULL), failure(sqlite3.SQLITE_IOERR_FSYNC)], ids=str)
def test_a_folder_that_could_not_be_closed_well_is_whole(folder, disk, statement, error):
    storage = SQLiteStorage(folder, disk=disk)
    storage.open(no_progress)
    fill(storage, 3)
    disk.fail(statement, error)
    storage.close()
    storage, contents = opened(folder)
    same(storage.read(1).records, records(1, 3))
    assert contents.notes == []
    storage.close()


def test_a_folder_is_closed_while_an_outcome_is_unknown(folder, disk):
    storage = SQLiteStorage(folder, disk=disk)
    storage.open(no_progress)
    fill(storage, 3)
    disk.fail("COMMIT", failure(sqlite3.SQLITE_IOERR_FSYNC))
    with pytest.raises(StorageError, match="injected"):
        append(storage, 4, 4)
    storage.close()
    storage, contents = opened(folder)
    same(storage.read(1).records, records(1, 3))
    assert contents.notes == []
    storage.close()


def test_values_that_no_row_can_hold_change_nothing(storage):
    new = HullRow(2, "b", "", 0.0)
    rows = record(4).rows
    mixed = KeyRows(PackedKeys.pack(["a"]), points(1), np.array([1], np.uint64))
    for change in (
        Create(replace(new, number=2**63)),
        Create(replace(new, name="\ud800")),
        Append(1, [Record(4, rows, "x" * 2**16)]),
        Append(1, [Record(4, rows, sequence=2**64)]),
        Append(1, [Record(4, rows, clock=2**63)]),
        Append(1, [Record(4, mixed)]),
    ):
        with pytest.raises(NotCommittedError, match="nothing was written"):
            storage.commit([change])
    append(storage, 4, 5)
    same(storage.read(1).records, records(1, 5))


@pytest.mark.parametrize("name", [DATABASE, f"{DATABASE}-wal"])
def test_nothing_is_committed_while_a_file_is_away(storage, folder, name, tmp_path):
    (folder / name).rename(tmp_path / "away")
    with pytest.raises(StorageError, match="put it back"):
        storage.checkpoint()
    with pytest.raises(NotCommittedError, match="moved or deleted under the server"):
        append(storage, 4, 4)
    (tmp_path / "away").rename(folder / name)
    storage.checkpoint()
    append(storage, 4, 5)
    same(storage.read(1).records, records(1, 5))
