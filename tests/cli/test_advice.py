"""Advice in error messages works: each piece is followed here."""

import ast
import gzip
import json
import re
import shlex
import signal
import subprocess
from itertools import count
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from cases import slow
from command_line import dynhull
from forked import COMMAND, Process
from patience import wait_until

import dynhull_cli
from dynhull_client import HullClient

COMMA = "x,y\n1,2\n3,4\n"
LINE = {"type": "LineString", "coordinates": [[1, 2], [3, 4]]}

# A command that fails, what its message advises, and the command or commands that follow the advice.
LOADS = [
    ("load {name} colons.csv", "--delimiter", "load {name} colons.csv --delimiter :"),
    ("load {name} utf16.csv", "--encoding utf-16-le", "load {name} utf16.csv --encoding utf-16-le"),
    ("load {name} utf16be.csv", "--encoding utf-16-be", "load {name} utf16be.csv --encoding utf-16-be"),
    ("load {name} three.csv", "--x 1 --y 2", "load {name} three.csv --x 1 --y 2"),
    ("load {name} years.csv", "add --header", "load {name} years.csv --header --x 2020 --y 2021"),
    ("load {name} named.csv", "name two with --x and --y; it has a, b", "load {name} named.csv --x a --y b"),
    ("load {name} named.csv --x a", "name its y column with --y", "load {name} named.csv --x a --y b"),
    ("load {name} named.csv --x a --y c", "'c' (--y); it has a, b", "load {name} named.csv --x a --y b"),
    ("load {name} line.ndjson", "--vertices takes", "load {name} line.ndjson --vertices"),
    ("load {name} bad.csv --max-bad 0", "more than 0 bad rows (--max-bad)", "load {name} bad.csv --max-bad 1"),
    ("load {name} points.dat", "give the format with --format", "load {name} points.dat --format csv"),
    ("load {name} points.csv --resume --again", "give one of them", "load {name} points.csv --resume"),
    ("load {name} - --resume", "give --producer NAME", "load {name} - --resume --producer pipe"),
    ("load {name} - --replace", "--replace reads its input twice", "load {name} points.csv --replace"),
    ("load {name} packed.parquet.gz", "with gunzip", "gunzip packed.parquet.gz; load {name} packed.parquet"),
    ("load {name} latin.csv", "--encoding cp1252", "load {name} latin.csv --encoding cp1252"),
    ("load {name} latin.csv", "--bad-rows FILE", "load {name} latin.csv --bad-rows bad.csv"),
    ("load {name} points.csv --decimal ;", "neither . nor ,", "load {name} points.csv --decimal ."),
    ("load {name} points.csv --delimiter ab", "--delimiter 'ab' is not", "load {name} commas.csv --delimiter ,"),
    ("load {name} points.csv --format nmea --vertices", "--vertices is for csv", "load {name} line.ndjson --vertices"),
    ("load loaded points.csv", "--resume loads", "load loaded points.csv --resume"),
    ("load loaded points.csv", "--again all", "load loaded points.csv --again"),
    (
        "load loaded points.csv --bad-rows points.csv",
        "--bad-rows points.csv is the file that is loaded, and would replace it: name another file",
        "load loaded points.csv --again --bad-rows bad.csv",
    ),
    ("load loaded points.csv", "--replace deletes", "load loaded points.csv --replace"),
    ("load loaded points.csv --key x", "leave out --key", "load loaded points.csv --again"),
    (
        "load {name} points.csv --time-unit s",
        "--time-unit is given with --time",
        "load {name} points.csv --key x --time y --time-unit s",
    ),
    (
        "load {name} points.csv --expires y",
        "--expires is given with --key",
        "load {name} points.csv --key x --expires y",
    ),
    (
        "load {name} points.csv --accuracy y",
        "--accuracy is given with --key",
        "load {name} points.csv --key x --accuracy y",
    ),
    (
        "load {name} points.csv --key x --expires y --ttl 5m",
        "--ttl and --expires both say when keys leave",
        "load {name} points.csv --key x --ttl 5m",
    ),
    ("query loaded vertices --keys", "leave out --keys", "query loaded vertices"),
    ("load {name} world.csv", "--replace --plane loads", "load {name} world.csv --replace --plane"),
    (
        "load {name} world.csv",
        "`dynhull create NAME --geographic --center LON,LAT` makes",
        "create {name}-2 --geographic --center 80,40; load {name}-2 half.csv",
    ),
    ("create {name} --center 1,2", "--center is given with --geographic", "create {name} --geographic --center 1,2"),
    ("create {name} --max-speed 5", "--max-speed is given with --keyed", "create {name} --max-speed 5 --keyed str"),
    (
        "create {name} --clamp",
        "--clamp is given with --max-age or --max-points or --max-skew",
        "create {name} --clamp --max-skew 1m --max-age 5m",
    ),
    (
        "create {name} --max-skew 1m",
        "--max-skew is given with --event-order or --max-age or --max-points",
        "create {name} --keyed str --event-order --max-skew 1m",
    ),
    ("insert {name} 1,2", "`dynhull list`", "list"),
    ("insert {name} 1,2", "`dynhull create`", "create {name}; insert {name} 1,2"),
    ("insert loaded", "as lines of standard input", "insert loaded -1,2"),
    ("remove loaded 1,2 8,8", "--missing-ok skips", "remove loaded 1,2 8,8 --missing-ok"),
    ("delete loaded", "add --yes", "delete loaded --yes"),
    ("list --address ftp://a", "Write HOST or HOST:PORT", "list --address {address}"),
    ("list --address 127.0.0.1:1", "is the address right (--address)", "list --address {address}"),
]
FOLLOWED_ELSEWHERE = {
    "--token": "test_commands.py: test_tokens",
    "--tls": "test_commands.py: test_tls",
    "--tls-ca": "test_commands.py: test_tls",
    "--point-limit": "test_hulls.py: test_what_cannot_be_done_changes_nothing",
    "--layer": "test_commands.py: test_layers_and_influence",
    "--out": "test_demo.py: test_hours_of_flights",
    "--client-cert": "test_commands.py: test_tls",
    "--client-key": "test_commands.py: test_tls",
    "dynhull serve": "every test with a server",
    "--config": "ogrinfo of GDAL",
    "--at": "test_pages.py: the page as-of",
    "--last": "test_series.py: the lines of an hour",
    "--history": "test_history.py: the past that a hull keeps",
    "--history-bytes": "test_history.py: the past that a hull keeps",
    "--help": "test_main.py: test_help_lists_the_commands",
    "--hull": "test_alarms.py: test_a_bad_condition_names_the_option",
    "--prefix": "test_commands.py: test_watch_of_many",
    "--speed": "test_demo.py: test_the_flights_live_until_ctrl_c",
    "--id": "test_table.py: the columns of the demo",
    "--time": "test_table.py: the columns of the demo",
    "--keys-of": "test_keyed.py: test_integer_keys_and_another_hull",
    "--live": "test_demo.py: test_the_flights_live_until_ctrl_c",
    "--window": "test_demo.py: test_the_positions_of_the_last_half_hour",
    "--points": "test_demo.py: test_points_of_ones_own",
    "--area": "test_fences.py: test_the_life_of_a_fence",
    "--consumer": "test_fences.py: test_the_life_of_a_fence",
    "--ack": "test_fences.py: test_the_life_of_a_fence",
    "--day": "test_demo.py: test_hours_of_flights",
    **dict.fromkeys(("--json", "--csv", "--geojson"), "test_past.py: test_faces_of_a_track"),
    **dict.fromkeys(
        ("--max-speed", "--max-growth", "--confirmations", "--off", "--all"),
        "test_quarantine.py: test_held_positions_are_listed_released_and_dropped",
    ),
    "iconv": "test_load_encodings.py: test_other_readers",
    "pip install": "by hand: needs an index of packages",
}
ADVICE = re.compile(r"--[a-z][a-z-]+|dynhull (?:list|create|serve|load)|pip install|iconv|gunzip")
IN_HELP = {"Option", "Argument", "_input", "_option", "_pem"}


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for file, text in {
        "points.csv": COMMA,
        "commas.csv": COMMA,
        "points.dat": COMMA,
        "colons.csv": COMMA.replace(",", ":"),
        "three.csv": "1,2,3\n4,5,6\n",
        "years.csv": "name,2020,2021\na,1,2\nb,3,4\n",
        "named.csv": "a,b\n1,2\n3,4\n",
        "bad.csv": COMMA + "5,six\n",
        "half.csv": "lon,lat\n0,40\n160,40\n",
        "world.csv": "lon,lat\n0,40\n160,40\n20,-50\n",
        "line.ndjson": json.dumps(LINE),
    }.items():
        Path(file).write_text(text)
    Path("utf16.csv").write_bytes(COMMA.encode("utf-16-le"))
    Path("utf16be.csv").write_bytes(COMMA.encode("utf-16-be"))
    Path("latin.csv").write_bytes("x,y,name\n1,2,ä\n3,4,a\n".encode("cp1252"))
    pq.write_table(pa.table({"x": [1.0, 3.0], "y": [2.0, 4.0]}), "points.parquet")
    Path("packed.parquet.gz").write_bytes(gzip.compress(Path("points.parquet").read_bytes()))


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize(("failing", "advice", "following"), LOADS, ids=count())
def test_following_the_advice_works(served, name, failing, advice, following):
    if "loaded" in failing:
        dynhull("load", f"{name}-loaded", "points.csv")

    def run(command):
        words = shlex.split(command.format(name=name, address=served).replace("loaded", f"{name}-loaded"), posix=True)
        if words[0] in ("gunzip", "iconv"):
            subprocess.run(words, check=True)
            return None
        return dynhull(*words, input=COMMA if "-" in words else "")

    done = run(failing.replace(" ;", " ';'"))
    assert done.exit_code != 0 or "bad row" in done.stderr
    assert advice in done.stderr
    for command in following.split("; "):
        done = run(command)
        assert done is None or (done.exit_code, "bad row" in done.stderr and "bad.csv" not in command) == (0, False)


