"""Data folders that earlier versions wrote: they open, are migrated once, and go on."""

import dataclasses
import json
import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from command_line import dynhull
from faulty_disk import FaultyDisk, failure
from folders import DATABASE, OLD_FOLDERS, append, event, flip, opened, read_fence, same, snapshot
from server_process import server_process

from dynhull.keys import PackedKeys
from dynhull_client import HullClient
from dynhull_server.state.contents import replayed
from dynhull_server.state.fences.events.block import AppendEvents, block_of
from dynhull_server.state.fences.model.records import Delay, DropEvents, PutDelays
from dynhull_server.state.fences.recovery.restored import members_after
from dynhull_server.state.records import Append, Create, Delete, Expiry, HullRow, HullSettings, KeyRows, Record, Window
from dynhull_server.storage.port import StorageError
from dynhull_server.storage.rows.columns import point_bytes
from dynhull_server.storage.sqlite.disk import Disk, OpenMode
from dynhull_server.storage.sqlite.schema import FORMAT
from dynhull_server.storage.sqlite.storage import SQLiteStorage


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data"


@pytest.mark.parametrize(("name", "fleet", "zones"), [("stopped", (30, 83), (3, 5)), ("killed", (33, 92), (4, 6))])
def test_a_folder_of_format_1_opens(folder, name, fleet, zones):
    shutil.copytree(OLD_FOLDERS / "format1" / name, folder)
    for _ in range(2):
        storage, contents = opened(folder)
        assert contents.hulls == [
            HullRow(1, "fleet", "00aa00aa00aa00aa", 1700000000.5),
            HullRow(2, "zones/é", "00bb00bb00bb00bb", 1700000001.0, HullSettings(max_points=500)),
        ]
        assert (contents.next_number, contents.notes) == (3, [])
        for number, (revision, count) in ((1, fleet), (2, zones)):
            kept = storage.read(number)
            assert (kept.last_revision, len(replayed(kept).hull)) == (revision, count)
        assert (storage.oldest(1), storage.oldest(2)) == (20, 0)
        assert storage.read(1).producers == {"p0": 24, "p1": 25, "p2": 23}
        assert storage.read(2).records[0].producer == "truck"
        storage.close()


def test_a_folder_of_format_1_goes_on(folder):
    shutil.copytree(OLD_FOLDERS / "format1" / "killed", folder)
    storage, _ = opened(folder)
    append(storage, 34, 40)
    snapshot(storage, 40)
    storage.commit([Delete(2)])
    for step in storage.sweep():
        storage.commit([step])
    storage.close()
    storage, contents = opened(folder)
    assert ([hull.name for hull in contents.hulls], contents.notes) == (["fleet"], [])
    assert (storage.read(1).revision, storage.oldest(1)) == (40, 25)
    storage.close()
    with sqlite3.connect(folder / DATABASE) as database:
        assert database.execute("SELECT min(first) FROM batches").fetchone() == (26,)
        assert database.execute("SELECT count(*) FROM chunks").fetchone() == (2,)


# Format 2, written by tests/data/make_folder.py

FORMAT_2 = OLD_FOLDERS / "format2"
FLEET = {"stopped": 40, "killed": 43}
PRODUCERS = {"plane": 12, "ship": 12, "train": 12, "bus": 4}


def query(folder, sql, access=OpenMode.READ):
    """What a statement finds. Unless it only reads, the log is copied and deleted when the connection closes."""
    with closing(Disk().connect(folder / DATABASE, access)) as database:
        return database.execute(sql).fetchall()


def rows_not_migrated(folder):
    of_batches = query(folder, "SELECT rowid, hull, first, last, checksum, payload FROM batches")
    return [of_batches, *(query(folder, f"SELECT rowid, * FROM {table}") for table in ("snapshots", "chunks"))]


def last_sequences(kept):
    return kept.producers | {record.producer: record.sequence for record in kept.records if record.producer}


def exported(name, hull):
    """The points as the earlier version exported them."""
    return np.loadtxt(FORMAT_2 / f"{name}-{hull}.csv", delimiter=",", skiprows=1)


def in_order(points):
    return points[np.lexsort(points.T)]


