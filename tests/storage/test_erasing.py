"""Keys are erased from the past of a hull: all of it at once, in every file, and nothing else is lost."""

import gc
import itertools
import shutil
import sqlite3
from collections import Counter
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from filed_fleet import KEYS, SECOND, Fleet, read_back
from folders import no_progress, same, state

from dynhull.keys import PackedKeys, take_keys
from dynhull_server.state.contents import replayed
from dynhull_server.state.records import FOREVER, NO_TIME, Append, HeldChange, HeldRows, Kept, KeyRows, Record
from dynhull_server.storage.past import EraseRequest
from dynhull_server.storage.port import DamagedError
from dynhull_server.storage.rows.group import Wipe
from dynhull_server.storage.segments.archive import Archive
from dynhull_server.storage.sqlite import copies
from dynhull_server.storage.sqlite.storage import SQLiteStorage

GONE = [KEYS[0], KEYS[3]]
NONE = PackedKeys.pack([])


@pytest.fixture
def fleet(tmp_path):
    fleet = Fleet(tmp_path).fill()
    yield fleet
    fleet.storage.close()


def leave(fleet):
    """The keys leave the hull; then the journal has nothing that is older. Returns the revision."""
    revision = len(fleet.records) + 1
    held = HeldRows(
        PackedKeys.pack(GONE[:1]),
        np.ones((1, 2)),
        *(np.array([each]) for each in (NO_TIME, FOREVER)),
        np.array([1.5]),
        np.array([np.nan]),
        np.array([revision]),
        np.array([0]),
        np.array([np.nan]),
    )
    dropped = KeyRows(NONE, np.empty((0, 2)), PackedKeys.pack(GONE), held=HeldChange(held, NONE))
    last = KeyRows(
        NONE,
        np.empty((0, 2)),
        NONE,
        held=HeldChange(
            replace(held, **{name: getattr(held, name)[:0] for name in HeldRows.__slots__}), PackedKeys.pack(GONE[:1])
        ),
    )
    records = [Record(revision, dropped, cause="batch"), Record(revision + 1, last, cause="quarantine")]
    fleet.time += SECOND
    stamp = fleet.storage.commit([Append(1, records)], fleet.time)
    fleet.records += [replace(each, committed=stamp) for each in records]
    contents = replayed(Kept(records=fleet.records), fleet.settings).stored()
    for _ in range(2):
        fleet.carry_out(fleet.storage.snapshot(1, Kept(revision + 1, contents)))
    return revision + 1


def erase(fleet, until):
    fleet.carry_out(fleet.storage.erase(1, [EraseRequest(PackedKeys.pack(GONE))], until, fleet.time))


def without(records, until):
    """The batches as they are once the keys are erased from them."""
    left = []
    for record in records:
        rows = record.rows
        if record.revision <= until:
            stay = np.array([key not in GONE for key in rows.keys], bool)
            rows = KeyRows(take_keys(rows.keys, np.flatnonzero(stay)), rows.points[stay], NONE, held=rows.held)
            if rows.held is not None:
                held = {name: getattr(rows.held.rows, name)[:0] for name in HeldRows.__slots__}
                rows = replace(rows, held=HeldChange(HeldRows(**held), NONE))
        left.append(replace(record, rows=rows))
    return left


def holds(folder, key):
    """The files of a folder that have a key, however they are compressed: those are read, too."""
    import pyarrow.parquet as pq

    return [each for each in folder.rglob("*.parquet*") if key in pq.read_table(each).column("key").to_pylist()]


