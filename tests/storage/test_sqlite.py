"""The SQLite folder: who may open it, and what damage does."""

import shutil
import sqlite3
from contextlib import closing
from itertools import product

import numpy as np
import pytest
from cases import slow
from folders import (
    DATABASE,
    LOG,
    append,
    events,
    fence_row,
    fill,
    fill_fence,
    flip,
    killed,
    opened,
    read_fence,
    record,
    records,
    same,
    snapshot,
    stopped,
)

from dynhull.keys import PackedKeys
from dynhull_server.state.contents import replayed
from dynhull_server.state.fences.events.block import AppendEvents, block_of
from dynhull_server.state.fences.model.records import AddFence, DropEvents, DropFence, Inside, Members
from dynhull_server.state.fences.recovery.restored import members_after
from dynhull_server.state.records import Append, Contents, Create, Delete, HullRow, HullSettings, Kept, Window
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.port import DamagedError, FormatError, LockedError, StorageError
from dynhull_server.storage.sqlite.log import FRAME_HEADER_BYTES, HEADER_BYTES
from dynhull_server.storage.sqlite.schema import PAGE_BYTES, TABLES
from dynhull_server.storage.sqlite.storage import SQLiteStorage

FRAME_BYTES = FRAME_HEADER_BYTES + PAGE_BYTES


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data"


def notes(folder):
    """What the next start says."""
    storage, contents = opened(folder)
    storage.close()
    return contents.notes


def test_nothing_is_touched_before_it_is_opened(folder):
    SQLiteStorage(folder)
    assert not folder.exists()


def test_one_server_at_a_time(folder):
    storage, _ = opened(folder)
    with pytest.raises(LockedError, match=r"another server or command uses .*: stop it first"):
        opened(folder)
    storage.close()
    opened(folder)[0].close()


def test_a_start_that_is_refused_lets_others_in(folder):
    stopped(folder)
    whole = (folder / DATABASE).read_bytes()
    flip(folder / DATABASE, record(4).rows.inserts.tobytes())
    for _ in range(2):
        with pytest.raises(DamagedError):
            opened(folder)
    (folder / DATABASE).write_bytes(whole)
    opened(folder)[0].close()


def test_a_server_that_was_killed_before_it_made_the_tables(folder):
    folder.mkdir()
    with closing(sqlite3.connect(folder / DATABASE)) as connection:
        connection.execute(f"PRAGMA page_size = {PAGE_BYTES}")
        connection.execute("PRAGMA journal_mode = WAL")
    assert (folder / DATABASE).stat().st_size > 0
    storage, contents = opened(folder)
    assert (contents.notes, contents.hulls) == ([], [])
    fill(storage, 3)
    storage.close()
    assert notes(folder) == []


def test_a_newer_format_is_refused(folder):
    stopped(folder)
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute("PRAGMA user_version = 99")
    with pytest.raises(FormatError, match=r"has format 99, .* run the newer version"):
        opened(folder)


def test_another_programs_database_is_refused(folder):
    folder.mkdir()
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute("CREATE TABLE theirs (x)")
    with pytest.raises(FormatError, match="another program"):
        opened(folder)
    (folder / DATABASE).write_bytes(b"not a database at all" * 100)
    with pytest.raises(DamagedError, match=r"cannot be read as a database .*: restore a backup"):
        opened(folder)


def test_what_a_snapshot_makes_superfluous_is_dropped(folder):
    storage, _ = opened(folder)
    fill(storage, 10)
    for revision in (10, 20, 30):
        snapshot(storage, revision)
        append(storage, revision + 1, revision + 10)
    storage.commit([Delete(1)])
    storage.close()
    storage, _ = opened(folder)  # what a deleted hull left is found again
    for step in storage.sweep():
        storage.commit([step])
    storage.close()
    with sqlite3.connect(folder / DATABASE) as database:
        for table in ("batches", "snapshots", "chunks", "hulls"):
            assert database.execute(f"SELECT count(*) FROM {table}").fetchone() == (0,)


# Damage in the database


@pytest.mark.parametrize("damaged", [1, 5])
def test_damage_in_the_middle_is_refused(folder, damaged):
    stopped(folder)
    flip(folder / DATABASE, record(damaged).rows.inserts.tobytes())
    words = f"hull 'fleet': revisions {damaged} to {damaged} are damaged, and later ones exist: restore a backup"
    with pytest.raises(DamagedError, match=words):
        opened(folder)


@pytest.mark.parametrize("bit", range(8))
def test_a_damaged_schema_is_refused(folder, bit):
    stopped(folder)
    content = bytearray((folder / DATABASE).read_bytes())
    content[content.index(b"CREATE TABLE totals") + 10] ^= 1 << bit
    (folder / DATABASE).write_bytes(content)
    with pytest.raises(StorageError, match=r"restore a backup|cannot be opened"):
        opened(folder)


