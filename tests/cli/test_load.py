"""`dynhull load`: the hull gets every point of the file once, after any failure on the way."""

import ctypes
import hashlib
import json
import signal
import subprocess
import sys
from contextlib import suppress
from decimal import Decimal
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from cases import slow
from command_line import dynhull
from forked import COMMAND, Process
from patience import wait_until
from server_process import run, server_process

from dynhull import convex_hull
from dynhull_client import HullClient

POINTS = np.concatenate((np.random.default_rng(8).normal(size=(20_000, 2)), [[1e308, -5e-324], [0.1, 0.2], [0.1, 0.2]]))


def write(path, points):
    x, y = points.T
    match path.suffix:
        case ".csv":
            path.write_text("name,x,y\n" + "".join(f'"a, b",{p!r},{q!r}\n' for p, q in points.tolist()))
        case ".parquet":
            pq.write_table(pa.table({"y": y, "name": ["a"] * len(x), "x": x}), path)
        case ".ndjson":
            rows = [json.dumps({"x": p, "y": q}) for p, q in points[:100].tolist()]
            rows += [json.dumps(each) for each in points[100:].tolist()]
            path.write_text("\n".join(rows))
        case ".geojson":
            shapes = [{"type": "Point", "coordinates": each} for each in points.tolist()]
            features = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in shapes]
            path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))


def holds(address, name, points):
    with HullClient(address) as client:
        hull = client.get_hull(name)
        assert hull.info.points == len(points)
        assert hull.vertices.tolist() == convex_hull(points).tolist()
        assert client.count(name, points).counts.all()
        assert client.verify(name, timeout=60).equal


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".ndjson", ".geojson"])
def test_every_format(tmp_path, served, name, suffix):
    file = tmp_path / f"points{suffix}"
    write(file, POINTS)
    of_geojson = suffix == ".geojson"
    done = dynhull("load", name, file, *(["--plane"] if of_geojson else []))
    assert (done.exit_code, done.stdout) == (0, f"{name}: 20,003 points loaded, 20,003 in the hull\n"), done.stderr
    words = f"{name}: a new hull in the plane, in square degrees; --geographic makes it one on the globe\n"
    assert done.stderr == (words if of_geojson else "")  # whose coordinates are degrees
    holds(served, name, POINTS)


@pytest.mark.parametrize(("kind", "suffix"), [("csv", ".csv"), ("ndjson", ".ndjson"), ("geojson", ".geojson")])
def test_standard_input(tmp_path, served, name, kind, suffix):
    file = tmp_path / f"points{suffix}"
    write(file, POINTS[:200])
    done = dynhull("load", name, "-", "--format", kind, input=file.read_bytes())
    assert done.exit_code == 0, done.stderr
    holds(served, name, POINTS[:200])


def test_columns_by_name(tmp_path, served, name):
    file = tmp_path / "points.csv"
    file.write_text("x,y,east,north\n0,0,1,2\n")
    assert dynhull("load", name, file, "--x", "east", "--y", "north").exit_code == 0
    with HullClient(served) as client:
        assert client.get_hull(name).vertices.tolist() == [[1, 2]]


BAD_CSV = """x,y
1,2
nan,1
"3
and more",5

4,five
5,
6,inf
7
8,9
"""
BAD_CSV_REASONS = [
    ("line 3", "x is 'nan', not finite"),
    ("line 4", "x is '3\\nand more', not a number"),
    ("line 7", "y is 'five', not a number"),
    ("line 8", "y is missing"),
    ("line 9", "y is 'inf', not finite"),
    ("line 10", "y is missing"),
]
BAD_LINES = """{"x": 1, "y": 2}
{"x": "one", "y": 2}
{"x": 1
7
{"y": 2}
{"type": "Feature", "geometry": {"type": "Polygon"}}
[8, NaN]
[8, 9]
"""
BAD_LINES_REASONS = [
    ("line 2", "x is 'one', not a number"),
    ("line 3", "not valid JSON at column 9: Expecting ',' delimiter"),
    ("line 4", "neither an object nor an array"),
    ("line 5", "x is missing"),
    ("line 6", "its geometry is Polygon, not a Point (--vertices takes the vertices of every geometry)"),
    ("line 7", "y is nan, not finite"),
]


