"""`dynhull explain` as a user runs it, and the steps that its pictures show."""

import json
import re
import subprocess
import sys

import pytest
from killers import KILLERS
from PIL import Image

from dynhull_cli.explain.page import MOST_STEPS
from dynhull_cli.explain.picture import places
from dynhull_cli.explain.steps import chosen, explained

EXAMPLE = [(0.0, 0.0), (4.0, 0.0), (5.0, 2.0), (4.0, 4.0), (2.0, 3.0), (0.0, 4.0), (1.0, 2.0), (2.0, 1.0)]
CORNERS = [(0.0, 0.0), (4.0, 0.0), (5.0, 2.0), (4.0, 4.0), (0.0, 4.0)]
ALGORITHMS = ["graham_scan", "jarvis_march", "chan", "monotone_chain"]


def explain(*arguments):
    command = [sys.executable, "-m", "dynhull_cli", "explain", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def example(tmp_path):
    path = tmp_path / "example.csv"
    path.write_text("x,y\n" + "".join(f"{x},{y}\n" for x, y in EXAMPLE))
    return path


def steps_in(page):
    data = json.loads(re.search(r"const data = (.*);\n", page.read_text(encoding="utf-8"))[1])
    names = data["names"]
    return data, [[names[i] for i in step.get("chain", [])] for step in data["steps"]]


def test_sheet(example, tmp_path):
    done = explain("graham_scan", example, "--out", tmp_path / "sheet.png")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == f"5 vertices, 13 steps: {tmp_path / 'sheet.png'}"
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.format == "PNG"
        assert len(sheet.convert("RGB").getcolors(10**6)) > 10


def test_animation(example, tmp_path):
    done = explain("chan", example, "--out", tmp_path / "animation.gif")
    assert done.returncode == 0, done.stderr
    steps = int(re.search(r"(\d+) steps", done.stdout)[1])
    with Image.open(tmp_path / "animation.gif") as animation:
        assert animation.format == "GIF"
        assert animation.n_frames >= steps


def test_page(example, tmp_path):
    done = explain("graham_scan", example, "--out", tmp_path / "page.html")
    assert done.returncode == 0, done.stderr
    data, chains = steps_in(tmp_path / "page.html")
    assert data["count"] == len(chains) == 13
    assert chains[-2] == ["(0.0, 0.0)", "(4.0, 0.0)", "(5.0, 2.0)", "(4.0, 4.0)"]
    assert data["steps"][-1]["caption"] == "the hull: 5 vertices"


def test_a_name_cannot_end_the_script(tmp_path):
    path = tmp_path / "<script>.csv"
    path.write_text("x,y\n0,0\n1,1\n")
    assert explain("chan", path, "--out", tmp_path / "page.html").returncode == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count("<script>") == 1
    assert steps_in(tmp_path / "page.html")[0]["title"] == "chan: <script>.csv"


def test_long_traces_are_thinned_out_and_say_so(tmp_path):
    path = tmp_path / "many.csv"
    path.write_text("lon,lat\n" + "".join(f"{i},{i * i}\n" for i in range(700)))
    done = explain("monotone_chain", path, "--out", tmp_path / "page.html")
    assert done.stdout.splitlines()[-1].endswith(f"2,000 of them drawn: {tmp_path / 'page.html'}")
    data, _ = steps_in(tmp_path / "page.html")
    assert len(data["steps"]) == MOST_STEPS
    assert [data["steps"][0]["number"], data["steps"][-1]["number"]] == [1, data["count"]]
    assert chosen(5, 9) == [0, 1, 2, 3, 4]
    assert chosen(9, 5) == [0, 2, 4, 6, 8]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["graham_scan", "FILE", "--out", "picture.bmp"], "the name must end in .png, .gif or .html"),
        (["graham_scan", "FILE", "--x", "east"], "FILE has no column 'east' (--x); it has x, y"),
        (["quickhull", "FILE"], "quickhull"),
    ],
)
def test_what_cannot_be_drawn_is_refused(example, arguments, message):
    done = explain(*[str(example) if argument == "FILE" else argument for argument in arguments])
    assert done.returncode == 2
    assert message.replace("FILE", str(example)) in done.stderr
    assert "Traceback" not in done.stderr


def test_steps_of_the_worked_example():
    steps = explained("graham_scan", EXAMPLE, "drop")
    turns = [step for step in steps if step.triple]
    assert [step.caption.split("\n")[0] for step in turns] == [
        "cross product 8: left",
        "cross product 5: left",
        "cross product -7: right",
        "cross product 4: left",
        "cross product 5: left",
        "cross product 1: left",
        "cross product -3: right",
        "cross product -4: right",
        "cross product 8: left",
    ]
    pops = [step.caption.split("\n")[1] for step in turns if "pop" in step.caption]
    assert pops == ["pop (2, 1)", "pop (1, 2)", "pop (2, 3)"]
    assert turns[-1].discarded == ((2.0, 1.0), (1.0, 2.0), (2.0, 3.0))
    assert list(steps[-1].hull) == CORNERS


@pytest.mark.parametrize("collinear", ["drop", "keep"])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("name", ["subnormals and ones", "the largest doubles", "one vertical line", "signed zeros"])
def test_every_trace_can_be_drawn(algorithm, collinear, name):
    rows = list(dict.fromkeys((x + 0.0, y + 0.0) for x, y in KILLERS[name]))
    where = places(rows)
    assert all(-1 <= coordinate <= 1 for place in where.values() for coordinate in place)
    steps = explained(algorithm, rows, collinear)
    assert steps[-1].hull
    for step in steps:
        drawn = [*step.chain, *step.discarded, *step.triple, *step.tangents, *step.hull, *step.order]
        assert all(p in where for chain in (*step.finished, *step.groups, drawn) for p in chain)
        assert "0: left" not in step.caption.replace("10: left", "")


def test_one_point_and_points_on_a_line(tmp_path):
    path = tmp_path / "line.csv"
    for text in ("x,y\n1,2\n", "x,y\n1e308,0\n-1e308,0\n0,0\n"):
        path.write_text(text)
        for name in ("a.png", "a.html"):
            done = explain("jarvis_march", path, "--collinear", "keep", "--out", tmp_path / name)
            assert done.returncode == 0, done.stderr