def test_a_key_is_in_no_file_and_in_no_revision_any_more(fleet):
    until = leave(fleet)
    assert len(holds(fleet.archive.path, GONE[0])) > 4
    before = fleet.files
    erase(fleet, until)
    fleet.put(4)  # a key that comes back is a new one
    for _ in range(2):
        fleet.snapshot()
    fleet.file()
    expected = without(fleet.records, until)
    for _ in range(2):
        found = read_back(fleet.storage, len(expected))
        same(found, expected)
        assert [each.committed for each in found] == [each.committed for each in expected]
        for revision in range(0, len(expected), 3):
            kept = state(fleet.storage, 1, revision)
            wanted = replayed(Kept(records=expected[: kept.revision]), fleet.settings).stored()
            same(kept.contents, wanted if kept.revision else kept.contents)
        (erasure,) = fleet.storage.erasures(1)
        assert (erasure.first, erasure.last, erasure.time, erasure.keys) == (1, until, fleet.time - 4 * SECOND, 2)
        assert (
            erasure.moves
            == sum(
                key in GONE
                for each in fleet.records[:until]
                for keys in (each.rows.keys, each.rows.removes)
                for key in keys
            )
            + 2
        )
        assert fleet.storage.history(1).erasures == (erasure,)
        fleet.storage.close()
        fleet.storage = fleet.make()
        assert fleet.storage.open(no_progress).notes == []
    kept_on = [each for each in fleet.files if each in before]
    assert all(not holds(fleet.archive.path / each, GONE[0]) for each in kept_on)
    later = [file.name for key in GONE for file in holds(fleet.archive.path, key)]
    assert all(int(name.split("-")[1]) > until for name in later)
    assert copies.check(fleet.folder / "data", no_progress, fleet.archive.path).notes == []


def test_what_does_not_have_the_key_stays_as_it_is(fleet):
    until = leave(fleet)
    before = fleet.files
    fleet.carry_out(fleet.storage.erase(1, [EraseRequest(PackedKeys.pack(["somebody else"]))], until, fleet.time))
    assert set(before) <= set(fleet.files)
    assert fleet.storage.erasures(1) == ()
    erase(fleet, until)
    once = fleet.files
    erase(fleet, until)
    assert fleet.files == once
    assert len(fleet.storage.erasures(1)) == 1


def test_a_kill_at_any_point_leaves_the_past_as_it_was_or_without_the_key(tmp_path):
    fleet = Fleet(tmp_path).fill(2)
    until = leave(fleet)
    fleet.file()
    taken = []

    def look():
        copy = tmp_path / f"copy {len(taken)}"
        for part in ("data", "history"):
            shutil.copytree(tmp_path / part, copy / part)
        taken.append(copy)

    write, remove = fleet.archive.write, fleet.archive.remove

    def watched(function):
        def looking(*arguments):
            look()
            return function(*arguments)

        return looking

    fleet.archive.write, fleet.archive.remove = watched(write), watched(remove)
    requests = [EraseRequest(PackedKeys.pack(keys)) for keys in (GONE[:1], ["nobody"], GONE)]
    for step in fleet.storage.erase(1, requests, until, fleet.time):
        look()
        fleet.storage.commit([step], fleet.time)
    look()
    first, nobody, second = (each.erased for each in requests)
    assert nobody is None
    assert (first.keys, second.keys) == (1, 2)
    assert fleet.storage.erasures(1) == (first, second)
    moves = Counter(key for each in fleet.records for keys in (each.rows.keys, each.rows.removes) for key in keys)
    held = 2  # the first of them was put into quarantine, and has left it
    assert [first.moves, second.moves] == [moves[GONE[0]] + held, moves[GONE[1]]]
    fleet.storage.close()
    outcomes = []
    for copy in taken:
        left = Archive(copy / "history")
        storage = SQLiteStorage(copy / "data", archive=left)
        storage.open(no_progress)
        erased = len(storage.erasures(1))
        outcomes.append(erased)
        same(read_back(storage, until), without(fleet.records, until) if erased else fleet.records)
        for step in storage.file_history(fleet.time):
            storage.commit([step], fleet.time)
        facts = [segment.facts for segment in storage._ledger.hulls[1].segments]
        assert len(list(left.path.rglob("*.parquet*"))) == len(facts) + sum(each.state_bytes > 0 for each in facts)
        assert bool(erased) == (not holds(left.path, GONE[0]))
        storage.close()
        assert copies.check(copy / "data", no_progress, left.path).notes == []
    assert outcomes == sorted(outcomes)
    assert {0, 2} == set(outcomes)


