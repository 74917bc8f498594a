"""`dynhull explain` as a user runs it, and the steps that its pictures show."""

import json
import re
import xml.etree.ElementTree as ET
from itertools import pairwise

import pytest
from cases import slow
from chromium import chromium
from command_line import dynhull
from killers import KILLERS
from patience import PATIENCE
from PIL import Image
from playwright.sync_api import expect

from dynhull import DynamicHull
from dynhull_cli.explain.page import MOST_STEPS
from dynhull_cli.explain.scene import chosen, places
from dynhull_cli.explain.static_scene import static_story
from dynhull_cli.explain.steps import explained
from dynhull_cli.explain.tree_scene import tree_story

EXAMPLE = [(0.0, 0.0), (4.0, 0.0), (5.0, 2.0), (4.0, 4.0), (2.0, 3.0), (0.0, 4.0), (1.0, 2.0), (2.0, 1.0)]
CORNERS = [(0.0, 0.0), (4.0, 0.0), (5.0, 2.0), (4.0, 4.0), (0.0, 4.0)]
ALGORITHMS = ["graham_scan", "jarvis_march", "chan", "monotone_chain"]


def explain(*arguments):
    return dynhull("explain", *arguments)


@pytest.fixture
def example(tmp_path):
    path = tmp_path / "example.csv"
    path.write_text("x,y\n" + "".join(f"{x},{y}\n" for x, y in EXAMPLE))
    return path


def steps_in(page, style="chain"):
    """A page's data, and for each step the coordinates of its marks of one style."""
    data = json.loads(re.search(r"const data = (.*);\n", page.read_text(encoding="utf-8"))[1])
    names = data["names"]
    return data, [
        [names[i] for name, indices, *_ in step["marks"] if name == style for i in indices] for step in data["steps"]
    ]


def test_sheet(example, tmp_path):
    done = explain("graham_scan", example, "--out", tmp_path / "sheet.png")
    assert done.exit_code == 0, done.stderr
    assert done.stdout.splitlines()[-1] == f"5 vertices, 13 steps: {tmp_path / 'sheet.png'}"
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.format == "PNG"
        assert len(sheet.convert("RGB").getcolors(10**6)) > 10


def test_vector_sheet(example, tmp_path):
    """The SVG holds text as text, and equal points give equal files."""
    assert explain("graham_scan", example, "--out", tmp_path / "a.svg").exit_code == 0
    drawing = ET.fromstring((tmp_path / "a.svg").read_text(encoding="utf-8"))
    words = {element.text for element in drawing.iter("{http://www.w3.org/2000/svg}text")}
    assert {"graham_scan: example.csv", "13/13  the hull: 5 vertices"} <= words
    from dynhull_cli.explain.picture import draw_sheet  # not by each process that collects tests

    draw_sheet(tmp_path / "b.SVG", static_story("graham_scan", "example.csv", EXAMPLE, "drop"))
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.SVG").read_bytes()


@slow
def test_animation(tmp_path):
    square = tmp_path / "square.csv"
    square.write_text("x,y\n0,0\n4,0\n4,4\n0,4\n")
    done = explain("chan", square, "--out", tmp_path / "animation.gif")
    assert done.exit_code == 0, done.stderr
    steps = int(re.search(r"(\d+) steps", done.stdout)[1])
    with Image.open(tmp_path / "animation.gif") as animation:
        assert animation.format == "GIF"
        assert animation.n_frames >= steps


def test_page(example, tmp_path):
    done = explain("graham_scan", example, "--out", tmp_path / "page.html")
    assert done.exit_code == 0, done.stderr
    data, chains = steps_in(tmp_path / "page.html")
    assert data["count"] == len(chains) == 13
    assert chains[-2] == ["(0.0, 0.0)", "(4.0, 0.0)", "(5.0, 2.0)", "(4.0, 4.0)"]
    assert data["steps"][-1]["caption"] == "the hull: 5 vertices"


def test_the_beginning_of_a_name_is_enough(example, tmp_path):
    assert explain("graham", example, "--out", tmp_path / "page.html").exit_code == 0
    assert steps_in(tmp_path / "page.html")[0]["title"] == "graham_scan: example.csv"


def test_the_tree_of_the_example(tmp_path):
    done = explain("tree", "--out", tmp_path / "page.html")
    assert done.exit_code == 0, done.stderr
    assert done.stdout == f"8 updates, 30 steps: {tmp_path / 'page.html'}\n"
    data, bridges = steps_in(tmp_path / "page.html", "new bridge")
    captions = [step["caption"] for step in data["steps"]]
    assert captions[:3] == [
        "the tree of the first 12 points",
        "insert (8, 9.5):\nis on its leaf's upper and lower chain",
        "the upper bridge is now\nthe tangent from the point",
    ]
    assert bridges[2] == ["(2, 9)", "(8, 9.5)"]
    assert steps_in(tmp_path / "page.html", "old bridge")[1][2] == ["(2, 9)", "(5, 6)"]


def test_the_page_in_a_browser(tmp_path):
    """Keys move through the steps; a point shows its coordinates; the console stays empty."""
    assert explain("tree", "--out", tmp_path / "page.html").exit_code == 0
    said = []
    with chromium() as browser:
        page = browser.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto((tmp_path / "page.html").as_uri())
        expect.set_options(timeout=1000 * PATIENCE)
        expect(page.locator("#caption")).to_have_text("1/30 the tree of the first 12 points")
        expect(page.locator("polyline[stroke-dasharray]")).to_have_count(0)
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowRight")
        expect(page.locator("#caption")).to_have_text("3/30 the upper bridge is now the tangent from the point")
        expect(page.locator("polyline[stroke-dasharray]")).to_have_count(1)
        expect(page.locator("#drawing title", has_text="(8, 9.5)")).not_to_have_count(0)
        expect(page.locator(".legend")).to_contain_text("old bridge")
    assert not said


