"""The journal by itself: what comes back after a restart, and what damage does."""

import random
import sqlite3
import threading

import numpy as np
import pytest

from dynhull_server.storage.sqlite.copies import back_up
from dynhull_server.storage.sqlite.errors import (
    JournalDamagedError,
    JournalError,
    JournalFormatError,
    JournalLockedError,
)
from dynhull_server.storage.sqlite.folder import DATABASE
from dynhull_server.storage.sqlite.journal import Durability, Journal
from dynhull_server.storage.sqlite.records import Record
from dynhull_server.storage.sqlite.snapshots import CHUNK_POINTS

NOTHING = np.empty((0, 2))


def points(n, seed=0):
    return np.random.default_rng(seed).random((n, 2))


def record(revision, n=3, deletes=NOTHING, **fields):
    return Record(revision, points(n, revision), deletes, **fields)


def same(recovered, records):
    assert [r.revision for r in recovered] == [r.revision for r in records]
    for one, other in zip(recovered, records, strict=True):
        np.testing.assert_array_equal(one.inserts, other.inserts)
        np.testing.assert_array_equal(one.deletes, other.deletes)
        assert (one.producer, one.sequence, one.lenient) == (other.producer, other.sequence, other.lenient)


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data"


@pytest.fixture
def journal(folder):
    journal = Journal(folder)
    yield journal
    journal.close()


def reopened(journal, folder, **options):
    journal.close()
    return Journal(folder, **options)


def create(journal, name="fleet"):
    row = journal.new_row(name, 12.5, b"config")
    journal.create(row).result()
    return row.number


@pytest.mark.parametrize("durability", Durability)
def test_what_was_committed_comes_back(folder, durability):
    journal = Journal(folder, durability)
    number = create(journal)
    records = [
        record(1, producer="truck é", sequence=7),
        Record(2, NOTHING, points(1, 1)),
        Record(3, NOTHING, NOTHING),
        record(4, n=20_000, deletes=np.array([[-0.5, 1e308], [5e-324, 0.0]]), lenient=True),
    ]
    journal.append(number, records[:2]).result()
    journal.append(number, records[2:]).result()
    other = create(journal, "other")
    journal.close()
    journal = Journal(folder, durability)
    assert [(hull.number, hull.name, hull.created, hull.config) for hull in journal.hulls()] == [
        (number, "fleet", 12.5, b"config"),
        (other, "other", 12.5, b"config"),
    ]
    recovered = journal.recover(number)
    assert (recovered.revision, len(recovered.points), recovered.state) == (0, 0, b"")
    same(recovered.records, records)
    assert journal.recover(other).records == []
    assert journal.notes == []
    assert journal.size() > 20_000 * 16
    journal.close()


def test_a_snapshot_stands_for_the_batches_before_it(journal, folder):
    number = create(journal)
    at = {}
    for revision in range(1, 41):
        journal.append(number, [record(revision)]).result()
        if revision % 10 == 0:
            at[revision] = points(2 * CHUNK_POINTS + 5, revision)
            journal.snapshot(number, revision, at[revision], f"state {revision}".encode())
    journal.append(number, [record(41)]).result()
    journal = reopened(journal, folder)
    recovered = journal.recover(number)
    assert (recovered.revision, recovered.state) == (40, b"state 40")
    np.testing.assert_array_equal(recovered.points, at[40])
    same(recovered.records, [record(41)])
    assert journal.oldest(number) == 30
    recovered = journal.recover(number, until=33)
    np.testing.assert_array_equal(recovered.points, at[30])
    same(recovered.records, [record(31), record(32), record(33)])
    with sqlite3.connect(folder / DATABASE) as database:
        assert database.execute("SELECT revision FROM snapshots ORDER BY revision").fetchall() == [(30,), (40,)]
        assert database.execute("SELECT min(first) FROM batches").fetchone() == (31,)
        assert database.execute("SELECT count(*) FROM chunks").fetchone() == (6,)
    journal.close()


def test_an_empty_hull_has_a_snapshot_too(journal):
    number = create(journal)
    journal.append(number, [record(1)]).result()
    journal.snapshot(number, 1, NOTHING, b"")
    recovered = journal.recover(number)
    assert (recovered.revision, recovered.points.shape, recovered.records) == (1, (0, 2), [])


def test_a_deleted_hull_is_gone(journal, folder):
    number, kept = create(journal), create(journal, "kept")
    journal.append(number, [record(1)]).result()
    journal.append(kept, [record(1)]).result()
    journal.snapshot(number, 1, points(3), b"")
    journal.delete(number).result()
    journal.snapshot(number, 1, points(3), b"")  # was under way
    journal.snapshot(kept, 1, points(3), b"")
    assert [hull.name for hull in journal.hulls()] == ["kept"]
    with sqlite3.connect(folder / DATABASE) as database:
        assert database.execute("SELECT count(*) FROM snapshots").fetchone() == (1,)
        assert database.execute("SELECT count(*) FROM chunks").fetchone() == (1,)
    assert create(journal, "fleet") != number