def test_a_commit_that_is_found_after_all_keeps_its_files(fleet):
    """The outcome of the commit that replaces the files is unknown at first, and whoever erases has given up."""
    until = leave(fleet)
    steps = fleet.storage.erase(1, [EraseRequest(PackedKeys.pack(GONE))], until, fleet.time)
    for step in steps:
        fleet.storage.commit([step], fleet.time)
        if type(step).__name__ == "EraseKeys":
            break
    steps.close()
    del steps
    gc.collect()
    fleet.file()
    same(read_back(fleet.storage, until), without(fleet.records, until))
    fleet.storage.close()
    fleet.storage = fleet.make()
    assert fleet.storage.open(no_progress).notes == []
    same(read_back(fleet.storage, until), without(fleet.records, until))


def test_who_reads_meanwhile_gets_the_one_or_the_other(fleet, monkeypatch):
    """The files are replaced between a look at the rows and the read of the file that they name."""
    until = leave(fleet)
    fleet.file()
    read = fleet.archive.read

    def erased_first(*file):
        monkeypatch.setattr(fleet.archive, "read", read)
        erase(fleet, until)
        return read(*file)

    monkeypatch.setattr(fleet.archive, "read", erased_first)
    same(read_back(fleet.storage, until), without(fleet.records, until))
    (fleet.archive.path / fleet.files[0]).unlink()
    fleet.storage.close()
    fleet.storage = fleet.make()
    fleet.storage.open(no_progress)
    with pytest.raises(DamagedError, match="missing"):
        read_back(fleet.storage, until)


def test_an_erasure_is_forgotten_with_what_it_was_about(fleet):
    until = leave(fleet)
    erase(fleet, until)
    copy = fleet.folder / "backup"
    list(copies.copy_all([(fleet.folder / "data", copy)], no_progress, history=fleet.archive.path))
    backup = SQLiteStorage(copy, archive=Archive(copy / "history"))
    backup.open(no_progress)
    assert backup.erasures(1) == fleet.storage.erasures(1)
    same(read_back(backup, until), without(fleet.records, until))
    backup.close()
    fleet.put(4)
    fleet.snapshot()
    fleet.snapshot()
    fleet.storage.commit([fleet.storage.set_history(1, 1, 0)])
    fleet.time += SECOND
    fleet.file()
    fleet.file()
    assert fleet.storage.erasures(1) == ()
    fleet.storage.close()
    fleet.storage = fleet.make()
    assert fleet.storage.open(no_progress).notes == []


def test_erasures_one_after_the_other_leave_few_files_and_no_state_for_each(tmp_path):
    """Each ends a segment after a batch or two. A kill at any point of the last leaves all that was there."""
    names = [f"unit {each}" for each in range(400)]
    gone = PackedKeys.pack(names[:20])
    fleet = Fleet(tmp_path)

    def commit(record):
        fleet.time += SECOND
        stamp = fleet.storage.commit([Append(1, [record])], fleet.time)
        fleet.records.append(replace(record, committed=stamp))

    def snapshots():
        contents = replayed(Kept(records=fleet.records), fleet.settings).stored()
        for _ in range(2):
            fleet.carry_out(fleet.storage.snapshot(1, Kept(len(fleet.records), contents)))

    commit(Record(1, KeyRows(PackedKeys.pack(names), np.arange(800.0).reshape(-1, 2), NONE), cause="batch"))
    for place in range(len(gone)):
        point = np.full((1, 2), float(place))
        key = take_keys(gone, np.array([place]))
        commit(Record(len(fleet.records) + 1, KeyRows(PackedKeys.pack(names[-1:]), point, key), cause="batch"))
        snapshots()
        steps = fleet.storage.erase(1, [EraseRequest(key)], len(fleet.records), fleet.time)
        for number, step in enumerate(steps):
            if place == len(gone) - 1:
                for part in ("data", "history"):
                    shutil.copytree(tmp_path / part, tmp_path / f"copy {number}" / part)
            fleet.storage.commit([step], fleet.time)

    def expected(left_out):
        for record in fleet.records:
            stay = np.flatnonzero([key not in left_out for key in record.rows.keys])
            removed = [key for key in record.rows.removes if key not in left_out]
            keys = take_keys(record.rows.keys, stay)
            yield replace(record, rows=KeyRows(keys, record.rows.points[stay], PackedKeys.pack(removed)))

    def require(storage, left_out):
        wanted = list(expected(left_out))
        same(read_back(storage, len(wanted)), wanted)
        for revision in (1, 2, 11, len(wanted)):
            kept = state(storage, 1, revision)
            if kept.revision:
                same(kept.contents, replayed(Kept(records=wanted[: kept.revision]), fleet.settings).stored())

    segments = fleet.storage._ledger.hulls[1].segments
    assert len(segments) <= 6
    assert sum(each.facts.state_bytes > 0 for each in segments) <= 1
    require(fleet.storage, set(names[:20]))
    assert len(fleet.storage.erasures(1)) == 20
    fleet.storage.close()
    assert copies.check(tmp_path / "data", no_progress, fleet.archive.path).notes == []
    copied = sorted(tmp_path.glob("copy *"))
    assert len(copied) > 5
    for copy in copied:
        storage = SQLiteStorage(copy / "data", archive=Archive(copy / "history"))
        storage.open(no_progress)
        require(storage, set(names[: len(storage.erasures(1))]))
        assert 19 <= len(storage.erasures(1)) <= 20
        storage.close()
        assert copies.check(copy / "data", no_progress, copy / "history").notes == []