def test_the_tree_of_own_points(example, tmp_path):
    """Six of eight points are there at first; the last two come and the first two go."""
    done = explain("tree", example, "--out", tmp_path / "page.html")
    assert done.stdout.splitlines()[-1].startswith("4 updates, ")
    data, points = steps_in(tmp_path / "page.html", "point")
    assert data["title"] == "tree: example.csv"
    assert set(points[0]) - {""} == {repr(p) for p in EXAMPLE[:6]}
    assert set(points[-1]) - {""} == {repr(p) for p in EXAMPLE[2:]}


@pytest.mark.parametrize("count", [1, 2, 5, 30])
def test_the_tree_shows_the_hull_of_its_points(count):
    """Some of the points are equal."""
    points = [(float(i * i % 11), float(i * 7 % 13)) for i in range(count)] + [(1.0, 1.0)] * 3
    story = tree_story("points", points)
    position = {name: place for place, name in story.names.items()}
    first = len(points) * 3 // 4
    for picture, window in ((story.pictures[0], points[:first]), (story.pictures[-1], points[-first:])):
        hull = [mark.positions for mark in picture.marks if mark.style == "hull"]
        assert hull == [tuple(position[repr(p)] for p in map(tuple, DynamicHull(window).vertices().tolist()))]
    assert any("more than once" in picture.caption for picture in story.pictures)


def test_a_name_cannot_end_the_script(tmp_path):
    path = tmp_path / "<script>.csv"
    path.write_text("x,y\n0,0\n1,1\n")
    assert explain("chan", path, "--out", tmp_path / "page.html").exit_code == 0
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
        (["graham_scan", "FILE", "--out", "picture.bmp"], "the name must end in .html, .png, .svg or .gif"),
        (["graham_scan", "FILE", "--x", "east"], "FILE has no column 'east' (--x); it has x, y"),
        (["quickhull", "FILE"], "quickhull: not an algorithm; choose graham_scan, jarvis_march,"),
        (["tree", "FILE", "--collinear", "keep"], "--collinear keep: the tree keeps vertices only"),
        (["graham_scan", "MORE"], "has 2,001 points: a picture of a static algorithm has room for 2,000; draw a part"),
        (["graham_scan", "FILE", "--out", "nowhere/a.svg"], "nowhere/a.svg: there is no folder nowhere"),
        (["tree", "MANY"], "has 201 points: a picture of the tree has room for 200"),
    ],
)
def test_what_cannot_be_drawn_is_refused(example, tmp_path, arguments, message):
    many = tmp_path / "many.csv"
    many.write_text("x,y\n" + "".join(f"{i},{i * i}\n" for i in range(201)))
    more = tmp_path / "more.csv"
    more.write_text("x,y\n" + "".join(f"{i},{i * i}\n" for i in range(2001)))
    files = {"FILE": str(example), "MANY": str(many), "MORE": str(more)}
    done = explain(*[files.get(argument, argument) for argument in arguments])
    assert done.exit_code == 2
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


def test_a_round_of_chan_shows_its_last_edge():
    steps = explained("chan", EXAMPLE, "drop")
    ends = [(before, step) for before, step in pairwise(steps) if "closed" in step.caption]
    assert [len(step.chain) for _, step in ends] == [3, 5, 6]
    for before, step in ends:
        assert step.chain[-2:] == before.triple
    assert list(ends[-1][1].chain) == [*CORNERS, CORNERS[0]]


@pytest.mark.parametrize("collinear", ["drop", "keep"])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("name", ["subnormals and ones", "the largest doubles", "one vertical line", "signed zeros"])
def test_every_trace_can_be_drawn(algorithm, collinear, name):
    rows = list(dict.fromkeys((x + 0.0, y + 0.0) for x, y in KILLERS[name]))
    story = static_story(algorithm, name, rows, collinear)
    assert all(-1 <= coordinate <= 1 for place in places(rows).values() for coordinate in place)
    assert any(mark.style == "hull" for mark in story.pictures[-1].marks)
    for picture in story.pictures:
        assert all(position in story.names for mark in picture.marks for position in mark.positions)
        assert "0: left" not in picture.caption.replace("10: left", "")


@pytest.mark.parametrize("name", ["subnormals and ones", "the largest doubles", "one vertical line", "signed zeros"])
def test_every_tree_can_be_drawn(name):
    story = tree_story(name, [(x + 0.0, y + 0.0) for x, y in KILLERS[name]][:60])
    (left, bottom), (right, top) = story.low, story.high
    for picture in story.pictures:
        for mark in picture.marks:
            assert mark.positions
            assert all(left <= x <= right and bottom <= y <= top for x, y in mark.positions)


@pytest.mark.parametrize("text", ["x,y\n1,2\n", "x,y\n1e308,0\n-1e308,0\n0,0\n"])
def test_one_point_and_points_on_a_line(tmp_path, text):
    path = tmp_path / "line.csv"
    path.write_text(text)
    done = explain("jarvis_march", path, "--collinear", "keep", "--out", tmp_path / "sheet.png")
    assert done.exit_code == 0, done.stderr
