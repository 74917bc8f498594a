"""Keyed hulls and windows on the command line: create, put, remove, load, query, watch, list."""

import json

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command_line import dynhull

from dynhull_client import HullClient

ROWS = """\
id,seen,lon,lat
LH400,2026-03-01T12:00:00Z,0,0
UA17,2026-03-01T13:00:00+01:00,4,0
LH400,2026-03-01T12:00:05Z,1,1
"""


def entities(served, name):
    with HullClient(served) as client:
        there = client.entities(name)
        times = None if there.times is None else [str(each) for each in there.times]
        return dict(zip(there.keys, there.points.tolist(), strict=True)), times, there.revision


@pytest.mark.usefixtures("served")
def test_a_fleet_by_hand(name):
    assert dynhull("create", name, "--keyed", "str", "--max-age", "2h", "--max-points", "3").exit_code == 0
    done = dynhull("put", name, "LH400", "-73.9", "40.7")
    assert done.stdout == f"{name}: 1 key new, 0 moved, 1 in the hull, its shape changed\n"
    done = dynhull("put", name, "--json", input='LH400,1,1\n\n"a, b",4,0\nc,0,5\n')
    assert json.loads(done.stdout).items() >= {"inserted": 2, "moved": 1, "points": 3, "stale": 0}.items()
    assert dynhull("query", name, "--keys").stdout == "0.0\t5.0\tc\n1.0\t1.0\tLH400\n4.0\t0.0\ta, b\n"
    vertex = json.loads(dynhull("query", name, "vertices", "--keys", "--json").stdout.splitlines()[0])
    assert vertex == {"vertex": [0, 5], "key": "c"}
    assert dynhull("query", name, "positions", "c", "nobody").stdout == "c\t0.0\t5.0\nnobody\tnan\tnan\n"
    assert dynhull("query", name, "locate", "--keys", input="c\nnobody\n").stdout == "c\tboundary\nnobody\tmissing\n"
    assert dynhull("query", name, "distance", "--keys", "c").stdout == "c\t0.0\n"
    assert dynhull("query", name, "support", "1,0", "--keys").stdout == "1.0\t0.0\t4.0\t0.0\ta, b\n"
    done = dynhull("put", name, "d", "9", "9", "--ttl", "1h")
    assert "1 key new, 0 moved, 1 evicted, 3 in the hull" in done.stdout

    done = dynhull("remove", name, "--key", "c", "--key", "nobody")
    assert done.exit_code == 1
    assert done.stderr.startswith("error: key 2, nobody, is not in the hull; nothing was removed.")
    done = dynhull("remove", name, "--key", "c", "--key", "nobody", "--missing-ok")
    assert f"{name}: 1 key removed, 1 not there, 2 in the hull" in done.stdout
    assert dynhull("list", name).stdout == f"{name}\t2\t2\t4\tstr\t2h, 3 points\n"
    listed = json.loads(dynhull("list", name, "--json").stdout)
    assert (listed["keyed"], listed["max_age"], listed["max_points"]) == ("str", 7200, 3)
    done = dynhull("create", name, "--keyed", "int", "--exist-ok")
    assert (done.exit_code, "exists with other settings: its keyed is 'str'" in done.stderr) == (1, True)


def test_integer_keys_and_another_hull(served, name):
    fleet, depot = f"{name}/fleet", f"{name}/depot"
    dynhull("create", fleet, "--keyed", "int")
    dynhull("create", depot)
    dynhull("insert", depot, "0,0", "2,0", "0,2")
    assert dynhull("put", fleet, "7", "0.5", "0.5").exit_code == 0
    assert dynhull("query", depot, "locate", "--keys", "7", "--keys-of", fleet).stdout == "7\tinside\n"
    done = dynhull("put", fleet, "seven", "1", "1")
    assert done.exit_code == 2
    assert "key 1 is 'seven', not an integer from 0 to 2**64 - 1" in done.stderr
    done = dynhull("put", fleet, "9" * 5000, "1", "1")
    assert (done.exit_code, "not an integer from 0 to 2**64 - 1" in done.stderr) == (2, True)
    file = dynhull("load", fleet, "--key", "id", input="id,x,y\n8,1,1\nx,2,2\n")
    assert (file.exit_code, "line 3: id is 'x', not an integer" in file.stderr) == (0, True)
    assert entities(served, fleet)[0] == {7: [0.5, 0.5], 8: [1, 1]}