@pytest.mark.parametrize(
    ("suffix", "text", "reasons"), [("csv", BAD_CSV, BAD_CSV_REASONS), ("ndjson", BAD_LINES, BAD_LINES_REASONS)]
)
def test_bad_rows_are_counted_shown_and_kept(tmp_path, served, name, suffix, text, reasons):
    file, kept = tmp_path / f"points.{suffix}", tmp_path / "bad.csv"
    file.write_text(text)
    done = dynhull("load", name, file, "--bad-rows", kept)
    assert done.exit_code == 0
    assert done.stdout == f"{name}: 2 points loaded, 2 in the hull\n"
    shown = "\n".join(f"  {place}: {reason}" for place, reason in reasons[:5])
    assert done.stderr == f"{file}: 6 bad rows left out:\n{shown}\n  ... and 1 more\n"
    rows = kept.read_text()
    assert all(f"{place}," in rows for place, _ in reasons)
    done = dynhull("load", name, file, "--max-bad", 5, "--again")
    assert done.exit_code == 2
    assert "more than 5 bad rows (--max-bad)" in done.stderr
    with HullClient(served) as client:
        assert client.get_hull(name).vertices.tolist() == [[1, 2], [8, 9]]
        assert client.get_hull(name).info.points == 2


@pytest.mark.usefixtures("served")
def test_bad_rows_of_parquet(tmp_path, name):
    file = tmp_path / "points.parquet"
    pq.write_table(pa.table({"x": [1.0, None, 3.0], "y": [1.0, 2.0, float("nan")]}), file)
    done = dynhull("load", name, file)
    assert done.stderr == f"{file}: 2 bad rows left out:\n  row 2: x is missing\n  row 3: y is nan, not finite\n"


LARGE = 2**53 + 1  # no double has it


@pytest.mark.parametrize("kind", ["int64", "decimal", "csv", "json", "ndjson", "geojson"])
def test_integers_that_are_no_doubles_are_bad_rows(tmp_path, served, name, kind):
    numbers = [LARGE, 2**53, 2**53 + 2, -LARGE, 1]
    file = tmp_path / f"a.{kind if 'json' in kind or kind == 'csv' else 'parquet'}"
    match kind:
        case "int64":
            pq.write_table(pa.table({"x": numbers, "y": [0] * 5}), file)
        case "decimal":
            wide = pa.array(list(map(Decimal, numbers)), pa.decimal128(38, 4))
            pq.write_table(pa.table({"x": wide, "y": pa.array([Decimal("0.5")] * 5, pa.decimal128(9, 4))}), file)
        case "csv":
            file.write_text("x,y\n" + "".join(f"{each},0\n" for each in numbers))
        case "geojson":
            shapes = [{"type": "Point", "coordinates": [each, 0]} for each in numbers]
            rows = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in shapes]
            file.write_text(json.dumps({"type": "FeatureCollection", "features": rows}))
        case _:
            rows = [json.dumps([each, 0]) for each in numbers]
            file.write_text("[" + ",".join(rows) + "]" if kind == "json" else "\n".join(rows))
    done = dynhull("load", name, file, "--plane", "--json")
    assert json.loads(done.stdout)["bad_rows"] == 2, done.stderr
    unit = {"csv": "line", "ndjson": "line", "json": "item", "geojson": "feature"}.get(kind, "row")
    first, second = (2, 5) if kind == "csv" else (1, 4)
    assert f"{file}: 2 bad rows left out:\n  {unit} {first}: x is {LARGE}" in done.stderr
    assert f"  {unit} {second}: x is -{LARGE}" in done.stderr
    assert "which is not a double: integers are exact up to 2**53" in done.stderr
    with HullClient(served) as client:
        assert max(client.get_hull(name).vertices[:, 0].tolist()) == 2**53 + 2