@pytest.mark.parametrize("name", FLEET)
def test_a_folder_of_format_2_has_everything(folder, name):
    shutil.copytree(FORMAT_2 / name, folder)
    last = FLEET[name]
    for _ in range(2):
        storage, contents = opened(folder)
        assert [(row.number, row.name) for row in contents.hulls] == [(2, "empty"), (1, "fleet"), (4, "zones/a")]
        assert [row.settings.max_points for row in contents.hulls] == [0, 0, 500]
        assert (contents.next_number, contents.notes) == (5, [])
        for number, hull in ((1, "fleet"), (4, "zones")):
            points = replayed(storage.read(number)).hull.points()
            np.testing.assert_array_equal(in_order(points), in_order(exported(name, hull)))
        fleet, zones = storage.read(1), storage.read(4)
        assert (fleet.revision, fleet.last_revision, storage.oldest(1)) == (24, last, 12)
        assert last_sequences(fleet) == PRODUCERS | {"bus": last - 36}
        assert storage.read(1, 13).producers == {"plane": 12}
        assert [record.rows.lenient for record in zones.records[:3]] == [False, True, False]
        assert last_sequences(zones) == {"truck": 1 if name == "stopped" else 2}
        assert storage.read(2).last_revision == 0
        storage.close()


def test_a_folder_of_format_2_is_migrated_once_and_quickly(folder):
    """Batches and snapshots are not rewritten; the table of hulls is, once."""
    shutil.copytree(FORMAT_2 / "stopped", folder)
    before = rows_not_migrated(folder)
    steps = []
    storage = SQLiteStorage(folder)
    storage.open(lambda done, total: steps.append((done, total)))
    storage.close()
    assert steps[0] == (0, 46)  # the numbers from the first row to the last, of which 34 are rows
    assert query(folder, "PRAGMA user_version") == [(FORMAT,)]
    assert rows_not_migrated(folder) == before
    tables_changed = query(folder, "PRAGMA schema_version")
    opened(folder)[0].close()
    assert query(folder, "PRAGMA schema_version") == tables_changed


@pytest.mark.parametrize("statement", ["DROP TABLE hulls", "PRAGMA user_version =", "COMMIT"])
def test_a_migration_that_fails_changes_nothing(folder, statement):
    shutil.copytree(FORMAT_2 / "killed", folder)
    disk = FaultyDisk()
    disk.fail(statement, failure(sqlite3.SQLITE_FULL))
    with pytest.raises(StorageError, match="injected"):
        SQLiteStorage(folder, disk=disk).open(lambda *_: None)
    assert query(folder, "PRAGMA user_version") == [(2,)]
    storage, contents = opened(folder)
    assert (len(contents.hulls), storage.read(1).last_revision, contents.notes) == (3, 43, [])
    storage.close()


def test_damage_to_a_folder_of_format_2_is_noticed(folder):
    """Also in what the migration rewrites."""
    for damage, words in (
        ("UPDATE hulls SET max_points = 501 WHERE id = 4", "the row of hull 4, 'zones/a', is damaged"),
        ("DELETE FROM hulls WHERE id = 2", "the totals record 3 hulls"),
        ("UPDATE batches SET last = 14 WHERE first = 13", "the tables have 3 with 31, or different ones"),
        ("UPDATE batches SET payload = x'00' WHERE first = 30", "revisions 30 to 30 are damaged, and later ones exist"),
    ):
        shutil.copytree(FORMAT_2 / "stopped", folder)
        query(folder, damage, OpenMode.WRITE)
        with pytest.raises(StorageError, match=words):
            opened(folder)
        shutil.rmtree(folder)


def test_a_folder_of_format_2_goes_on_with_keys_and_times(folder):
    shutil.copytree(FORMAT_2 / "killed", folder)
    storage, _ = opened(folder)
    tracks = HullRow(5, "tracks", "", 0.0, HullSettings("str", window=Window(max_age=9)))
    put = KeyRows(PackedKeys.pack(["é"]), np.ones((1, 2)), PackedKeys.pack([]), np.array([7]))
    new = [Record(1, put, clock=7), Record(2, Expiry(7, 1), clock=16)]
    storage.commit([Create(tracks), Append(5, new)])
    append(storage, 44, 50)
    snapshot(storage, 50)
    for _ in range(2):
        assert storage.row(5) == tracks
        same(storage.read(5).records, new)
        assert (storage.read(1).revision, storage.oldest(1)) == (50, 24)
        storage.close()
        storage, contents = opened(folder)
        assert contents.notes == []
    storage.close()


# Format 3, written by tests/data/make_folder.py

FORMAT_3 = OLD_FOLDERS / "format3"
EXPORTED = {"fleet": "fleet", "zones": "zones/a", "vans": "vans", "track": "tracks"}


