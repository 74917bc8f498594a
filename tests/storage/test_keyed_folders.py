"""Backup, restore, check and export of hulls with keys, times and deadlines."""

import csv
import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command_line import dynhull
from folders import opened, same
from server_process import server_process

from dynhull.keys import PackedKeys
from dynhull_client import HullClient
from dynhull_server.state.records import (
    FOREVER,
    NO_TIME,
    Append,
    Contents,
    Create,
    Expiry,
    HullRow,
    HullSettings,
    Kept,
    KeyRows,
    PointRows,
    Record,
    Window,
)
from dynhull_server.storage.sqlite import copies

STRINGS = ["+\r\nplus", "007", 'a "quoted", one\n', "x" * 255, "é" * 127, "日本"]  # in the order of their bytes
INTEGERS = [0, 7, 2**53 + 1, 2**63, 2**64 - 2, 2**64 - 1]
POINTS = [(0.1, -0.0), (5e-324, 1e308), (1 / 3, -2.5), (7.0, 7.0), (7.0, 7.0), (-1e-7, 12345678.9)]
TIMES = [-1, 0, 1_700_000_000_000_001, 2**53, -(2**53), NO_TIME]
DEADLINES = [FOREVER, 2**53, 2**53, FOREVER, 2**53 - 1, FOREVER]


def rows(*columns):
    kinds = np.uint64, np.float64, np.int64, np.int64
    keys, *more = (np.array(column, kind) for column, kind in zip(columns, kinds, strict=False))
    return keys, *more


def hulls():
    """Each with a snapshot and with a change after it."""
    _, points, times, deadlines = rows([], POINTS, TIMES, DEADLINES)
    strings, integers = PackedKeys.pack(STRINGS), np.array(INTEGERS, np.uint64)
    late = Window(max_age=2**54, clock="data")
    old = PackedKeys.pack(["old"]), np.ones((1, 2)), PackedKeys.pack([])
    yield (
        HullRow(1, "strings", "a", 0.0, HullSettings("str")),
        Kept(3, Contents(points[:3], strings[:3], times[:3], deadlines[:3]), {"p": 3}, clock=5),
        [
            Record(4, KeyRows(strings[3:5], points[3:5], PackedKeys.pack([]), times[3:5], deadlines[3:5]), clock=6),
            Record(5, KeyRows(strings[5:], points[5:], PackedKeys.pack([])), clock=6),
            Record(6, KeyRows(*old, np.array([5]), np.array([7])), clock=6),
            Record(7, Expiry(None, 1), clock=7),
        ],
    )
    yield (
        HullRow(2, "integers", "b", 0.0, HullSettings("int")),
        Kept(1, Contents(points[:2], integers[:2])),
        [Record(2, KeyRows(integers[2:], points[2:], integers[:0]))],
    )
    yield (
        HullRow(3, "window", "c", 0.0, HullSettings(window=late)),
        Kept(1, Contents(points[:2], times=times[:2]), clock=0),
        [Record(2, PointRows(points[2:5], points[:0], times=times[2:5]), clock=2**53)],
    )


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keyed") / "data"
    storage, _ = opened(folder)
    for row, kept, records in hulls():
        storage.commit([Create(row), Append(row.number, [filler(i) for i in range(1, kept.revision + 1)])])
        for step in storage.snapshot(row.number, kept):
            storage.commit([step])
        storage.commit([Append(row.number, records)])
    storage.close()
    return folder


def filler(revision):
    """A revision that the snapshot stands for."""
    return Record(revision, Expiry(None, 0))


def test_backup_check_and_restore(data, tmp_path):
    for source, target in ((data, "copy"), (tmp_path / "copy", "new")):
        command = "backup", tmp_path / target, "--data", source
        if target == "new":
            command = "restore", source, "--data", tmp_path / target
        done = dynhull(*command)
        assert done.stdout == f"{tmp_path / target}: 3 hulls\n", done.stderr
        assert dynhull("check", tmp_path / target).stdout.endswith(": 3 hulls, all whole\n")
        for row, kept, records in hulls():
            kept.records = records
            found = copies.read([tmp_path / target], row.name)
            assert found.row.uid.partition(".")[0] == row.uid
            same(
                found,
                copies.HullInFolder(replace(row, uid=found.row.uid), kept.last_revision, [(row.settings, kept)], []),
            )


def exported(data, file, name):
    done = dynhull("export", name, file, "--data", data)
    assert done.stdout.startswith(f"{file}: {6 - (name == 'window')} points of {name} at revision"), done.stderr
    return file