@pytest.mark.parametrize(
    ("file", "content", "options", "message"),
    [
        ("a.csv", "", [], "a.csv is empty"),
        ("a.csv", "x,y\n", [], "a.csv has no points"),
        ("a.csv", "x,y\na,b\n", [], "line 2: x is 'a', not a number"),
        ("a.csv", "a,b\n1,2\n", [], "name two with --x and --y; it has a, b"),
        ("a.csv", "a,b\n1,2\n", ["--x", "a", "--y", "c"], "has no column 'c' (--y); it has a, b"),
        ("a.geojson", '{"type": "FeatureCollection", "features": []}', [], "has no points"),
        ("a.geojson", '{"features": [', [], "error: a.geojson is not valid JSON after 0 features: premature EOF\n"),
        (
            "a.json",
            '[{"x": 1, "y": 2}, {"x": nope}]',
            [],
            "error: a.json is not valid JSON after 1 item: invalid string in json text, near [{",
        ),
        ("a.json", f"[[1e400, 1], [{'9' * 5000}, 1]]", [], "  item 1: x is 1E+400, not finite\n  item 2: x is 999"),
        ("a.ndjson", '{"x": 1, "y": }\n\n', [], "  line 1: not valid JSON at column 15: Expecting value\n"),
        ("a.parquet", "x,y\n1,2\n", [], "a.parquet is not a Parquet file"),
        ("a.xls", "", [], "the name must end in .csv, .tsv, .parquet, .json, .geojson, .ndjson, .gpkg, .shp,"),
        ("a.csv", "x,y\n1,2\n", ["--resume", "--again"], "give one"),
    ],
)
def test_unusable_files_say_what_to_do(tmp_path, monkeypatch, served, name, file, content, options, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / file).write_text(content)
    done = dynhull("load", name, file, *options)
    assert done.exit_code == 2
    assert message in done.stderr
    with HullClient(served) as client:
        assert list(client.list_hulls(name)) == []


@pytest.mark.usefixtures("served")
def test_other_unusable_input(tmp_path, name):
    done = dynhull("load", name, tmp_path / "none.csv")
    assert (done.exit_code, done.stderr) == (2, f"error: {tmp_path / 'none.csv'}: No such file or directory\n")
    text = tmp_path / "text.parquet"
    pq.write_table(pa.table({"x": ["1"], "y": [2.0]}), text)
    done = dynhull("load", name, text)
    assert (done.exit_code, done.stderr) == (2, f"error: {text}: column x holds string, not numbers\n")
    done = dynhull("load", name, "--resume", input="x,y\n1,2\n")
    assert done.exit_code == 2
    assert "give --producer NAME" in done.stderr


def test_a_file_is_loaded_once_unless_told_otherwise(tmp_path, served, name):
    file = tmp_path / "points.csv"
    write(file, POINTS[:10])
    for options, code, points in ([], 0, 10), ([], 2, 10), (["--resume"], 0, 10), (["--again"], 0, 20):
        done = dynhull("load", name, file, *options)
        assert done.exit_code == code
        with HullClient(served) as client:
            assert client.get_hull(name).info.points == points
    assert "adding to it" in done.stderr


def test_a_load_keeps_the_name_that_earlier_versions_gave_it(tmp_path, served, name):
    """Otherwise a file that was loaded then could be loaded twice now."""
    file = tmp_path / "points.csv"
    file.write_text("x,y\n1,2\n")
    assert dynhull("load", name, file).exit_code == 0
    digest = hashlib.sha256(b"x,y\n1,2\n" + b"csv None None").hexdigest()
    with HullClient(served) as client:
        assert client.last_sequence(name, f"load-{digest[:32]}") == 1


@slow
def test_resume_after_the_command_was_killed(tmp_path, served, name):
    points = np.random.default_rng(9).normal(size=(60_000, 2))
    file = tmp_path / "points.csv"
    write(file, points)
    options = ("--producer", "p")
    with (
        HullClient(served) as client,
        Process([COMMAND, "load", name, "-", *options], stdin=subprocess.PIPE, stderr=subprocess.DEVNULL) as loading,
    ):
        loading.stdin.write(file.read_bytes())  # what does not end is not loaded to its end
        loading.stdin.flush()
        wait_until(lambda: any(info.revision >= 2 for info in client.list_hulls(name)))
        loading.kill()
        loading.wait()
        wait_until(lambda: client.get_hull(name).revision == client.get_hull(name).revision)
        revision = client.get_hull(name).revision
        assert revision <= len(points) // 8192
    refused = dynhull("load", name, file, *options)
    assert refused.exit_code == 2
    assert "--resume loads what is missing" in refused.stderr
    done = dynhull("load", name, file, *options, "--resume")
    assert done.exit_code == 0, done.stderr
    missing = len(points) - 8192 * revision
    assert done.stdout == f"{name}: {missing:,} points loaded, 60,000 in the hull\n"
    holds(served, name, points)


