"""`dynhull fences` as users run it."""

import json
import subprocess
from pathlib import Path

import pytest
from command_line import dynhull, on_a_terminal
from forked import COMMAND, Process
from patience import PATIENCE

GEOJSON = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 3], [0, 0]]]}}
TRIANGLE = "POLYGON ((0 0, 4 0, 4 3, 0 0))"


def test_the_help_lists_the_commands() -> None:
    shown = dynhull("fences").stdout
    for command in ("create", "list", "show", "inside", "watch", "ack", "between", "replace", "delete"):
        assert f"│ {command} " in shown
        assert dynhull("fences", command, "--help").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--subjects", "a"], "give one of --area, --polygon and --circle, got none of them"),
        (["--area", "b", "--circle", 0, 0, 1, "--subjects", "a"], "got --area and --circle"),
        (["--area", "b"], "give one of --subjects, --subject-prefix and --other-hull, got none of them"),
        (["--circle", 0, 0, -1, "--subjects", "a"], "the circle's r is -1.0: must be at least 0"),
        (["--polygon", "nowhere.geojson", "--subjects", "a"], "nowhere.geojson: No such file or directory"),
        (["--polygon", "POLYGON ((0 0, 1", "--subjects", "a"], "--polygon is not WKT: "),
        (["--polygon", TRIANGLE, "--subjects", "a", "--dwell", "soon"], "--dwell 'soon' is not a time span"),
        (["--polygon", TRIANGLE, "--subjects", "a", "--without-self"], "without_self is for an area that is a hull"),
    ],
)
def test_bad_settings_are_named(arguments: list[object], complaint: str) -> None:
    done = dynhull("fences", "create", "zone", "--address", "127.0.0.1:1", *arguments)
    assert done.exit_code == 2
    assert complaint in done.stderr


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{", "bad.json is neither GeoJSON nor WKT: "),
        ("[1, 2]", "bad.json is not GeoJSON: it must be an object with a type"),
        ('{"type": "Point", "coordinates": [1, 2]}', "area is of the type 'Point': must be a Polygon"),
        ("MULTIPOLYGON (((0 0", "bad.json is not WKT: "),
    ],
)
def test_bad_files_are_named(text: str, complaint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.json").write_text(text)
    done = dynhull("fences", "create", "zone", "--address", "127.0.0.1:1", "--polygon", "bad.json", "--subjects", "a")
    assert done.exit_code == 2
    assert complaint in done.stderr


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize(("kind", "keys"), [("str", ["a", "b"]), ("int", [7, 8])])
def test_expected_keys_are_of_the_kind_of_the_hull(name: str, kind: str, keys: list[object]) -> None:
    dynhull("create", name, "--keyed", kind)
    given = [word for key in keys for word in ("--expected", key)]
    options = ["--circle", 0, 0, 1, "--subjects", name, *given, "--expected-within", "2h", "--by-accuracy"]
    made = dynhull("fences", "create", name, *options, "--json")
    assert (json.loads(made.stdout)["expected"], json.loads(made.stdout)["expected_within"]) == (keys, 7200.0)
    assert "by accuracy, expected within 2h, expects 2 keys" in dynhull("fences", "show", name).stdout
    refused = dynhull("fences", "replace", name, "--circle", 0, 0, 1, "--subjects", name, "--expected", keys[0])
    assert refused.exit_code != 0
    assert "expected" in refused.stderr


def test_ack_needs_a_name() -> None:
    done = dynhull("fences", "watch", "zone", "--ack", "--address", "127.0.0.1:1")
    assert (done.exit_code, done.stderr) == (2, "error: --ack needs --consumer: who acknowledges?\n")


def ran(*arguments: object) -> list[str]:
    """The lines that `dynhull fences` prints; it must succeed."""
    done = dynhull("fences", *arguments)
    assert done.exit_code == 0, done.stderr
    return done.stdout.splitlines()


def move(name: str, key: str, x: float, y: float) -> None:
    assert dynhull("put", name, key, x, y).exit_code == 0


@pytest.mark.usefixtures("served")
def test_the_life_of_a_fence(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert dynhull("create", name, "--keyed", "str").exit_code == 0
    move(name, "truck", 3, 1)
    create = ("create", name, "--polygon", TRIANGLE, "--subjects", name)
    assert ran(*create) == [f"{name}: created, 1 inside"]
    assert dynhull("fences", *create).exit_code == 1
    assert ran(*create, "--exist-ok") == [f"{name}: exists, 1 inside"]
    move(name, "truck", 9, 9)

    assert ran("list", name) == [f"{name}\tpolygon, 3 corners\t{name}\t0\t2\t0"]
    (listed,) = ran("list", name, "--json")
    (shown,) = ran("show", name, "--json")
    assert json.loads(listed) == json.loads(shown)
    assert json.loads(shown)["area"]["coordinates"] == [[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 0.0]]]

    lines = [json.loads(line) for line in ran("watch", name, "--after", 0, "--events", 2, "--json")]
    assert [(line["type"], line["sequence"]) for line in lines] == [("snapshot", 1), ("exit", 2)]
    assert lines[0]["inside"] == [{"hull": name, "keys": ["truck"], "revision": 1}]
    assert (lines[1]["key"], lines[1]["position"], lines[1]["cause"]) == ("truck", [9.0, 9.0], ["subject_moved"])

    watch = ("watch", name, "--consumer", "alarm", "--events", 1, "--ack")
    assert ran(*watch)[0].split("\t")[2:5] == ["snapshot", "", "1 key"]
    assert ran(*watch)[0].split("\t")[2:] == ["exit", name, "truck", "9.0", "9.0", "subject_moved"]
    assert ran("ack", name, "other", 1) == ["other: acknowledged 1, 1 event to come"]
    assert "consumer\talarm: acknowledged 2, 0 events to come" in ran("show", name)

    move(name, "truck", 3, 1)
    assert ran("inside", name) == [f"{name}\ttruck"]
    monkeypatch.chdir(tmp_path)
    file = Path("polygon.geojson")  # which begins as WKT does
    file.write_text(json.dumps(GEOJSON))
    assert ran("replace", name, "--polygon", file, "--subjects", name) == [f"{name}: replaced, 1 inside"]
    assert ran("replace", name, "--circle", 0, 0, 1, "--subjects", name) == [f"{name}: replaced, 0 inside"]
    (inside,) = ran("inside", name, "--json")
    assert json.loads(inside) == {"sequence": 4, "subjects": []}

    unsure = dynhull("fences", "delete", name)
    assert (unsure.exit_code, "add --yes to delete" in unsure.stderr) == (2, True)
    assert ran("delete", name, "--yes") == [f"{name}: deleted"]
    assert ran("delete", name, "--yes", "--missing-ok") == []
    missing = dynhull("fences", "show", name)
    assert missing.exit_code == 1
    assert "`dynhull fences list` shows the fences of the server" in missing.stderr


@pytest.mark.usefixtures("served")
def test_a_radius_on_the_globe_is_in_metres(name: str) -> None:
    assert dynhull("create", name, "--keyed", "str", "--geographic", "--center", "13,52").exit_code == 0
    ran("create", name, "--circle", 13.4, 52.5, 20000, "--subjects", name)
    assert ran("show", name)[0] == "area\tcircle around (13.4, 52.5), radius 20 km"
    ran("create", f"{name}-all", "--circle", 13.4, 52.5, 20000, "--subject-prefix", name)
    assert ran("show", f"{name}-all")[0].endswith("radius 20 km")
    ran("delete", f"{name}-all", "--yes")
    assert dynhull("create", f"{name}-plane", "--keyed", "str").exit_code == 0
    ran("create", f"{name}-plane", "--circle", 13.4, 52.5, 0.2, "--subjects", f"{name}-plane")
    assert ran("show", f"{name}-plane")[0].endswith("radius 0.2")


@pytest.mark.parametrize(
    ("polygon", "problem"),
    [
        ("POLYGON ((0 0, 4 0, 4 3, 0 0)", "1 ) missing at the end, after character 29"),
        ("POLYGON (0 0), 4 0, 4 3, 0 0))", "character 29 is a ) without its ("),
        ("POLYGON ((0 0, 4 O, 4 3, 0 0))", "character 18: 'O' is not a number"),
        ("POLYGON ((0 0 4 0, 4 3, 0,0))", "corners are X Y with commas between them, as in POLYGON ((0 0, 4 0,"),
        ("POLYGON ((0 0, 4 0, 4 3))", "form a closed"),
    ],
)
def test_a_slip_in_wkt_is_named_with_its_place(served: str, polygon: str, problem: str) -> None:  # noqa: ARG001
    done = dynhull("fences", "create", "depot", "--polygon", polygon, "--subjects", "vehicles")
    assert done.exit_code == 2
    assert done.stderr.startswith("error: --polygon is not WKT: "), done.stderr
    assert problem in done.stderr
    assert "Exception" not in done.stderr


@pytest.mark.usefixtures("served")
def test_a_closed_pipe_ends_a_watch_with_success(name: str) -> None:
    assert dynhull("create", name, "--keyed", "str").exit_code == 0
    ran("create", name, "--polygon", TRIANGLE, "--subjects", name)
    with Process([COMMAND, "fences", "watch", name, "--after", "0"], stdout=subprocess.PIPE, text=True) as watch:
        assert watch.stdout.readline().split("\t")[2] == "snapshot"
        watch.stdout.close()
        assert watch.wait(PATIENCE) == 0


@pytest.mark.usefixtures("served")
def test_a_terminal_shows_a_table_and_asks(name: str) -> None:
    assert dynhull("create", name, "--keyed", "str").exit_code == 0
    ran("create", name, "--circle", 0, 0, 1, "--subjects", name)
    code, shown = on_a_terminal("fences", "list", name)
    assert code == 0
    assert "last event" in shown
    code, shown = on_a_terminal("fences", "delete", name, answer=b"n\n")
    assert code == 1
    assert "nothing was deleted" in shown
    code, shown = on_a_terminal("fences", "delete", name, answer=b"y\n")
    assert code == 0
    assert f"{name}: deleted" in shown