def traces(fleet):
    """The files of the database that have a key, in whatever part of them, and segments."""
    data = [
        each for each in (fleet.folder / "data").iterdir() if any(key.encode() in each.read_bytes() for key in GONE)
    ]
    return sorted(each.name for each in (*data, *(file for key in GONE for file in holds(fleet.archive.path, key))))


def test_no_file_has_a_trace_of_it(fleet):
    """Neither pages of the database that are free nor its log, as long as nobody else reads that."""
    fleet.carry_out(itertools.islice(fleet.storage.snapshot(1, at_first(fleet)), 1))  # nobody ends it
    until = leave(fleet)
    assert len(traces(fleet)) > 4
    with closing(sqlite3.connect(fleet.folder / "data" / "dynhull.db")) as other:
        other.execute("BEGIN")
        other.execute("SELECT count(*) FROM batches").fetchone()
        erase(fleet, until)
        assert traces(fleet) == ["dynhull.db-wal"]
        fleet.file()
        assert traces(fleet) == ["dynhull.db-wal"]
    fleet.file()
    assert traces(fleet) == []
    fleet.put(1)
    fleet.storage.close()
    assert traces(fleet) == ["dynhull.db"]  # it has come back
    assert copies.check(fleet.folder / "data", no_progress, fleet.archive.path).notes == []


def at_first(fleet):
    return Kept(2, replayed(Kept(records=fleet.records[:2]), fleet.settings).stored())


def killed(fleet):
    """The storage is that of a server which has started after a kill."""
    copy = fleet.folder / "copy"
    for part in ("data", "history"):
        shutil.copytree(fleet.folder / part, copy / part)
    fleet.storage.close()
    fleet.folder = copy
    fleet.archive = Archive(copy / "history")
    fleet.storage = SQLiteStorage(copy / "data", archive=fleet.archive)
    fleet.storage.open(no_progress)


@pytest.mark.parametrize("erased", [False, True])
def test_a_start_after_a_kill_writes_over_nothing_where_nobody_erases(tmp_path, erased):
    fleet = Fleet(tmp_path).fill(2)
    if erased:
        erase(fleet, leave(fleet))
    killed(fleet)
    wipes = 0
    for step in fleet.storage.file_history(fleet.time):
        wipes += isinstance(step, Wipe)
        fleet.storage.commit([step], fleet.time)
    assert wipes == erased
    fleet.storage.close()


def test_a_kill_before_the_log_has_ended_leaves_no_trace_after_the_next_start(tmp_path):
    fleet = Fleet(tmp_path).fill(2)
    until = leave(fleet)
    for step in fleet.storage.erase(1, [EraseRequest(PackedKeys.pack(GONE))], until, fleet.time):
        if isinstance(step, Wipe):
            break
        fleet.storage.commit([step], fleet.time)
    assert traces(fleet) == ["dynhull.db-wal"]
    killed(fleet)
    fleet.file()
    assert traces(fleet) == []
    same(read_back(fleet.storage, until), without(fleet.records, until))
    fleet.storage.close()