def moment(time):
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=time)


def text(time):
    return "" if time in (NO_TIME, FOREVER) else moment(time).isoformat(timespec="microseconds").replace("+00:00", "Z")


TEXTS = list(map(text, TIMES)), list(map(text, DEADLINES))


def test_csv(data, tmp_path):
    file = tmp_path / "hull.csv"
    for name, keys, dates in (("strings", STRINGS, TEXTS), ("integers", INTEGERS, [])):
        with exported(data, file, name).open(encoding="utf-8", newline="") as read:
            header, *found = csv.reader(read)
        assert header == ["key", "x", "y", "time", "expires"][: 3 + len(dates)]
        assert [row[0] for row in found] == list(map(str, keys))
        assert [(float(x), float(y)) for _, x, y, *_ in found] == POINTS
        assert [list(column) for column in zip(*found, strict=True)][3:] == list(dates)
    window = exported(data, file, "window").read_text().splitlines()
    assert window[0] == "x,y,time"
    assert "0.1,0.0,1969-12-31T23:59:59.999999Z" in window
    assert "7.0,7.0,2255-06-05T23:47:34.740992Z" in window


def test_geojson(data, tmp_path):
    for name, keys, dates in (("strings", STRINGS, TEXTS), ("integers", INTEGERS, [])):
        features = json.loads(exported(data, tmp_path / "hull.geojson", name).read_text())["features"]
        assert [feature["id"] for feature in features] == [
            str(key) if isinstance(key, int) and key > 2**53 else key for key in keys
        ]
        assert [tuple(feature["geometry"]["coordinates"]) for feature in features] == POINTS
        for column, member in zip(dates, ("time", "expires"), strict=False):
            assert [feature["properties"].get(member, "") for feature in features] == column


def test_parquet(data, tmp_path):
    utc = pa.timestamp("us", tz="UTC")
    for name, keys, dates in (("strings", STRINGS, (TIMES, DEADLINES)), ("integers", INTEGERS, ())):
        table = pq.read_table(exported(data, tmp_path / "hull.parquet", name))
        assert table.schema.field("key").type == (pa.string() if name == "strings" else pa.uint64())
        assert table["key"].to_pylist() == keys
        assert list(zip(table["x"].to_pylist(), table["y"].to_pylist(), strict=True)) == POINTS
        for column, member in zip(dates, ("time", "expires"), strict=False):
            assert table.schema.field(member).type == utc
            expected = [None if time in (NO_TIME, FOREVER) else time for time in column]
            assert table[member].cast(pa.int64()).to_pylist() == expected
    assert pq.read_table(exported(data, tmp_path / "hull.parquet", "window")).column_names == ["x", "y", "time"]


@pytest.mark.parametrize(("keyed", "keys"), [("str", PackedKeys.pack(STRINGS)), ("int", np.array(INTEGERS, np.uint64))])
def test_what_is_exported_is_imported(tmp_path, keyed, keys):
    times = np.array([time if time != NO_TIME else 1 for time in TIMES])
    dates = times.astype("datetime64[us]")
    with server_process("--data", str(tmp_path / "data")) as server, HullClient(server.address) as client:
        client.create_hull("from", keyed=keyed)
        client.put("from", keys, POINTS, dates)
        leaving = [row for row, end in enumerate(DEADLINES) if end != FOREVER]
        ends = [DEADLINES[row] for row in leaving]
        names = [list(keys)[row] for row in leaving]
        client.put("from", names, [POINTS[row] for row in leaving], dates[leaving], expire_times=ends)
        first = exported(tmp_path / "data", tmp_path / "first.csv", "from")
        with first.open(encoding="utf-8", newline="") as read:
            assert list(csv.reader(read))[1:] == [
                [str(key), repr(x + 0.0), repr(y + 0.0), text(time), text(end)]
                for key, (x, y), time, end in zip(keys, POINTS, times.tolist(), DEADLINES, strict=True)
            ]
        for suffix, key in ((".csv", "key"), (".geojson", "id"), (".parquet", "key")):
            file = exported(tmp_path / "data", tmp_path / f"hull{suffix}", "from")
            to = f"to{suffix}"
            client.create_hull(to, keyed=keyed)
            columns = "--key", key, "--time", "time", "--expires", "expires"
            done = dynhull("import", to, file, *columns, "--address", server.address)
            assert done.stdout == f"{to}: 6 points loaded, 6 in the hull\n", done.stderr
            again = exported(tmp_path / "data", tmp_path / "again.csv", to)
            assert again.read_bytes() == first.read_bytes()