def test_a_server_that_goes_and_comes_back(tmp_path):
    """First the server is down for too long, then it is back in time."""
    data = ("--data", str(tmp_path / "data"))
    rows = "".join(f"{x!r},{y!r}\n" for x, y in np.random.default_rng(1).normal(size=(16_384, 2)).tolist())
    load = ["load", "a", "-", "--producer", "p"]
    with server_process(*data, killed=True) as server, HullClient(server.address) as client:
        command = [COMMAND, *load, "--address", server.address, "--patience", "0.5"]
        with Process(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as loading:
            loading.stdin.write("x,y\n" + rows)
            loading.stdin.flush()
            wait_until(lambda: any(info.revision >= 1 for info in client.list_hulls()))
            server.process.kill()
            server.process.wait()
            with suppress(BrokenPipeError):  # it may have given up before it has read everything
                loading.stdin.write(rows)
                loading.stdin.close()
            said = loading.stderr.read()
            assert loading.wait() == 3
    assert "The same command with --resume loads the rest" in said
    assert f"no answer from {server.address}" in said
    with server_process(*data) as server:
        done = run(*load, "--address", server.address, "--resume", given="x,y\n" + rows * 2)
        assert done.returncode == 0, done.stderr
        with HullClient(server.address) as client:
            assert client.get_hull("a").info.points == 32_768


def interrupt_process(process):
    process.send_signal(signal.SIGINT)


def interrupt_another_thread(process):
    """As if the signal had come between the last look at signals and a wait for input, which it does not end then."""
    threads = {int(each.name) for each in Path(f"/proc/{process.pid}/task").iterdir()} - {process.pid}
    assert ctypes.CDLL(None).tgkill(process.pid, min(threads), signal.SIGINT) == 0


HAS_TGKILL = sys.platform == "linux" and hasattr(ctypes.CDLL(None), "tgkill")
OTHER = pytest.param(interrupt_another_thread, marks=pytest.mark.skipif(not HAS_TGKILL, reason="needs tgkill of Linux"))


@pytest.mark.parametrize("interrupt", [interrupt_process, OTHER])
def test_an_interruption(served, name, interrupt):
    command = [COMMAND, "load", name, "-", "--producer", "p"]
    with (
        HullClient(served) as client,
        Process(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as loading,
    ):
        loading.stdin.write("x,y\n" + "1,2\n" * 120_000)
        loading.stdin.flush()
        wait_until(lambda: any(info.revision >= 1 for info in client.list_hulls(name)))
        interrupt(loading)
        said = loading.stderr.read()
        assert loading.wait() == 130
    assert "--resume loads the rest" in said
    assert "Traceback" not in said


@pytest.mark.parametrize("dry", [(), ("--dry-run",)])
@pytest.mark.parametrize("other_name", [False, True])
def test_the_file_of_bad_rows_is_not_the_one_that_is_loaded(tmp_path, served, name, dry, other_name):
    file = tmp_path / "points.csv"
    file.write_text("x,y\n1,2\nbad,3\n")
    kept = file
    if other_name:
        kept = tmp_path / "link.csv"
        kept.symlink_to(file)
    done = dynhull("load", name, file, "--bad-rows", kept, *dry, "--address", served)
    assert done.exit_code == 2
    assert f"--bad-rows {kept} is the file that is loaded" in done.stderr
    assert file.read_text() == "x,y\n1,2\nbad,3\n"


def test_rows_with_more_fields_than_columns_are_bad(tmp_path, name):
    file = tmp_path / "euro.csv"
    file.write_text("x,y\n1,2\n1,5,2,5\n3,4,\n")
    done = dynhull("load", name, file, "--dry-run")
    assert f"{name}: 2 points would be loaded, x from 1.0 to 3.0, y from 2.0 to 4.0" in done.stdout
    assert "line 3: 4 fields in a table of 2 columns" in done.stderr
    table = tmp_path / "fleet.csv"
    table.write_text("x,y\n1,2\n1,5,2,5\n")
    done = dynhull("demo", "--points", table, "--out", tmp_path / "picture.png")
    assert "line 3: 4 fields in a table of 2 columns" in done.stdout + done.stderr


def test_a_name_of_two_columns_is_not_clear(tmp_path, name):
    file = tmp_path / "twice.csv"
    file.write_text("x,x,y\n1,2,3\n")
    done = dynhull("load", name, file, "--dry-run")
    assert (done.exit_code, "name two with --x and --y; it has x, x, y" in done.stderr) == (2, True)
    done = dynhull("load", name, file, "--x", "x", "--y", "y", "--dry-run")
    assert (done.exit_code, "has 2 columns 'x': give the number of one with --x" in done.stderr) == (2, True)
    done = dynhull("load", name, file, "--x", "2", "--y", "y", "--dry-run")
    assert "x from 2.0 to 2.0, y from 3.0 to 3.0" in done.stdout