@slow
@pytest.mark.usefixtures("files")
def test_a_pipe_is_written_to_a_file(served, name):
    for options in ("--format parquet", "--format parquet --replace"):
        command = f"cat points.parquet | {COMMAND} load {name} - {options} --address {served}"
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert "pipe" in done.stderr
        assert "write it to a file first" in done.stderr
    assert dynhull("load", name, "points.parquet", "--replace").exit_code == 0


def test_an_interrupted_load_says_how_to_go_on(tmp_path, served, name):
    rows = "".join(f"{i},{i * i}\n" for i in range(10_000))
    file = tmp_path / "points.csv"
    file.write_text("x,y\n" + rows + "1,two\n")
    done = dynhull("load", name, file, "--max-bad", 0)
    assert done.exit_code == 2
    (producer,) = re.findall(r"The same command with --resume loads the rest; .* add --producer (\S+)\.", done.stderr)
    file.write_text("x,y\n" + rows + "1,2\n")
    done = dynhull("load", name, file, "--max-bad", 0, "--resume", "--producer", producer)
    assert done.exit_code == 0, done.stderr
    with HullClient(served) as client:
        assert client.get_hull(name).info.points == 10_001


def test_an_interrupted_replacement_says_how_to_go_on(tmp_path, served, name):
    file = tmp_path / "points.csv"
    file.write_text("x,y\n" + "".join(f"{i},{i % 97}\n" for i in range(250_000)))
    command = [COMMAND, "load", name, file, "--replace"]
    with HullClient(served) as client, Process(command, stderr=subprocess.PIPE, text=True) as loading:
        wait_until(lambda: any(info.revision >= 1 for info in client.list_hulls(name)))
        loading.send_signal(signal.SIGINT)
        said = loading.stderr.read()
        assert loading.wait() == 130
        assert "The same command with --resume in place of --replace loads the rest" in said
        done = dynhull("load", name, file, "--resume")
        assert done.exit_code == 0, done.stderr
        assert client.get_hull(name).info.points == 250_000


def test_all_advice_is_known_here():
    followed = " ".join(advice + failing for failing, advice, _ in LOADS)
    followed += "--resume --producer" + " ".join(FOLLOWED_ELSEWHERE)
    folder = Path(dynhull_cli.__file__).parent
    found = {
        (path.name, piece)
        for path in folder.rglob("*.py")
        if "explain" not in path.parts
        for text in messages(ast.parse(path.read_bytes()))
        for piece in ADVICE.findall(text)
    }
    assert len(found) > 20
    assert {(path, piece) for path, piece in found if piece not in followed} == set()


def messages(node):
    """Sentences of a module that are neither docstrings nor help."""
    if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in IN_HELP:
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
        yield node.value
    for child in ast.iter_child_nodes(node):
        is_docstring = isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)
        if not is_docstring:
            yield from messages(child)
