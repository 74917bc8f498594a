"""What the journal drops of hulls with a history becomes segments: whole, once, checked, and no longer than wanted."""

import errno
import json
import os
import shutil
import time
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from cases import slow
from filed_fleet import BEGIN, KEYS, SECOND, SETTINGS, Fleet, move, read_back
from folders import no_progress, same, state
from postgresql import query

from dynhull.keys import PackedKeys
from dynhull_cluster.postgres.database import Database
from dynhull_cluster.postgres.storage import PostgresStorage
from dynhull_server.state.contents import replayed
from dynhull_server.state.contents.joining import in_one
from dynhull_server.state.records import (
    FOREVER,
    NO_TIME,
    Append,
    CommitStamp,
    Contents,
    Create,
    Delete,
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
)
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.port import NEWEST, DamagedError, StorageError, TakenOverError
from dynhull_server.storage.rows import filed, filing, past_rows, storage
from dynhull_server.storage.rows.filed import Filed
from dynhull_server.storage.segments import archive, parquet
from dynhull_server.storage.segments.archive import BATCHES, STATE, Archive
from dynhull_server.storage.segments.columns import columns_of, columns_of_state, contents_of, records_of
from dynhull_server.storage.segments.parquet import from_parquet, to_parquet
from dynhull_server.storage.sqlite import copies
from dynhull_server.storage.sqlite.storage import SQLiteStorage

FLIPS = 200


def require_all(storage, records):
    """Every revision of the past is there once, with its commit, and so is each state."""
    assert storage.oldest_moment(1).revision == 0
    found = read_back(storage, len(records))
    same(found, records)
    assert [each.committed for each in found] == [each.committed for each in records]
    for until in range(0, len(records) + 1, 3):
        kept = state(storage, 1, until)
        expected = replayed(Kept(records=records[: kept.revision]), SETTINGS).stored()
        same(kept.contents.points, expected.points if kept.revision else np.empty((0, 2)))
        assert kept.revision <= until
    for record in records[1::2]:
        assert storage.moment(1, record.committed.time).revision == record.revision
        assert storage.moment(1, record.committed.time - 1).revision == record.revision - 2