def test_damaged_settings_are_refused(folder):
    storage, _ = opened(folder)
    settings = HullSettings("int", 7, Window(max_age=25, max_skew=0, clamps=True), by_event_time=True)
    storage.commit([Create(HullRow(1, "fleet", "", 0.0, settings))])
    storage.close()
    whole = (folder / DATABASE).read_bytes()
    first = whole.index(b'{"by_event_time"')
    for byte in range(first, whole.index(b"}}", first) + 2):
        content = bytearray(whole)
        content[byte] ^= 1 << byte % 8
        (folder / DATABASE).write_bytes(content)
        with pytest.raises(DamagedError, match=r"the row of hull 1, .* is damaged|cannot be read"):
            opened(folder)


def points_of(storage, number):
    return replayed(storage.read(number)).hull.points()


@pytest.mark.parametrize("table", TABLES)
def test_a_foreign_value_in_any_column_is_refused_or_repaired_with_a_note(folder, tmp_path, table):
    """Nothing but what the server raises for damage, and nothing lost in silence."""
    storage, _ = opened(folder)
    fill(storage, 3)
    fill(storage, 2, "other", 2)
    for step in storage.snapshot(1, Kept(3, Contents(points_of(storage, 1)))):
        storage.commit([step])
    append(storage, 4, 6)
    fill_fence(storage, 4)
    for step in storage.inside(9, Inside(2, (Members("fleet", PackedKeys.pack(["a"]), 2),))):
        storage.commit([step])
    storage.commit([DropEvents(9, 3)])
    kept, fence = [points_of(storage, number) for number in (1, 2)], read_fence(storage, 9)
    storage.close()
    with closing(sqlite3.connect(folder / DATABASE)) as database:
        columns = [row[1] for row in database.execute(f"PRAGMA table_info({table})")]
    damaged = 0
    for i, (column, value) in enumerate(product(columns, (2**62, "x", b"\0", None))):
        copy = tmp_path / str(i)
        shutil.copytree(folder, copy)
        change = f"UPDATE {table} SET {column} = ? WHERE rowid = (SELECT min(rowid) FROM {table})"
        with closing(sqlite3.connect(copy / DATABASE, isolation_level=None)) as database:
            try:
                database.execute(change, [value])
            except sqlite3.IntegrityError:  # no value for this column
                continue
        try:
            storage, contents = opened(copy)
        except DamagedError:
            damaged += 1
            continue
        damaged += bool(contents.notes)
        if not contents.notes:
            for number, expected in enumerate(kept, start=1):
                np.testing.assert_array_equal(points_of(storage, number), expected)
            assert read_fence(storage, 9) == fence
        storage.close()
    assert damaged >= 2 * len(columns)


@pytest.mark.parametrize("gone", ["first IN (4, 5)", "first = 9", "first = 1"])
def test_missing_batches_are_refused(folder, gone):
    stopped(folder)
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute(f"DELETE FROM batches WHERE {gone}")
    with pytest.raises(DamagedError, match="1 hulls with 9 rows of batches, the tables have 1 with"):
        opened(folder)


def test_a_missing_hull_is_refused(folder):
    stopped(folder)
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute("DELETE FROM hulls")
    with pytest.raises(DamagedError, match="1 hulls with 9 rows of batches, the tables have 0 with 0"):
        opened(folder)


def test_a_damaged_end_is_cut_at_the_last_whole_batch(folder):
    stopped(folder)
    flip(folder / DATABASE, record(9).rows.inserts.tobytes())
    storage, contents = opened(folder)
    assert contents.notes == [
        (
            f"{folder / DATABASE}: hull 'fleet': revisions 9 to 9 are damaged: "
            "the hull was cut back to revision 8, the last intact one"
        )
    ]
    same(storage.read(1).records, records(1, 8))
    append(storage, 9, 9)
    storage.close()
    storage, contents = opened(folder)
    same(storage.read(1).records, records(1, 9))
    assert contents.notes == []
    storage.close()


def test_a_damaged_end_that_a_snapshot_reaches_into_is_cut_at_the_snapshot(folder):
    storage, _ = opened(folder)
    fill(storage, 3)
    storage.commit([Append(1, records(4, 8))])
    snapshot(storage, 6)
    storage.close()
    flip(folder / DATABASE, record(8).rows.inserts.tobytes())
    storage, contents = opened(folder)
    assert "revisions 4 to 8 are damaged: the hull was cut back to revision 6" in contents.notes[0]
    assert storage.read(1).last_revision == 6
    append(storage, 7, 9)
    same(storage.read(1).records, records(7, 9))
    storage.close()
    storage, _ = opened(folder)
    same(storage.read(1).records, records(7, 9))
    storage.close()