def test_the_largest_integer_keys_of_json_are_exact(served, name, tmp_path):
    keys = 2**63, 2**64 - 1, 2**64, 1.5, 2**53 + 1
    features = [{"type": "Feature", "id": key, "geometry": {"type": "Point", "coordinates": [0.1, 2]}} for key in keys]
    rows = [{"id": key, "x": 0.1, "y": 2} for key in keys]
    for place, file, text in (
        ("feature", "a.geojson", json.dumps({"type": "FeatureCollection", "features": features})),
        ("item", "a.json", json.dumps(rows)),
        ("line", "a.ndjson", "\n".join(map(json.dumps, rows))),
    ):
        (tmp_path / file).write_text(text)
        hull = f"{name}/{place}"
        dynhull("create", hull, "--keyed", "int")
        done = dynhull("load", hull, tmp_path / file, "--key", "id")
        assert done.exit_code == 0, done.stderr
        assert f"  {place} 3: id is 18446744073709551616: a key is from 0 to 2**64 - 1\n" in done.stderr
        assert f"  {place} 4: id is 1.5, not an integer" in done.stderr
        assert entities(served, hull)[0] == {key: [0.1, 2.0] for key in (2**63, 2**64 - 1, 2**53 + 1)}


def test_a_watch_names_who_joins_and_leaves_the_corners(served, name):
    with HullClient(served) as client:
        client.create_hull(name, keyed="str")
        client.put(name, ["a", "b", "c", "d"], [[0, 0], [4, 0], [0, 4], [1, 1]])
        shown = dynhull("watch", name, "--keys", "--events", "1").stdout
        assert shown.split()[1:4] == ["4", "3", "3"]
        assert shown.rstrip().endswith("+a +b +c")
        event = json.loads(dynhull("watch", name, "--keys", "--events", "1", "--json").stdout)
        assert (event["joined"], event["left"]) == (["a", "b", "c"], [])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["put", "HULL", "a", "1"], "give KEY X Y, three arguments: 2 were given"),
        (["put", "HULL", "a", "1", "inf"], "arguments: 'a,1,inf' is not KEY,X,Y with finite numbers"),
        (
            ["put", "HULL", "a", "1", "2", "--time", "2026-03-01T12:00"],
            "--time is '2026-03-01T12:00', without a time zone",
        ),
        (["put", "HULL", "a", "1", "2", "--ttl", "soon"], "--ttl 'soon' is not a time span: write for example"),
        (["create", "HULL/x", "--max-age", "forever"], "--max-age 'forever' is not a time span"),
        (["create", "HULL/x", "--clock", "data"], "--clock is given with --max-age or --max-points"),
        (["put", "HULL", "", "1", "2"], "error: arguments: the key is empty"),
        (["put", "HULL", "a", "1", "2", "--ttl", "0"], "error: --ttl is '0 s and 0 ns': must be positive"),
        (["load", "ü", "--key", "a"], "error: the name of the hull is 'ü': "),
        (["fences", "create", "x", "--subjects", "HULL", "--area", "a b"], "error: --area is 'a b': "),
        (
            ["fences", "create", "x", "--subjects", "HULL", "--area", "HULL", "--without-self"],
            "error: --margin is 0.0: must be positive with --without-self",
        ),
        (["remove", "HULL", "1,2", "--key", "a"], "give either points or --key"),
        (["query", "HULL", "count", "--keys", "a"], "count is about points: --keys is for"),
        (["query", "HULL", "vertices", "--keys-of", "b"], "--keys-of is given with --keys"),
        (["load", "HULL", "--time-unit", "s"], "--time-unit is given with --time or --expires"),
        (["load", "HULL", "--expires", "until"], "--expires is given with --key"),
        (["load", "HULL", "--only", "absent"], "--only is given with --key"),
        (["load", "HULL", "--time-zone", "UTC"], "--time-zone is given with --time or --expires"),
    ],
    ids=lambda value: "-".join(value[:1] + value[2:]) if isinstance(value, list) else "",
)
def test_what_is_wrong_is_named(served, name, arguments, words):
    dynhull("create", name, "--keyed", "str")
    done = dynhull(*(each.replace("HULL", name) for each in arguments))
    assert (done.exit_code, words in done.stderr) == (2, True), done.stderr
    assert entities(served, name)[2] == 0