def require_all_of_keys(storage, records):
    """What the batches do to some keys is what they do to all, without the others; and so is each state."""
    for wanted in (KEYS[:1], KEYS[2:5], ["nobody", "nobody at all"]):
        keys = PackedKeys.pack(wanted)
        for after in (0, 1, len(records) // 2):
            found, at = [], after
            while at < len(records):
                last, changes = storage.key_changes(1, keys, at, len(records))
                assert at < last
                columns = changes.revisions, changes.times, changes.rows, *changes.points.T
                found += zip(*(column.tolist() for column in columns), strict=True)
                at = last
            assert sorted(found) == sorted(
                (each.revision, each.committed.time, wanted.index(key), *point)
                for each in records[after:]
                for key, point in zip(each.rows.keys, each.rows.points.tolist(), strict=True)
                if key in wanted
            )
            assert [revision for revision, *_ in found] == sorted(revision for revision, *_ in found)
            whole = state(storage, 1, after)
            revision, rows, contents = storage.key_state(1, keys, after)
            assert storage.state_revision(1, after) == revision == storage.state(1, after)[0].revision
            expected = dict(zip(whole.contents.keys or (), whole.contents.points.tolist(), strict=True))
            there = {wanted[row]: point for row, point in zip(rows.tolist(), contents.points.tolist(), strict=True)}
            assert revision == whole.revision
            assert there == {key: point for key, point in expected.items() if key in wanted}


@pytest.fixture(params=["folder", pytest.param("postgresql", marks=slow)])
def fleet(request, tmp_path):
    make = None
    archive = Archive(tmp_path / "history")
    if request.param == "postgresql":
        database = Database(request.getfixturevalue("postgres").new_database())
        make = lambda: PostgresStorage(database, pytest.fail, archive=archive)  # noqa: E731
    fleet = Fleet(tmp_path, archive=archive, make=make)
    yield fleet
    fleet.storage.close()


def test_the_past_is_read_from_segments_and_the_journal(fleet):
    fleet.fill()
    assert fleet.storage.oldest(1) > 20  # the journal has forgotten it
    for _ in range(2):
        require_all(fleet.storage, fleet.records)
        require_all_of_keys(fleet.storage, fleet.records)
        fleet.storage.close()
        fleet.storage = fleet.make()
        assert fleet.storage.open(no_progress).notes == []
    history = fleet.storage.history(1)
    assert history.batches == fleet.storage.oldest(1)
    assert history.bytes == sum((fleet.archive.path / each).stat().st_size for each in fleet.files)
    assert history.moves == sum(len(each.rows) for each in fleet.records[: history.batches])


def test_a_segment_has_no_more_than_its_rows_and_those_read_together(tmp_path, monkeypatch):
    monkeypatch.setattr(filing, "MOST_ROWS", 20)
    monkeypatch.setattr(past_rows, "STEP_BYTES", 1)  # one commit, which has at most 8 rows
    fleet = Fleet(tmp_path)
    for _ in range(5):
        fleet.put(20)
        fleet.snapshot()
    fleet.file()
    contents = [(fleet.archive.path / each).read_bytes() for each in fleet.files if each.endswith(BATCHES)]
    rows = [len(from_parquet(content, "a file")[0]) for content in contents]
    assert len(rows) > 6
    assert max(rows) < 20 + 8
    require_all(fleet.storage, fleet.records)
    fleet.storage.close()


@pytest.mark.parametrize("damaged", [False, True])
def test_every_revision_is_there_while_a_segment_ends_between_two_snapshots(tmp_path, monkeypatch, damaged):
    """Also if the snapshot before is damaged: then the journal begins at a later one; segments have what is before."""
    monkeypatch.setattr(filing, "MOST_ROWS", 20)
    monkeypatch.setattr(past_rows, "STEP_BYTES", 1)  # one commit, which has at most 8 rows
    fleet = Fleet(tmp_path).fill(2)
    for _ in range(2):
        fleet.put(8)
        fleet.snapshot()
    steps, between = fleet.storage.file_history(fleet.time), 0
    for step in steps:
        fleet.storage.commit([step], fleet.time)
        rows = fleet.storage._ledger.hulls[1]
        if damaged:
            before = [each for each in rows.snapshots[:-2] if each.revision < rows.filed]
            fleet.storage.commit([storage.DropSnapshot(1, each) for each in before], fleet.time)
        between += rows.filed not in {each.revision for each in rows.snapshots}
        fleet.snapshot()  # which drops what the journal need not have any longer
        require_all(fleet.storage, fleet.records)
        oldest = fleet.storage.oldest(1)
        kept = fleet.storage.read(1, oldest)
        assert kept.last_revision == oldest
        same(replayed(kept, SETTINGS).stored(), replayed(Kept(records=fleet.records[:oldest]), SETTINGS).stored())
    require_all_of_keys(fleet.storage, fleet.records)
    assert between > 1
    fleet.storage.close()


@pytest.mark.parametrize(("rows", "again"), [(filed.KEPT_ROWS, 0), (0, 1)])
def test_segments_that_are_read_in_turn_are_decoded_once_if_they_are_small(tmp_path, monkeypatch, rows, again):
    fleet = Fleet(tmp_path).fill()
    names = []
    monkeypatch.setattr(filed, "KEPT_ROWS", rows)
    monkeypatch.setattr(
        fleet.archive, "read", lambda name, *file: names.append(name) or Archive.read(fleet.archive, name, *file)
    )
    storage = fleet.make_reader()
    firsts = sorted({int(name.split("/")[1].split("-")[0]) for name in fleet.files if name.endswith(BATCHES)})
    assert len(firsts) > filed.KEPT_OPEN
    for _ in range(3):
        for first in firsts:
            assert storage.batches(1, first - 1, first)[0].revision == first
    storage.close()
    assert len(names) == len(firsts) * (1 + 2 * again)


def test_a_deleted_hull_has_no_past_and_a_new_one_of_its_name_none_of_it(fleet):
    fleet.fill()
    fleet.storage.commit([Delete(1), Create(HullRow(2, "fleet", "4567", 12.5, SETTINGS))])
    fleet.file()
    assert fleet.files == []
    assert fleet.storage.history(2).bytes == 0
    assert fleet.storage.oldest_moment(2).revision == 0


@pytest.mark.parametrize("limit", ["history", "history_bytes", "server"])
def test_what_is_too_old_or_too_much_goes_as_a_whole(tmp_path, limit):
    fleet = Fleet(tmp_path).fill()
    size = fleet.storage.history(1).bytes
    if limit == "server":
        fleet.archive.most_bytes = size // 2
    else:
        kept = (10 * SECOND, 0) if limit == "history" else (FOREVER, size // 2)
        fleet.storage.commit([fleet.storage.set_history(1, *kept)])
    fleet.file()
    oldest = fleet.storage.oldest_moment(1)
    assert 0 < oldest.revision < fleet.storage.oldest(1)
    assert oldest.committed == fleet.records[oldest.revision - 1].committed
    if limit != "history":
        assert 0 < fleet.storage.history(1).bytes <= size // 2
    same(read_back(fleet.storage, len(fleet.records)), fleet.records[oldest.revision :])
    with pytest.raises(DamagedError, match="no longer kept"):
        fleet.storage.state(1, oldest.revision - 1)
    fleet.storage.commit([fleet.storage.set_history(1, 0, 0)])
    fleet.file()
    assert fleet.files == []
    fleet.storage.close()


@pytest.mark.parametrize("together", [False, True])
def test_what_is_to_be_kept_again_stays_although_its_removal_has_begun(fleet, together):
    """The settings change between two steps, or while a step waits for its commit."""
    fleet.fill()
    fleet.storage.commit([fleet.storage.set_history(1, 0, 0)])
    steps = fleet.storage.file_history(fleet.time)
    longer = fleet.storage.set_history(1, FOREVER, 0)
    fleet.storage.commit([next(steps)], fleet.time)  # it removes the first one
    first = fleet.storage.oldest_moment(1).revision
    assert first > 0
    if together:
        fleet.storage.commit([longer, next(steps)], fleet.time)
    else:
        fleet.storage.commit([longer], fleet.time)
    fleet.carry_out(steps)
    fleet.file()
    assert fleet.storage.oldest_moment(1).revision == first
    same(read_back(fleet.storage, len(fleet.records)), fleet.records[first:])


def test_nothing_goes_to_make_room_that_a_deleted_hull_has_left(tmp_path):
    fleet = Fleet(tmp_path)
    fleet.storage.commit([Create(HullRow(2, "other", "9876", 12.5, fleet.settings))], fleet.time)
    for last in (0, 2, 4):
        fleet.put(4)
        fleet.snapshot()
        fleet.storage.commit([Append(2, [move(last + 1), move(last + 2)])], fleet.time)
        fleet.carry_out(fleet.storage.snapshot(2, Kept(last + 2, Contents(np.empty((0, 2)), PackedKeys.pack([])))))
    fleet.fill()
    fleet.archive.most_bytes = fleet.storage.history(1).bytes
    steps = fleet.storage.file_history(fleet.time)
    next(steps)  # something of one of them is to go
    fleet.storage.commit([Delete(2)], fleet.time)
    fleet.carry_out(steps)
    same(read_back(fleet.storage, len(fleet.records)), fleet.records)
    fleet.storage.close()


class Watched(Archive):
    """An archive that calls a function before and after each thing that it does."""

    look = staticmethod(lambda: None)

    def write(self, file, content):
        self.look()
        self.path.joinpath(file).parent.mkdir(parents=True, exist_ok=True)
        part = self.path / (file + ".part")
        part.write_bytes(content[: len(content) // 2])  # as a kill in the middle leaves it
        self.look()
        part.unlink()
        written = super().write(file, content)
        self.look()
        return written

    def remove(self, file):
        self.look()
        super().remove(file)
        self.look()


def test_a_kill_at_any_point_leaves_each_batch_in_one_of_the_two(tmp_path):
    """The folder as it is before and after each commit and each file is what a killed server leaves."""
    archive = Watched(tmp_path / "history")
    fleet = Fleet(tmp_path, archive=archive)
    taken = []

    def look():
        copy = tmp_path / f"copy {len(taken)}"
        for part in ("data", "history"):
            if (tmp_path / part).exists():
                shutil.copytree(tmp_path / part, copy / part)
        taken.append((copy, list(fleet.records)))

    def carry_out(steps):
        for step in steps:
            look()
            fleet.storage.commit([step], fleet.time)
            look()

    fleet.fill(2)
    fleet.put(4)
    fleet.snapshot()
    archive.look, fleet.carry_out = look, carry_out
    fleet.file()
    fleet.storage.commit([fleet.storage.set_history(1, 2 * SECOND, 0)])
    fleet.file()
    fleet.storage.close()
    assert len(taken) > 20
    for copy, records in taken:
        left = Archive(copy / "history")
        storage = SQLiteStorage(copy / "data", archive=left)
        storage.open(no_progress)
        oldest = storage.oldest_moment(1).revision
        same(read_back(storage, len(records)), records[oldest:])
        for step in storage.file_history(fleet.time):
            storage.commit([step], fleet.time)
        oldest = storage.oldest_moment(1).revision
        same(read_back(storage, len(records)), records[oldest:])
        facts = [segment.facts for segment in storage._ledger.hulls[1].segments]
        names = len(facts) + sum(each.state_bytes > 0 for each in facts)
        assert len(list(left.path.rglob("*.parquet*"))) == names  # nothing is left of what was begun
        storage.close()
        assert copies.check(copy / "data", no_progress, left.path).notes == []


def test_while_the_disk_is_full_the_journal_keeps_what_is_due(tmp_path, monkeypatch):
    fleet = Fleet(tmp_path).fill(3)
    before = fleet.files

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("os.fsync", full)
        for _ in range(3):
            fleet.put(4)
            fleet.snapshot()
            with pytest.raises(OSError, match="No space left"):
                fleet.file()
        require_all(fleet.storage, fleet.records)
    fleet.file()
    assert len(fleet.files) > len(before)
    assert not [each for each in fleet.files if each.endswith(".part")]
    require_all(fleet.storage, fleet.records)
    fleet.storage.close()


def test_no_flipped_bit_cut_or_exchange_of_a_file_goes_unnoticed(tmp_path):
    fleet = Fleet(tmp_path).fill()
    fleet.storage.close()
    rng = np.random.default_rng(0)
    paths = [fleet.archive.path / each for each in fleet.files]
    whole = [path.read_bytes() for path in paths]

    def read_all(storage):
        for until in range(0, len(fleet.records), 4):
            state(storage, 1, until)
        read_back(storage, len(fleet.records))

    def refused(path):
        storage._filed = Filed(fleet.archive)  # nothing is in memory
        with pytest.raises(DamagedError, match=path.name):
            read_all(storage)

    storage = fleet.make()
    storage.open(no_progress)
    read_all(storage)
    for path, content in zip(paths, whole, strict=True):
        path.write_bytes(content[:-1])
        refused(path)
        path.write_bytes(whole[(paths.index(path) + 2) % len(paths)])
        refused(path)
        path.unlink()
        refused(path)
        path.write_bytes(content)
    segments = storage._ledger.hulls[1].segments
    storage.close()
    for place in rng.integers(0, 8 * len(whole[0]), FLIPS).tolist():
        segment = next(each for each in segments if paths[0].name.startswith(each.file.rpartition("/")[2]))
        changed = bytearray(whole[0])
        changed[place // 8] ^= 1 << place % 8
        paths[0].write_bytes(changed)
        with pytest.raises(DamagedError, match="is not as it was written"):
            fleet.archive.read(segment.file + BATCHES, segment.facts.wrote)
    report = copies.check(fleet.folder / "data", no_progress, fleet.archive.path)
    assert ["revisions 1 to" in each and paths[0].name in each for each in report.notes] == [True]
    assert [each.whole for each in report.hulls] == [False]


@pytest.mark.parametrize("blocks", [True, False])
def test_what_is_read_of_a_few_keys_is_as_it_was_written_or_refused(tmp_path, blocks, monkeypatch):
    """Also of segments of earlier versions, whose blocks have no hashes."""
    monkeypatch.setattr(archive, "BLOCK", 512)
    fleet = Fleet(tmp_path).fill()
    storage = fleet.storage
    hull = storage._ledger.hulls[1]
    if not blocks:
        hull.set_segments(
            [replace(each, facts=replace(each.facts, blocks="", state_blocks="")) for each in hull.segments]
        )
    segment = hull.segments[1]
    keys = PackedKeys.pack(KEYS[:1])

    def read():
        at, changes = storage.key_changes(1, keys, segment.first - 1, segment.last)
        revision, _, contents = storage.key_state(1, keys, segment.first - 1)
        columns = changes.rows, changes.revisions, changes.times, changes.points, contents.points
        return at, revision, [each.tobytes() for each in columns]

    if blocks:
        monkeypatch.setattr(Archive, "content", None)  # no file is read as a whole
    whole, rng = read(), np.random.default_rng(1)
    for end in (BATCHES, STATE):
        path = fleet.archive.path / (segment.file + end)
        content = path.read_bytes()
        for place in rng.integers(0, 8 * len(content), FLIPS).tolist():
            changed = bytearray(content)
            changed[place // 8] ^= 1 << place % 8
            path.write_bytes(changed)
            try:
                found = read()
            except DamagedError as error:
                assert path.name in str(error)  # noqa: PT017
                assert "is not as it was written" in str(error)  # noqa: PT017
            else:
                assert blocks  # what is not read does not matter
                assert found == whole
        for damaged in (content[:-1], content + b"0", b""):
            path.write_bytes(damaged)
            with pytest.raises(DamagedError, match="is not as it was written"):
                read()
        path.write_bytes(content)
    assert read() == whole
    fleet.storage.close()


def test_a_disk_that_fails_while_a_part_is_read_is_not_told_as_damage(fleet, monkeypatch):
    fleet.fill()
    storage, keys = fleet.make_reader(), PackedKeys.pack(KEYS[:1])
    file = storage._ledger.hulls[1].segments[0].file

    def fail(*_):
        raise OSError(errno.EIO, "it failed")

    with monkeypatch.context() as patch:
        patch.setattr(archive.os, "pread", fail)
        with pytest.raises(StorageError, match=f"{file}.*cannot be read: .*it failed") as caught:
            storage.key_changes(1, keys, 0, NEWEST)
    assert type(caught.value) is StorageError
    assert storage.key_changes(1, keys, 0, NEWEST)[0] > 0


def test_without_threads_segments_are_read_one_after_the_other(tmp_path, monkeypatch):
    """What is being read by nobody would be waited for for ever, by all who need it."""
    fleet = Fleet(tmp_path).fill()
    storage, keys = fleet.make_reader(), PackedKeys.pack(KEYS[:1])
    monkeypatch.setattr(fleet.archive, "has_parts", False)

    def refuse(_):
        raise RuntimeError("can't start new thread")

    expected = storage.key_changes(1, keys, 0, NEWEST)
    with monkeypatch.context() as patch:
        patch.setattr(filed.Thread, "start", refuse)
        same(read_back(storage, len(fleet.records)), fleet.records)
        last, changes = storage.key_changes(1, keys, 0, NEWEST)
    assert (last, changes.revisions.tolist()) == (expected[0], expected[1].revisions.tolist())
    same(read_back(storage, len(fleet.records)), fleet.records)
    fleet.storage.close()


def test_what_is_before_a_hole_is_read_of_a_key_and_then_the_hole_is_named(fleet):
    fleet.fill()
    storage, keys = fleet.make_reader(), PackedKeys.pack(KEYS[:1])
    segments = storage._ledger.hulls[1].segments
    whole, _ = storage.key_changes(1, keys, 0, NEWEST)
    assert len(segments) > 3
    assert whole == segments[-1].last
    for place in range(len(segments)):
        hole = segments[place]
        path = fleet.archive.path / (hole.file + BATCHES)
        aside = path.rename(path.with_suffix(".aside"))
        at = 0
        while at < hole.first - 1:
            at, changes = storage.key_changes(1, keys, at, NEWEST)
            assert changes.revisions.tolist() == sorted(set(changes.revisions.tolist()))
        assert at == hole.first - 1
        with pytest.raises(DamagedError, match=f"revisions {hole.first} to {hole.last} cannot be read"):
            storage.key_changes(1, keys, at, NEWEST)
        aside.rename(path)


@pytest.mark.parametrize("group_rows", [1, 4, parquet.GROUP_ROWS])
def test_every_kind_of_batch_and_every_double_comes_back_bit_for_bit(monkeypatch, group_rows):
    monkeypatch.setattr(parquet, "GROUP_ROWS", group_rows)
    rng = np.random.default_rng(1)
    hard = np.array([[-0.0, 5e-324], [1.1, 1e308], [0.1 + 0.2, -1 / 3], [2.0**60, 179.9999999]])
    none, some = PackedKeys.pack([]), PackedKeys.pack(["a", "é", "b"])
    held = HeldRows(
        some,
        rng.random((3, 2)),
        np.array([1, NO_TIME, 3]),
        np.array([FOREVER, 2, 3]),
        np.array([1.5, np.nan, 0.1]),
        np.array([np.nan, 1e300, 2.0]),
        np.array([1, 2, 3]),
        np.array([0, 1, 2]),
        np.array([0.1, 0, 5e-324]),
    )
    times, deadlines = np.array([5, NO_TIME, 7]), np.array([FOREVER, 9, 10])
    keyed = [
        KeyRows(some, hard[:3], none, times, deadlines, "absent"),
        KeyRows(some, hard[1:], none, np.full(3, NO_TIME), np.full(3, FOREVER)),
        KeyRows(some, hard[1:], none, accuracies=np.array([0.1 + 0.2, 0, 1e308])),
        KeyRows(some, hard[1:], none, accuracies=np.zeros(3)),
        KeyRows(none, hard[:0], some, held=HeldChange(held, some, QuarantineRules(max_growth=2.0))),
        KeyRows(none, hard[:0], none, held=HeldChange(held, none)),
        Expiry(None, 3),
        Expiry(17, 0),
        KeyRows(none, hard[:0], none),
    ]
    multiset = [
        PointRows(hard, hard[:1], lenient=True, times=np.array([1, 2, 3, NO_TIME])),
        PointRows(hard[:0], hard),
        PointRows(hard[:0], hard[:0]),
    ]
    numbers = np.array([0, 2**64 - 1, 5], np.uint64)
    integers = [KeyRows(numbers, np.round(rng.random((3, 2)), 7), numbers[:1]), KeyRows(numbers[:0], hard[:0], numbers)]
    for identity, rows in (("str", keyed), ("multiset", multiset), ("int", integers)):
        records = [
            Record(
                revision,
                each,
                clock=None if revision % 2 else revision,
                center=None if revision % 3 else (-0.0, 1.5),
                cause=[None, "batch", "expiry", "recenter"][revision % 4],
                committed=None if revision < 3 else CommitStamp(revision, 10 * revision),
            )
            for revision, each in enumerate(rows, 1)
        ]
        file = to_parquet(columns_of(records, identity), {"hull": "é"})
        schema = pq.read_schema(pa.BufferReader(file))  # as others see it
        words = {"cause", "kind", "op", "detail", *(() if identity == "int" else ("key",))}
        assert {name for name in schema.names if schema.field(name).type == pa.string()} == words
        columns, about, _ = from_parquet(file, "a file")
        found = list(records_of(columns))
        same(found, records)
        assert [each.committed for each in found] == [each.committed for each in records]
        assert about["hull"] == "é"
        for one, other in zip(found, records, strict=True):
            for name in ("points", "inserts", "deletes"):
                if isinstance(getattr(other.rows, name, None), np.ndarray):
                    assert getattr(one.rows, name).tobytes() == getattr(other.rows, name).tobytes()


def test_the_state_of_an_empty_hull_comes_back():
    for identity in ("str", "int", "multiset"):
        keys = {"str": PackedKeys.pack([]), "int": np.empty(0, np.uint64), "multiset": None}[identity]
        empty = Contents(np.empty((0, 2)), keys)
        columns = columns_of_state(empty, 7, None, identity)
        found, _, _ = from_parquet(to_parquet(columns, {}), "a file")
        same(contents_of(found, {"times": "False", "deadlines": "False"}), empty)


@pytest.mark.parametrize("identity", ["str", "int", "multiset"])
@pytest.mark.parametrize("columns", ["none", "times", "deadlines", "accuracies", "held"])
def test_a_state_is_read_a_group_of_rows_at_a_time(monkeypatch, identity, columns):
    monkeypatch.setattr(parquet, "GROUP_ROWS", 64)
    rng, count = np.random.default_rng(1), 500
    keys = {"str": PackedKeys.pack([f"vehicle {i:03}" for i in range(count)]), "int": np.arange(count, dtype=np.uint64)}
    late = np.arange(count) > 100  # none in the first group
    contents = Contents(
        rng.random((count, 2)),
        keys.get(identity),
        np.where(late, 7, NO_TIME) if columns == "times" else None,
        np.where(late, 7, FOREVER) if columns == "deadlines" else None,
        accuracies=np.where(late, 0.1, 0.0) if columns == "accuracies" and identity != "multiset" else None,
    )
    if columns == "held" and identity != "multiset":
        times, numbers = np.full(count, 3), np.full(count, 1.5)
        contents.held = HeldRows(
            contents.keys, contents.points, times, times, numbers, numbers, times, times, np.zeros(count)
        )
    file = filing.state_file(HullRow(1, "a", "uid", 0.0, HullSettings(identity)), Kept(revision=9, contents=contents))
    parts, told = parquet.state_from_parquet(file, "a file")
    found = list(parts.parts)
    assert parts.count == count
    in_groups = identity != "multiset" and columns != "held"
    assert [len(each) for each in found] == ([64] * 7 + [52] if in_groups else [count])
    same(in_one(found), contents)
    assert json.loads(told)["producers"] == {}
    if in_groups:
        middle = len(file) // 2  # zeros in the middle of the rows: the first of them come, and the rest is refused
        parts, _ = parquet.state_from_parquet(file[: middle - 400] + bytes(800) + file[middle + 400 :], "a file")
        same(next(reading := iter(parts.parts)), found[0])
        with pytest.raises(DamagedError, match=r"^a file is damaged: "):
            list(reading)


def test_positions_of_few_decimals_take_few_bytes():
    rng = np.random.default_rng(0)
    keys = PackedKeys.pack([f"vehicle {i:05}" for i in range(500)])
    points = rng.uniform([-10, 40], [10, 60], (500, 2))
    for decimals, most in ((7, 10), (None, 16)):
        records = []
        for revision in range(1, 101):
            points = points + rng.normal(0, 1e-4, (500, 2))
            rows = KeyRows(keys, points if decimals is None else np.round(points, decimals), PackedKeys.pack([]))
            records.append(
                Record(revision, rows, cause="batch", committed=CommitStamp(revision, BEGIN + revision * 7919))
            )
        assert len(to_parquet(columns_of(records, "str"), {})) / 50_000 < most


def test_a_move_that_is_a_batch_of_its_own_takes_few_bytes_too():
    """Fifty of them share a commit, whose number and time each row has."""
    rng, moves, vehicles = np.random.default_rng(0), 2**16, 1000
    who = np.sort(rng.integers(0, vehicles, moves))  # by key, with steps from one place to the next
    points = np.cumsum(rng.normal(0, 1e-4, (moves, 2)), 0) + rng.uniform([-10, 40], [10, 60], (vehicles, 2))[who]
    order = rng.permutation(moves)
    keys = PackedKeys.pack([f"vehicle {i:05}" for i in who[order].tolist()])
    commits = np.arange(moves) // 50
    times = BEGIN + np.cumsum(rng.integers(800, 3000, moves // 50 + 1))
    plain = columns_of([Record(1, KeyRows(keys, points[order], PackedKeys.pack([])), cause="batch")], "str")
    columns = replace(plain, revision=np.arange(moves), place=np.zeros(moves, np.int64))
    columns = replace(columns, commit=commits, committed=times[commits])
    for decimals, most in ((7, 9.1), (None, 15.5)):
        columns.points = points[order] if decimals is None else np.round(points[order], decimals)
        assert len(to_parquet(columns, {})) / moves < most


def test_a_copy_has_the_past_or_says_that_it_has_not(tmp_path):
    fleet = Fleet(tmp_path, archive=Archive(tmp_path / "data" / "history")).fill()
    records = fleet.records
    for name, options in (("copy", {}), ("without", {"without_history": True})):
        for _, report in copies.copy_all([(tmp_path / "data", tmp_path / name)], no_progress, **options):
            assert report.notes == []
        assert copies.check(tmp_path / name, no_progress).notes == []
    fleet.storage.close()
    copy = SQLiteStorage(tmp_path / "copy", archive=Archive(tmp_path / "copy" / "history"))
    copy.open(no_progress)
    require_all(copy, records)
    assert copy.row(1).uid.startswith("0123.")
    copy.close()
    without = SQLiteStorage(tmp_path / "without", archive=Archive(tmp_path / "without" / "history"))
    without.open(no_progress)
    oldest = without.oldest_moment(1).revision
    assert 0 < oldest == without.oldest(1)
    same(read_back(without, len(records)), records[oldest:])
    without.close()


def test_an_owner_that_was_replaced_removes_no_file_of_the_next_one(postgres, tmp_path):
    url, archive, heard = postgres.new_database(), Archive(tmp_path / "history"), []
    fleet = Fleet(tmp_path, archive=archive, make=lambda: PostgresStorage(Database(url), heard.append, archive=archive))
    first = fleet.storage
    fleet.put(4)
    fleet.snapshot()
    fleet.put(4)
    fleet.snapshot()
    steps = first.file_history(fleet.time)
    next(steps)
    steps.close()  # the commit of the name has failed: nothing of it is in the database
    query(url, "UPDATE owners SET epoch = epoch + 1, until = '-infinity', process = ''")
    fleet.storage = fleet.make()
    fleet.storage.open(no_progress)
    steps = fleet.storage.file_history(fleet.time)
    fleet.storage.commit([next(steps)], fleet.time)
    closes = next(steps)  # the file is written, and no segment has it yet
    with pytest.raises(TakenOverError):
        next(first.file_history(fleet.time))
    assert fleet.files
    fleet.storage.commit([closes], fleet.time)
    fleet.carry_out(steps)
    assert fleet.storage.oldest(1) > 0
    require_all(fleet.storage, fleet.records)
    first.close()
    fleet.storage.close()


@pytest.mark.parametrize("late", ["within a day", "after days"])
def test_what_an_owner_writes_that_stood_still_is_removed(postgres, tmp_path, monkeypatch, late):
    elapsed = 0.0
    monkeypatch.setattr(storage, "monotonic", lambda: elapsed)
    url, files = postgres.new_database(), Archive(tmp_path / "history")
    fleet = Fleet(tmp_path, archive=files, make=lambda: PostgresStorage(Database(url), lambda _: None, archive=files))
    first = fleet.storage
    for _ in range(2):
        fleet.put(4)
        fleet.snapshot()
    steps = first.file_history(fleet.time)
    first.commit([next(steps)], fleet.time)  # the file has a name, and now its owner stands still
    query(url, "UPDATE owners SET epoch = epoch + 1, until = '-infinity', process = ''")
    fleet.storage = fleet.make()
    fleet.storage.open(no_progress)
    fleet.file()
    if late == "after days":
        elapsed += storage.LATE
        fleet.file()
        assert not fleet.storage._ledger.dead["segments"]
    before = fleet.files
    closes = next(steps)
    (written,) = set(fleet.files) - set(before)
    with pytest.raises(TakenOverError):
        first.commit([closes], fleet.time)
    old = time.time() - 2 * archive.ORPHAN_SECONDS
    for each in fleet.files if late == "after days" else ():
        os.utime(files.path / each, (old, old))
    elapsed += storage.LATE
    fleet.file()
    assert written not in fleet.files
    assert not fleet.storage._ledger.dead["segments"]
    assert fleet.files == before
    require_all(fleet.storage, fleet.records)
    first.close()
    fleet.storage.close()


class LateArchive(Archive):
    """Takes files that it did not answer for, later."""

    takes_late, hangs = True, False

    def __init__(self, path):
        super().__init__(path)
        self.pending = []

    def write(self, file, content):
        if not self.hangs:
            return super().write(file, content)
        self.pending.append((file, content))
        raise OSError(errno.ETIMEDOUT, "the store does not answer", file)

    def arrive(self):
        for file, content in self.pending:
            super().write(file, content)


@pytest.mark.parametrize("again", [False, True], ids=["the server goes on", "the server starts again"])
def test_what_a_store_takes_late_of_a_deleted_hull_is_removed(tmp_path, monkeypatch, again):
    elapsed = 0.0
    monkeypatch.setattr(storage, "monotonic", lambda: elapsed)
    fleet = Fleet(tmp_path, archive=LateArchive(tmp_path / "history")).fill(2)
    fleet.put(4)
    fleet.snapshot()
    fleet.archive.hangs = True
    for _ in range(2):
        with pytest.raises(OSError, match="does not answer"):
            fleet.file()
    if again:
        fleet.storage.close()
        fleet.storage = fleet.make()
        fleet.storage.open(no_progress)
    fleet.storage.commit([Delete(1)], fleet.time)
    fleet.file()
    assert fleet.files == []
    fleet.time += 365 * 86_400 * 10**6  # the clock is set, while the store is as late as before
    fleet.file()
    fleet.archive.arrive()
    fleet.file()
    assert fleet.files
    elapsed += storage.LATE
    fleet.file()
    assert fleet.files == []
    assert not fleet.storage._ledger.dead["segments"]
    fleet.storage.close()


def test_a_file_is_removed_once_a_power_failure_cannot_bring_its_segment_back(tmp_path, monkeypatch):
    archive = Archive(tmp_path / "history")
    make = lambda: SQLiteStorage(tmp_path / "data", Durability.INTERVAL, archive=archive)  # noqa: E731
    fleet = Fleet(tmp_path, archive=archive, make=make).fill()
    log = fleet.storage._folder.log
    durable = []
    sync, remove = fleet.storage._folder.disk.sync, fleet.archive.remove

    def synced(file):
        sync(file)
        durable.append(log.stat().st_size)

    def removed(file):
        assert durable[-1:] == [log.stat().st_size], "what it follows from may be lost"
        remove(file)
        durable.append(0)

    monkeypatch.setattr(fleet.storage._folder.disk, "sync", synced)
    monkeypatch.setattr(fleet.archive, "remove", removed)
    files = fleet.files
    fleet.storage.commit([fleet.storage.set_history(1, SECOND, 0)])
    fleet.file()
    assert len(fleet.files) < len(files)
    fleet.storage.close()


def test_history_begins_where_the_journal_does_when_it_is_set(tmp_path):
    fleet = Fleet(tmp_path, replace(SETTINGS, history=0)).fill(3)
    assert fleet.files == []
    begin = fleet.storage.oldest(1)
    assert begin > 0
    fleet.storage.commit([fleet.storage.set_history(1, FOREVER, 0)])
    fleet.fill(3)
    assert fleet.storage.oldest_moment(1).revision == begin < fleet.storage.oldest(1)
    assert fleet.storage.moment(1, BEGIN) is None
    same(read_back(fleet.storage, len(fleet.records)), fleet.records[begin:])
    same(fleet.storage.read(1, NEWEST).records, fleet.records[fleet.storage.read(1).revision :])
    assert isinstance(state(fleet.storage, 1, begin).contents, Contents)
    fleet.storage.close()


def test_a_history_that_was_off_for_a_moment_begins_anew(fleet):
    """While nothing was removed, as with a store that was away: what lies before the gap leads nowhere."""
    fleet.fill(2)
    fleet.storage.commit([fleet.storage.set_history(1, 0, 0)])
    for _ in range(3):
        fleet.put(4)
        fleet.snapshot()
    fleet.storage.commit([fleet.storage.set_history(1, FOREVER, 0)])
    fleet.fill(3)
    first = fleet.storage.oldest_moment(1).revision
    assert 2 * 8 < first < len(fleet.records)
    same(read_back(fleet.storage, len(fleet.records)), fleet.records[first:])
    assert all(first < int(each.split("/")[1][:19]) for each in fleet.files)
    fleet.storage.close()
    again = fleet.make()
    assert again.open(no_progress).notes == []
    again.close()


def test_a_hull_whose_journal_is_damaged_does_not_keep_others_from_being_filed(fleet, monkeypatch):
    fleet.storage.commit([Create(HullRow(2, "other", "9876", 12.5, fleet.settings))])
    for last in (0, 2, 4):
        fleet.put(4)
        fleet.snapshot()
        fleet.storage.commit([Append(2, [move(last + 1), move(last + 2)])])
        fleet.carry_out(fleet.storage.snapshot(2, Kept(last + 2, Contents(np.empty((0, 2)), PackedKeys.pack([])))))
    read_due = filing.read_due

    def damaged(reader, hull):
        if hull.row.number == 1:
            raise DamagedError("revision 1 is missing")
        return read_due(reader, hull)

    monkeypatch.setattr(storage, "read_due", damaged)
    with pytest.raises(DamagedError, match="revision 1 is missing"):
        fleet.file()
    assert {each.split("/")[0] for each in fleet.files} == {"9876"}