def test_a_damaged_snapshot_gives_way_to_the_one_before(folder):
    storage, _ = opened(folder)
    fill(storage, 10)
    for revision in (10, 20, 30):
        snapshot(storage, revision)
        append(storage, revision + 1, revision + 10)
    newest = storage.read(1, 30).contents.points
    storage.close()
    flip(folder / DATABASE, newest.tobytes())
    storage, contents = opened(folder)
    assert contents.notes == [
        f"{folder / DATABASE}: hull 'fleet': the snapshot at revision 30 is damaged, and was dropped"
    ]
    assert storage.read(1).revision == 20
    same(storage.read(1).records, records(21, 40))
    assert storage.oldest(1) == 20
    snapshot(storage, 40)
    assert (storage.oldest(1), storage.read(1).revision) == (20, 40)
    storage.close()
    assert notes(folder) == []


def test_one_damaged_copy_of_the_totals_is_mended(folder):
    stopped(folder)
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute("UPDATE totals SET sum = sum + 1 WHERE id = 2")
    storage, contents = opened(folder)
    assert len(contents.notes) == 1
    assert "one of the two copies" in contents.notes[0]
    same(storage.read(1).records, records(1, 9))
    storage.close()
    assert notes(folder) == []


# Damage in the log


@pytest.fixture
def crash(folder, tmp_path):
    """A killed server's folder, with nine batches in its log."""
    storage, _ = opened(folder)
    fill(storage, 9)
    crash = killed(folder, tmp_path / "crash")
    storage.close()
    return crash


def test_a_killed_servers_folder_is_whole(crash):
    storage, contents = opened(crash)
    same(storage.read(1).records, records(1, 9))
    assert contents.notes == []
    storage.close()


def test_a_log_cut_short_loses_the_last_commit_only(crash):
    log = crash / LOG
    length = log.read_bytes().rindex(record(9).rows.inserts.tobytes()) + 10
    log.write_bytes(log.read_bytes()[:length])
    storage, contents = opened(crash)
    same(storage.read(1).records, records(1, 8))
    assert len(contents.notes) == 1
    assert "incomplete or damaged and was dropped, with at most 1 of the newest commits" in contents.notes[0]
    storage.close()


def test_damage_in_the_middle_of_the_log_is_refused(crash):
    flip(crash / LOG, record(4).rows.inserts.tobytes())
    with pytest.raises(DamagedError, match=r"frame .* is damaged, and intact commits follow it: restore a backup"):
        opened(crash)


@pytest.mark.parametrize("byte", range(HEADER_BYTES))
def test_a_damaged_header_of_the_log_is_refused(crash, byte):
    content = bytearray((crash / LOG).read_bytes())
    content[byte] ^= 1
    (crash / LOG).write_bytes(content)
    with pytest.raises(DamagedError, match=r"the header of .* is damaged"):
        opened(crash)


@pytest.mark.parametrize("byte", range(8, 16))
def test_a_damaged_salt_is_refused(crash, byte):
    content = bytearray((crash / LOG).read_bytes())
    content[HEADER_BYTES + FRAME_BYTES + byte] ^= 1
    (crash / LOG).write_bytes(content)
    with pytest.raises(DamagedError, match=r"frame 2 is damaged, and intact commits follow it"):
        opened(crash)


@pytest.mark.parametrize("left", [None, 0, HEADER_BYTES])
def test_a_missing_log_is_refused(crash, left):
    log = crash / LOG
    content = log.read_bytes()
    log.unlink()
    if left is not None:
        log.write_bytes(content[:left])
    with pytest.raises(DamagedError, match="is missing or cut short"):
        opened(crash)


def test_a_log_without_its_database_is_refused(crash):
    (crash / DATABASE).write_bytes(b"")
    with pytest.raises(DamagedError, match="is missing or empty, but its log exists"):
        opened(crash)
    assert (crash / LOG).exists()


def test_a_log_older_than_its_database_is_refused(folder, tmp_path):
    """Each is whole, and what they make together is, too: the hull as it was before revisions that are acknowledged."""
    storage, _ = opened(folder)
    fill(storage, 5)
    earlier = killed(folder, tmp_path / "earlier")
    append(storage, 6, 9)
    storage.close()
    shutil.copyfile(earlier / LOG, folder / LOG)
    with pytest.raises(DamagedError, match="do not belong together"):
        opened(folder)


