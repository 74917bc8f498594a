"""`dynhull fences` as users run it."""

from pathlib import Path

import pytest
from command_line import dynhull

TRIANGLE = "POLYGON ((0 0, 4 0, 4 3, 0 0))"


def test_the_help_lists_the_commands() -> None:
    shown = dynhull("fences").stdout
    for command in ("create", "list", "show", "inside", "watch", "ack", "replace", "delete"):
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


def test_ack_needs_a_name() -> None:
    done = dynhull("fences", "watch", "zone", "--ack", "--address", "127.0.0.1:1")
    assert (done.exit_code, done.stderr) == (2, "error: --ack needs --consumer: who acknowledges?\n")