def test_a_table_of_keys_is_loaded_once(served, name, tmp_path):
    file = tmp_path / "seen.csv"
    file.write_text(ROWS + "BA2,2026-03-01T12:00:00,2,2\n,2026-03-01T12:00:00Z,2,2\n")
    assert (
        dynhull("create", name, "--keyed", "str", "--event-order", "--max-age", "1h", "--clock", "data").exit_code == 0
    )
    done = dynhull("load", name, file, "--key", "id", "--time", "seen")
    assert (done.exit_code, done.stdout) == (0, f"{name}: 3 points loaded (2 new, 1 moved), 2 in the hull\n")
    assert "line 5: seen is '2026-03-01T12:00:00', without a time zone: add Z for UTC, or an offset" in done.stderr
    assert "line 6: id is missing" in done.stderr
    points, times, revision = entities(served, name)
    assert (points, revision) == ({"LH400": [1, 1], "UA17": [4, 0]}, 2)
    assert times == ["2026-03-01T12:00:05.000000", "2026-03-01T12:00:00.000000"]
    assert "loaded before" in dynhull("load", name, file, "--key", "id", "--time", "seen").stderr
    done = dynhull("load", name, file, "--key", "id", "--time", "seen", "--resume")
    assert (done.exit_code, entities(served, name)[2]) == (0, 2)


@pytest.mark.usefixtures("served")
def test_a_load_says_which_keys_are_put_and_when_they_leave(name, tmp_path):
    file = tmp_path / "seen.csv"
    file.write_text("id,seen,lon,lat\na,2026-03-01T12:00:00Z,0,0\nb,2026-03-01T12:00:00Z,4,0\n")
    dynhull("create", name, "--keyed", "str", "--max-age", "1h", "--clock", "data")
    load = "load", name, file, "--key", "id", "--time", "seen"
    assert dynhull("put", name, "b", "9", "9", "--time", "2026-03-01T12:00:00Z", "--only", "absent").exit_code == 0
    done = dynhull(*load, "--only", "absent", "--ttl", "5m")
    assert done.stdout == f"{name}: 1 point loaded (1 new, 1 skipped), 2 in the hull\n", done.stderr
    dynhull("put", name, "c", "1", "1", "--time", "2026-03-01T12:06:00Z")
    assert dynhull("query", name, "positions", "a", "b", "c").stdout == "a\tnan\tnan\nb\t9.0\t9.0\nc\t1.0\t1.0\n"
    for options, words in (
        (["--expires", "seen", "--ttl", "5m"], "--ttl and --expires both say when keys leave"),
        (["--ttl", "0"], "--ttl '0' must be more than 0"),
    ):
        done = dynhull(*load, *options)
        assert (done.exit_code, words in done.stderr) == (2, True), done.stderr


@pytest.mark.parametrize(
    ("number", "unit"),
    [
        ("1772366400", "seconds"),
        ("1772366400.5", "seconds"),
        ("1772366400000", "milliseconds"),
        ("1772366400000000", "microseconds"),
        ("1772366400000000000", "nanoseconds"),
    ],
)
def test_numbers_are_times_in_a_unit_that_is_printed(served, name, number, unit):
    dynhull("create", name, "--keyed", "str", "--max-age", "1h", "--clock", "data")
    done = dynhull("load", name, "--key", "id", "--time", "ts", input=f"id,ts,x,y\na,{number},1,1\n")
    assert f"ts: times are {unit} since 1970, the first is 2026-03-01T12:00:00" in done.stderr
    assert entities(served, name)[1][0].startswith("2026-03-01T12:00:00")