def test_many_writers_share_commits(journal, folder):
    numbers = [create(journal, f"hull {i}") for i in range(8)]

    def write(number):
        for revision in range(1, 101):
            journal.append(number, [record(revision)]).result()

    threads = [threading.Thread(target=write, args=(number,)) for number in numbers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    journal = reopened(journal, folder)
    for number in numbers:
        same(journal.recover(number).records, [record(revision) for revision in range(1, 101)])
    journal.close()


def test_one_server_at_a_time(journal, folder):
    with pytest.raises(JournalLockedError, match=r"another server works on .*: stop it first"):
        Journal(folder)
    reopened(journal, folder).close()


def test_a_newer_format_is_refused(journal, folder):
    journal.close()
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute("PRAGMA user_version = 99")
    with pytest.raises(JournalFormatError, match=r"has format 99, .* run the newer version"):
        Journal(folder)


def test_another_programs_database_is_refused(folder):
    folder.mkdir()
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute("CREATE TABLE theirs (x)")
    with pytest.raises(JournalFormatError, match="another program"):
        Journal(folder)
    (folder / DATABASE).write_bytes(b"not a database at all" * 100)
    with pytest.raises(JournalFormatError, match="no readable database"):
        Journal(folder)


def flip_a_byte(path, needle):
    """Damage the file where it holds some bytes that were written."""
    data = bytearray(path.read_bytes())
    position = data.index(needle) + random.Random(0).randrange(len(needle))
    data[position] ^= 0x40
    path.write_bytes(data)


def written(journal, count):
    number = create(journal)
    for revision in range(1, count + 1):
        journal.append(number, [record(revision)]).result()
    journal.close()
    return number


@pytest.mark.parametrize("damaged", [1, 5])
def test_damage_in_the_middle_is_refused(journal, folder, damaged):
    number = written(journal, 9)
    flip_a_byte(folder / DATABASE, record(damaged).inserts.tobytes())
    journal = Journal(folder)
    with pytest.raises(JournalDamagedError, match=f"revisions {damaged} to {damaged} .* damaged.*restore a backup"):
        journal.recover(number)
    journal.close()


def test_a_missing_batch_in_the_middle_is_refused(journal, folder):
    number = written(journal, 9)
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute("DELETE FROM batches WHERE first IN (4, 5)")
    journal = Journal(folder)
    with pytest.raises(JournalDamagedError, match=r"revisions 4 to 5 .* are missing"):
        journal.recover(number)
    journal.close()


def test_a_damaged_end_is_cut_at_the_last_whole_batch(journal, folder):
    number = written(journal, 9)
    flip_a_byte(folder / DATABASE, record(9).inserts.tobytes())
    journal = Journal(folder)
    recovered = journal.recover(number)
    same(recovered.records, [record(revision) for revision in range(1, 9)])
    assert journal.notes == [
        f"revisions 9 to 9 of hull {number} are damaged: cut off at revision 8, the last whole batch"
    ]
    journal.append(number, [record(9)]).result()
    journal = reopened(journal, folder)
    same(journal.recover(number).records, [record(revision) for revision in range(1, 10)])
    assert journal.notes == []
    journal.close()


def test_a_damaged_snapshot_gives_way_to_the_one_before(journal, folder):
    number = create(journal)
    for revision in range(1, 31):
        journal.append(number, [record(revision)]).result()
        if revision % 10 == 0:
            journal.snapshot(number, revision, points(100, revision), b"")
    journal.close()
    flip_a_byte(folder / DATABASE, points(100, 30).tobytes())
    journal = Journal(folder)
    recovered = journal.recover(number)
    assert recovered.revision == 20
    same(recovered.records, [record(revision) for revision in range(21, 31)])
    assert journal.notes == [f"the snapshot of hull {number} at revision 30 is damaged: using the one before"]
    journal.close()


def crashed(folder, tmp_path):
    """The folder as a killed process leaves it: the log not yet in the database."""
    copy = tmp_path / "crashed"
    copy.mkdir()
    for file in folder.glob(f"{DATABASE}*"):
        (copy / file.name).write_bytes(file.read_bytes())
    return copy


def test_a_log_cut_short_loses_the_last_commit_only(journal, folder, tmp_path):
    number = create(journal)
    for revision in range(1, 10):
        journal.append(number, [record(revision)]).result()
    copy = crashed(folder, tmp_path)
    log = copy / f"{DATABASE}-wal"
    log.write_bytes(log.read_bytes()[:-100])
    survivor = Journal(copy)
    same(survivor.recover(number).records, [record(revision) for revision in range(1, 9)])
    assert len(survivor.notes) == 1
    assert "incomplete or damaged" in survivor.notes[0]
    survivor.close()


def test_damage_in_the_middle_of_the_log_is_refused(journal, folder, tmp_path):
    number = create(journal)
    for revision in range(1, 10):
        journal.append(number, [record(revision)]).result()
    copy = crashed(folder, tmp_path)
    flip_a_byte(copy / f"{DATABASE}-wal", record(4).inserts.tobytes())
    with pytest.raises(JournalDamagedError, match=r"frame .* is damaged, and whole commits follow it"):
        Journal(copy)


def test_a_backup_is_a_folder_like_any_other(journal, folder, tmp_path):
    number = create(journal)
    journal.append(number, [record(1)]).result()
    back_up(folder, tmp_path / "backup", lambda *_: None)
    journal.append(number, [record(2)]).result()
    backup = Journal(tmp_path / "backup")
    same(backup.recover(number).records, [record(1)])
    backup.close()


def test_a_closed_journal_takes_nothing(journal):
    number = create(journal)
    journal.close()
    with pytest.raises(JournalError, match="closed"):
        journal.append(number, [record(1)])