@pytest.mark.parametrize("name", ["stopped", "killed"])
def test_a_folder_of_format_3_has_every_key_time_and_deadline(folder, name, tmp_path):
    """As the version exported it that wrote it. A fence is the first thing that format 3 could not hold."""
    shutil.copytree(FORMAT_3 / name, folder)
    for _ in range(2):
        for short, hull in EXPORTED.items():
            file = tmp_path / "points.csv"
            done = dynhull("export", hull, file, "--data", folder)
            assert done.exit_code == 0, done.stderr
            assert file.read_text() == (FORMAT_3 / f"{name}-{short}.csv").read_text()
            file.unlink()
        storage, contents = opened(folder)
        assert ([row.name for row in contents.hulls], contents.notes) == (
            ["empty", "fleet", "tracks", "vans", "zones/a"],
            [],
        )
        vans = next(row for row in contents.hulls if row.name == "vans")
        assert last_sequences(storage.read(vans.number)) == {"gate": 1 if name == "stopped" else 2}
        storage.close()
        assert query(folder, "PRAGMA user_version") == [(FORMAT,)]


# Format 4, written by tests/data/make_folder.py

FORMAT_4 = OLD_FOLDERS / "format4"


@pytest.mark.parametrize("name", ["stopped", "killed"])
def test_a_folder_of_format_4_has_every_fence(folder, name):
    """Who is inside, as the version said that wrote it; from then on, events may be delayed."""
    shutil.copytree(FORMAT_4 / name, folder)
    expected = json.loads((FORMAT_4 / f"{name}-fences.json").read_text())
    for life in range(3):
        storage, contents = opened(folder)
        assert contents.notes == []
        found = {}
        for row in contents.fences:
            kept = read_fence(storage, row.number)
            inside = {hull: sorted(keys) for hull, keys in members_after(kept).items() if keys}
            consumers = {each: consumer.acknowledged for each, consumer in kept.consumers.items()}
            found[row.name] = {"inside": inside, "last": kept.last, "consumers": consumers}
            assert len(kept.delays) == (life if row.name == "gate" else 0)
        assert found == expected
        gate = next(row.number for row in contents.fences if row.name == "gate")
        storage.commit([PutDelays(gate, {("vans", f"van é{life}"): Delay(True, 10**15, 1, 1)})])
        storage.close()
        assert query(folder, "PRAGMA user_version") == [(FORMAT,)]


# Formats 6 to 10, written by tests/data/make_folder.py


def as_told(event):
    """An event as the earlier version told it."""
    key, position = None if event.key is None else str(event.key), event.position and list(event.position)
    return [event.sequence, event.type.name.lower(), event.hull, key, position, event.distance]


@pytest.mark.parametrize("version", ["format6", "format7", "format8", "format9", "format10"])
@pytest.mark.parametrize("name", ["stopped", "killed"])
def test_a_folder_with_events_has_every_event(folder, name, version):
    """Those of rows for one fence each, and of shared ones; the next ones share rows, and are dropped one by one."""
    shutil.copytree(OLD_FOLDERS / version / name, folder)
    expected = json.loads((OLD_FOLDERS / version / f"{name}-fences.json").read_text())
    for _ in range(2):
        storage, contents = opened(folder)
        assert contents.notes == []
        fences = storage.read_fences([row.number for row in contents.fences])
        for row, kept in zip(contents.fences, fences, strict=True):
            told = expected[row.name]
            assert (kept.first, kept.last, bool(kept.delays)) == (told["first"], told["last"], row.name == "late")
            found = [as_told(each) for each in storage.read_events(row.number, 0, 1000)]
            assert len(found) == kept.last - kept.first + 1
            seen = [each for each in told["events"] if each[1] != "lost"]  # the last one is missing where some are lost
            assert found[: len(seen)] == seen
        storage.close()
        assert query(folder, "PRAGMA user_version") == [(FORMAT,)]
    storage, contents = opened(folder)
    short = next(row.number for row in contents.fences if row.name == "short")
    gate = next(row.number for row in contents.fences if row.name == "gate")
    lasts = {number: expected[name]["last"] for name, number in (("short", short), ("gate", gate))}
    made = {number: [event(last + 1)] for number, last in lasts.items()}
    storage.commit([AppendEvents(block_of(made))])
    storage.commit([DropEvents(short, lasts[short] + 1)])
    for _ in range(2):
        assert storage.read_events(gate, lasts[gate], 10) == made[gate]
        (kept,) = storage.read_fences([short])
        assert storage.read_events(short, 0, 10)[-1:] == made[short]
        assert expected["short"]["first"] <= kept.first <= lasts[short] + 1
        storage.close()
        storage, _ = opened(folder)
    storage.close()