def test_a_row_with_a_bad_time_is_named(served, name):
    dynhull("create", name, "--keyed", "str")
    rows = [
        "a,,2100-01-01T00:00:00Z",
        "b,1e30,",
        "c,1000-01-01T00:00:00Z,",
        "d,2026-03-01T12:00:00Z,later",
        "e,2026-03-01T12:00:00Z,",
        "f,2026-03-01T12:00:00Z,2100-01-01T00:00:00Z",
    ]
    table = "\n".join(["id,seen,until,x,y", *(f"{row},1,1" for row in rows)])
    done = dynhull("load", name, "--key", "id", "--time", "seen", "--expires", "until", input=table)
    assert done.stderr.partition("4 bad rows left out:\n")[2].splitlines() == [
        "  line 2: seen is missing",
        "  line 3: seen is '1e30', as nanoseconds not from the years 1685 to 2255",
        "  line 4: seen is '1000-01-01T00:00:00Z', not from the years 1685 to 2255",
        "  line 5: until is 'later', neither ISO 8601 with a time zone nor a number; --time-format reads other forms",
    ]
    assert entities(served, name)[0] == {"e": [1, 1], "f": [1, 1]}


@pytest.mark.parametrize("form", ["csv", "ndjson", "geojson"])
def test_positions_have_accuracies(served, name, form):
    rows = [("a", 1.5), ("b", None), ("c", -1), ("d", "wide"), ("e", 0)]
    match form:
        case "csv":
            given = "id,hdop,x,y\n" + "".join(f"{key},{'' if error is None else error},1,1\n" for key, error in rows)
        case "ndjson":
            given = "\n".join(json.dumps({"id": key, "hdop": error, "x": 1, "y": 1}) for key, error in rows)
        case _:
            point = {"type": "Point", "coordinates": [1, 1]}
            listed = [{"type": "Feature", "id": k, "geometry": point, "properties": {"hdop": e}} for k, e in rows]
            given = json.dumps({"type": "FeatureCollection", "features": listed})
    options = ("--format", form, "--key", "id", "--accuracy", "hdop")
    dynhull("create", name, "--keyed", "str")
    done = dynhull("load", name, "-", *options, input=given)
    assert "2 bad rows left out" in done.stderr
    assert "must not be negative" in done.stderr
    found = [
        json.loads(line) for line in dynhull("query", name, "positions", "a", "b", "e", "--json").stdout.splitlines()
    ]
    assert [line["accuracy"] for line in found] == [1.5, 0, 0]
    dynhull("put", name, "b", "2", "2", "--accuracy", "7")
    with HullClient(served) as client:
        assert client.entities(name).accuracies.tolist() == [1.5, 7, 0]


def test_the_unit_of_times_may_be_given(served, name):
    dynhull("create", name, "--keyed", "str", "--max-age", "1h", "--clock", "data")
    done = dynhull(
        "load", name, "--key", "id", "--time", "ts", "--time-unit", "ms", input="id,ts,x,y\na,86400000,1,1\n"
    )
    assert (done.exit_code, "since 1970" in done.stderr) == (0, False)
    assert entities(served, name)[1] == ["1970-01-02T00:00:00.000000"]


def features(rows):
    return json.dumps(
        {
            "type": "FeatureCollection",
            "features": [
                {
                    "type": "Feature",
                    "id": key,
                    "properties": {"seen": seen},
                    "geometry": {"type": "Point", "coordinates": [x, y]},
                }
                for key, seen, x, y in rows
            ],
        }
    )


def test_keys_of_every_format(served, name, tmp_path):
    rows = [("a", "2026-03-01T12:00:00Z", 1.0, 2.0), ("b", "2026-03-01T12:00:01Z", 3.0, 4.0)]
    names = ("id", "seen", "x", "y")
    (tmp_path / "p.json").write_text(json.dumps([dict(zip(names, row, strict=True)) for row in rows]))
    (tmp_path / "p.ndjson").write_text("\n".join(json.dumps(dict(zip(names, row, strict=True))) for row in rows))
    (tmp_path / "p.geojson").write_text(features(rows))
    table = pa.table(dict(zip(names, zip(*rows, strict=True), strict=True)))
    seen = table["seen"].cast(pa.timestamp("us", "UTC"))
    pq.write_table(table.set_column(1, "seen", seen), tmp_path / "p.parquet")
    for file in sorted(tmp_path.iterdir()):
        hull = f"{name}/{file.suffix[1:]}"
        dynhull("create", hull, "--keyed", "str", "--event-order")
        done = dynhull("load", hull, file, "--key", "id", "--time", "seen")
        assert done.exit_code == 0, done.stderr
        points, times, _ = entities(served, hull)
        assert points == {"a": [1, 2], "b": [3, 4]}
        assert times == ["2026-03-01T12:00:00.000000", "2026-03-01T12:00:01.000000"]
    plain = f"{name}/plain"
    dynhull("create", plain)
    dynhull("insert", plain, "1,1")
    done = dynhull("load", plain, tmp_path / "p.json", "--key", "id")
    assert (done.exit_code, "have no keys: leave out --key" in done.stderr) == (2, True)