def test_a_log_newer_than_its_database_is_refused(folder, tmp_path):
    stopped(folder)
    earlier = (folder / DATABASE).read_bytes()
    storage, _ = opened(folder)
    storage.commit([Append(1, [record(10, n=2000)])])
    storage.close()
    storage, _ = opened(folder)
    append(storage, 11, 12)
    crash = killed(folder, tmp_path / "crash")
    storage.close()
    (crash / DATABASE).write_bytes(earlier)
    with pytest.raises(DamagedError):
        opened(crash)


def test_after_a_power_failure_unsynced_commits_are_dropped_with_a_note(folder, tmp_path):
    storage, _ = opened(folder, Durability.NONE)
    fill(storage, 9)
    crash = killed(folder, tmp_path / "crash")
    storage.close()
    content = (crash / LOG).read_bytes()
    start = HEADER_BYTES + (content.index(record(4).rows.inserts.tobytes()) - HEADER_BYTES) // FRAME_BYTES * FRAME_BYTES
    hole = bytes(FRAME_BYTES)
    (crash / LOG).write_bytes(content[:start] + hole + content[start + FRAME_BYTES :])
    storage, contents = opened(crash)
    kept = storage.read(1)
    same(kept.records, records(1, kept.last_revision))
    storage.close()
    assert kept.last_revision < 9
    assert contents.notes != []


def test_a_write_of_a_header_that_did_not_come_through_is_no_damage(folder):
    stopped(folder)
    (folder / LOG).write_bytes(bytes(HEADER_BYTES + FRAME_BYTES))
    storage, contents = opened(folder)
    same(storage.read(1).records, records(1, 9))
    assert contents.notes == []
    storage.close()


def test_shared_memory_and_lock_hold_nothing(crash):
    (crash / f"{DATABASE}-shm").write_bytes(np.random.default_rng(0).bytes(32768))
    (crash / "dynhull.lock").write_bytes(b"nonsense")
    storage, contents = opened(crash)
    same(storage.read(1).records, records(1, 9))
    assert contents.notes == []
    storage.close()


def test_an_unfinished_copy_is_refused(folder):
    folder.mkdir()
    (folder / "unfinished.db").write_bytes(b"")
    with pytest.raises(StorageError, match="is an unfinished copy: remove it, and copy again"):
        opened(folder)


def test_many_that_are_inside_are_all_inside_after_a_start(folder):
    """They are in several rows."""
    storage, _ = opened(folder)
    fill(storage, 1)
    keys = [f"{number:05}" for number in range(40_000)]
    members = Members("fleet", PackedKeys.pack(keys), 1), Members("others", PackedKeys.pack(keys[:3]), 1)
    storage.commit([AddFence(fence_row(), Inside(0, members))])
    storage.close()
    storage, _ = opened(folder)
    assert members_after(read_fence(storage, 9)) == {"fleet": set(keys), "others": set(keys[:3])}
    storage.close()


@slow
def test_fences_keep_the_order_of_their_events_over_many_commits(folder):
    """Beyond 131,072 runs of events, which are kept together at first. One fence is read earlier, one is deleted."""
    storage, _ = opened(folder)
    fill(storage, 1)
    numbers = range(10, 710)
    storage.commit([AddFence(fence_row(number, f"gate {number}"), Inside()) for number in numbers])
    last = 2**17 // len(numbers) + 3
    for sequence in range(1, last + 1):
        made = events(sequence, sequence)
        storage.commit([AppendEvents(block_of({number: made for number in numbers if number != 13 or sequence < 100}))])
        if sequence == 100:
            assert storage.read_events(11, 0, 1000) == events(1, 100)
            storage.commit([DropFence(13)])
    for _ in range(2):
        for number in (10, 11, 12, 709):
            assert storage.read_events(number, 0, 1000) == events(1, last)
        storage.close()
        storage, _ = opened(folder)
    storage.close()


def test_what_no_fence_needs_of_a_row_of_events_leaves_the_disk(folder):
    storage, _ = opened(folder)
    fill(storage, 1)
    for number in range(10, 20):
        storage.commit([AddFence(fence_row(number, f"gate {number}"), Inside())])
    storage.commit([AppendEvents(block_of({number: events(1, 50) for number in range(10, 20)}))])

    def stored():
        with closing(sqlite3.connect(folder / DATABASE)) as database:
            return database.execute("SELECT count(*), sum(length(payload)) FROM events").fetchone()

    _, size = stored()
    storage.commit([DropFence(number) for number in range(10, 19)])
    for step in storage.sweep():
        storage.commit([step])
    rows, left = stored()
    assert rows == 1
    assert left < size / 5
    assert storage.read_events(19, 0, 100) == events(1, 50)
    storage.commit([DropFence(19)])
    for step in storage.sweep():
        storage.commit([step])
    assert stored() == (0, None)
    storage.close()