@pytest.mark.parametrize("version", ["format8", "format9", "format10"])
@pytest.mark.parametrize("name", ["stopped", "killed"])
def test_a_folder_with_a_quarantine_has_every_position(folder, name, version):
    """In a snapshot and, after a kill, in batches after it; a byte that flips there is noticed."""
    shutil.copytree(OLD_FOLDERS / version / name, folder)
    expected = json.loads((OLD_FOLDERS / version / f"{name}-held.json").read_text())
    storage, contents = opened(folder)
    (row,) = (each for each in contents.hulls if each.name == "held")
    kept = storage.read(row.number)
    live = replayed(kept, row.settings)
    storage.close()
    assert kept.contents.held is not None
    assert (kept.last_revision, len(live.hull)) == (expected["revision"], expected["points"])
    assert list(dataclasses.astuple(live.quarantine.rules)) == expected["rules"]
    held = live.quarantine.stored()
    moments = held.times.astype("datetime64[us]").astype(object)
    measures = [
        [None if np.isnan(each) else each for each in pair] for pair in zip(held.speeds, held.growths, strict=True)
    ]
    columns = held.keys, held.points.tolist(), moments, measures, held.revisions.tolist(), held.confirmed.tolist()
    found = [
        [key, at, f"{time}+00:00".replace(" ", "T"), *two, *more]
        for key, at, time, two, *more in zip(*columns, strict=True)
    ]
    assert found == expected["held"]
    flip(folder / DATABASE, point_bytes(kept.contents.held.points[:20]))
    done = dynhull("check", folder)
    (line,) = (each for each in done.stdout.splitlines() if each.startswith("held:"))
    assert done.exit_code == 1
    assert line.endswith("DAMAGED")


# Formats 9 and 10, written by tests/data/make_folder.py


@pytest.mark.parametrize("version", ["format9", "format10"])
@pytest.mark.parametrize("name", ["stopped", "killed"])
def test_a_folder_with_hulls_over_shards_has_every_point(folder, name, version, tmp_path):
    """Roots and shards with snapshots and, after a kill, batches after these; the hulls go on."""
    shutil.copytree(OLD_FOLDERS / version / name, folder)
    expected = json.loads((OLD_FOLDERS / version / f"{name}-divided.json").read_text())
    for hull, told in expected.items():
        done = dynhull("export", hull, tmp_path / f"{hull}.csv", "--data", folder)
        assert done.exit_code == 0, done.stderr
        rows = [line.split(",") for line in (tmp_path / f"{hull}.csv").read_text().splitlines()[1:]]
        columns = slice(1, 3) if told["keys"] else slice(0, 2)
        assert sorted([float(each) for each in row[columns]] for row in rows) == told["points"]
    with server_process("--data", str(folder)) as server, HullClient(server.address) as client:
        for hull, told in expected.items():
            found = client.get_hull(hull)
            assert (found.revision, found.info.clock and found.info.clock.isoformat()) == (
                told["revision"],
                told["clock"],
            )
            assert client.sample_points(hull, 10_000).points.tolist() == told["points"]
            assert found.vertices.tolist() == told["vertices"]
            assert told["keys"] is None or list(client.entities(hull).keys) == told["keys"]
            assert client.last_sequence(hull, "ship") == told["sequence"]
        assert client.apply("many", insert=[[50, 50]]).revision == expected["many"]["revision"] + 1
        assert all(client.verify(hull).equal for hull in expected)
    assert query(folder, "PRAGMA user_version") == [(FORMAT,)]


# What no format before 11 has: commits

NOW = 1_800_000_000_000_000


@pytest.mark.parametrize("version", [1, 2, 3, 4, 6, 7, 8, 9, 10])
def test_batches_of_older_formats_have_no_commit_and_later_ones_have(folder, tmp_path, version):
    """Migrated at the start of a server, and with a copy; the tables are those of a new folder."""
    old = OLD_FOLDERS / f"format{version}" / "killed"
    shutil.copytree(old, folder)
    copy = tmp_path / "copy"
    assert dynhull("restore", folder, "--data", copy).exit_code == 0
    fresh = tmp_path / "fresh"
    opened(fresh)[0].close()
    for migrated in (folder, copy):
        storage, contents = opened(migrated)
        assert contents.committed == 0
        fleet = next(row.number for row in contents.hulls if row.name == "fleet")
        before = storage.read(fleet)
        assert {(each.committed, each.cause) for each in before.records} == {(None, None)}
        first = before.last_revision + 1
        storage.commit([Append(fleet, [Record(first, before.records[-1].rows, cause="batch")])], NOW)
        storage.close()
        storage, contents = opened(migrated)
        *older, last = storage.read(fleet).records
        assert (last.committed.time, last.cause, contents.committed) == (NOW, "batch", NOW)
        assert {(each.committed, each.cause) for each in older} == {(None, None)}
        storage.close()
        schema = "SELECT name, sql FROM sqlite_schema ORDER BY name"
        assert query(migrated, schema) == query(fresh, schema)