AHEAD = """id,seen,x,y
a,2026-03-01T12:00:00Z,0,0
b,2099-01-01T00:00:00Z,9,9
c,2026-03-01T12:00:01Z,4,0
d,2098-01-01T00:00:00Z,9,9
a,2026-03-01T11:00:00Z,7,7
c,2026-03-01T10:00:00Z,1,1
"""


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize(
    ("window", "stale", "late"), [(["--max-age", "90m", "--clock", "data"], 1, 1), ([], 2, 0)], ids=["window", "none"]
)
def test_a_time_that_the_hull_refuses_is_a_bad_row_and_every_count_is_told(name, tmp_path, window, stale, late):
    file = tmp_path / "seen.csv"
    file.write_text(AHEAD)
    options = ["--event-order", *window, "--max-skew", "1m"]
    assert dynhull("create", name, "--keyed", "str", *options).exit_code == 0
    assert dynhull("list", name).stdout.endswith("1m ahead\n")
    load = ["load", name, file, "--key", "id", "--time", "seen"]
    dry = dynhull(*load, "--dry-run")
    assert dry.stdout.startswith(f"{name}: 4 points would be loaded, x from 0.0 to 7.0"), dry.stderr
    done = dynhull(*load)
    old = "1 stale, 1 late" if late else "2 stale"
    assert done.stdout == f"{name}: 2 points loaded (2 new, {old}), 2 in the hull\n", done.stderr
    for said in (dry, done):
        assert "2 bad rows left out:\n" in said.stderr
        lines = [line for line in said.stderr.splitlines() if line.startswith("  line")]
        assert [line.partition(", if")[0].partition(": the latest")[0] for line in lines] == [
            f"  line {line}: time is {year}-01-01T00:00:00Z: further ahead of the server's clock than this hull allows"
            for line, year in ((3, 2099), (5, 2098))
        ]
    counts = json.loads(dynhull(*load, "--again", "--json").stdout)
    none = "deleted", "missing", "skipped", "clamped", "evicted", "held", "released", "dropped"
    some = {"inserted": 0, "moved": 2, "stale": stale, "late": late}
    assert counts == {"name": name, "loaded": 2, "bad_rows": 2, "points": 2, **some, **dict.fromkeys(none, 0)}


def test_a_batch_of_refused_rows_only_keeps_its_number(served, name, tmp_path):
    """A key that comes again begins a batch: the first and the third batch have no row that the hull takes."""
    bad, good = "a,2099-01-01T00:00:00Z,9,9\n", "a,2026-03-01T12:00:00Z,{0},{0}\n"
    rows = [bad, good.format(1), bad, good.format(2), good.format(3)]
    file = tmp_path / "seen.csv"
    file.write_text("id,seen,x,y\n" + "".join(rows))
    options = ["--max-age", "90m", "--clock", "data", "--max-skew", "1m"]
    assert dynhull("create", name, "--keyed", "str", *options).exit_code == 0
    load = ["load", name, file, "--key", "id", "--time", "seen", "--producer", "p"]
    assert dynhull(*load).stdout == f"{name}: 3 points loaded (1 new, 2 moved), 1 in the hull\n"
    with HullClient(served) as client:
        assert client.last_sequence(name, "p") == 5
    done = dynhull(*load, "--resume")
    assert (done.exit_code, done.stdout) == (0, f"{name}: 0 points loaded\n")
    file.write_text("id,seen,x,y\n" + bad)
    done = dynhull("load", name, file, "--key", "id", "--time", "seen")
    assert (done.exit_code, f"has no points\n{file}: 1 bad row left out:\n  line 2: time is 2099" in done.stderr) == (
        2,
        True,
    )
