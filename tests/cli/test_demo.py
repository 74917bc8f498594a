"""`dynhull demo` as a user runs it: a real server, real input, every step verified."""

import re
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import ClassVar
from urllib.parse import quote_plus

import numpy as np
import pytest
import server_process as servers
from cases import slow
from cluster import descendants
from command_line import dynhull
from forgetful import FORGETFUL
from forked import COMMAND, Process
from patience import PATIENCE, wait_until
from typer.testing import Result

from dynhull_cli.demo import show
from dynhull_cli.demo.again import play_again
from dynhull_cli.demo.live import Stop, create, play
from dynhull_cli.demo.replay import replay
from dynhull_cli.demo.scene import Frame
from dynhull_cli.demo.server import server_process
from dynhull_cli.demo.table import Table
from dynhull_client import HullClient, RevisionForgottenError


def demo(*arguments: object) -> Result:
    return dynhull("demo", *arguments)


def is_picture(path) -> bool:
    return path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


@slow
def test_hours_of_flights(tmp_path):
    """`make demo` replays a whole day."""
    picture = tmp_path / "flights.png"
    done = demo("--day", "2013-03-08", "--hours", 2, "--out", picture)
    assert done.exit_code == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[-2:] == ["REPLAYED 120/120", "VERIFIED 120/120"]
    assert re.fullmatch(r"EVENTS ([1-9]\d*)/\1", lines[-4])
    assert any(line.strip().startswith("near/LAX enter ") for line in lines)
    hours = [line for line in lines if " km²  " in line]
    assert [line.split()[0] for line in hours] == [f"{hour:02}:00" for hour in range(2)]
    assert " to SJU" in done.stdout
    assert is_picture(picture)


@slow
@pytest.mark.long
def test_the_flights_live_until_ctrl_c(tmp_path: Path) -> None:
    command = [COMMAND, "demo", "--live", "--hours", "1", "--speed", "6000"]
    with Process(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as process:
        assert process.stdout is not None
        words = [process.stdout.readline().split() for _ in range(4)]
        page, http, address = (line[-1] for line in words[1:])
        children = descendants(process.pid)
        assert len(children) >= 3
        for url in (page, http):
            with urllib.request.urlopen(url, timeout=PATIENCE) as answer:
                assert answer.status == 200
        with HullClient(address) as client:
            (hull,) = client.list_hulls()
            wait_until(lambda: client.get_hull(hull.name).revision > 61)  # the hour has begun again
            assert f"hull={quote_plus(hull.name)}" in page
            assert {fence.name for fence in client.list_fences()} == {"near/ATL", "near/LAX", "near/ORD"}
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
    wait_until(lambda: not any(Path(f"/proc/{child}").exists() for child in children))
    assert not list(tmp_path.iterdir())


def test_a_signal_ends_the_wait_whenever_it_comes() -> None:
    """At each line that the wait runs through."""
    program = """
import signal, sys
from dynhull_cli.demo.live import stopped_by_signals

for line in range(1, 200):
    with stopped_by_signals() as stop:
        left = line
        def trace(frame, event, argument):
            global left
            left -= 1
            if left == 0:
                signal.raise_signal(signal.SIGINT)
            return trace
        sys.settrace(trace)
        stop.wait(0)
        sys.settrace(None)
        assert stop.wait(0) or left > 0, line
"""
    done = servers.finished([sys.executable, "-c", program])
    assert done.returncode == 0, done.stderr


def test_the_processes_end_with_a_demo_that_is_killed() -> None:
    program = (
        "import sys; from dynhull_cli.demo.server import IN_MEMORY, SERVE, running\n"
        "with running('server', *SERVE, IN_MEMORY, apart=True) as server:\n"
        "    print(server.addresses[0], flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        with HullClient(process.stdout.readline().strip()) as client:
            client.create_hull("fleet")
        (child,) = descendants(process.pid)
        process.kill()
        wait_until(lambda: not Path(f"/proc/{child}").exists())


def test_live_has_no_window():
    done = demo("--live", "--window", "30m")
    assert (done.exit_code, "leave out --window" in done.stderr) == (2, True)


@pytest.mark.parametrize("identity", [None, "van"])
def test_own_points_live(tmp_path, address, name, identity):
    """Rows of a file stay until it begins again; rows of a known key move it."""
    file = tmp_path / "vans.csv"
    file.write_text("van,t,lon,lat\na,1,13,52\nb,2,14,52\na,2,13,53\nc,3,13.5,52.5\n")
    scene = Table(file, None, None, identity, "t", 100, keyed=True)
    scene.hull_name = name
    stop, seen = Stop(), []

    class Looking(HullClient):
        def put(self, *arguments, **options):
            done = super().put(*arguments, **options)
            seen.append("".join(self.entities(name).keys))
            if len(seen) == 6:
                stop.note()
            return done

    with Looking(address) as client:
        create(client, scene)
        play(client, scene, 0, 0, stop)
        assert client.get_hull(name).info.geographic
    assert seen == 2 * (["a", "ab", "abc"] if identity else ["2", "234", "2345"])


@slow
def test_the_positions_of_the_last_half_hour(tmp_path):
    done = demo("--day", "2013-03-08", "--hours", 1, "--window", "30m", "--out", tmp_path / "window.png")
    assert done.exit_code == 0, done.stderr
    assert "positions of the last 30m" in done.stdout
    assert done.stdout.splitlines()[-2:] == ["REPLAYED 60/60", "VERIFIED 60/60"]


def test_points_of_ones_own(tmp_path):
    rng = np.random.default_rng(5)
    rows = [f"{minute},{truck},{x},{y}" for minute in range(20) for truck, (x, y) in enumerate(rng.random((15, 2)))]
    file, picture = tmp_path / "fleet.csv", tmp_path / "fleet.png"
    file.write_text("\n".join(["minute,truck,east,north", *rows, "20,3,oops,1"]))
    options = ["--x", "east", "--y", "north", "--id", "truck", "--time", "minute", "--out", picture]
    done = demo("--points", file, *options)
    assert done.exit_code == 0, done.stderr
    assert "1 bad row left out:" in done.stdout
    assert "line 302: east is 'oops', not a number" in done.stdout
    assert done.stdout.splitlines()[-2:] == ["REPLAYED 20/20", "VERIFIED 20/20"]
    assert is_picture(picture)


def test_what_the_picture_needs_is_missing_before_the_replay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = tmp_path / "table.csv"
    table.write_text("x,y\n1,2\n")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    done = demo("--points", table, "--out", tmp_path / "picture.png")
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith("error: dynhull demo needs matplotlib, which is not installed. Install it with: pip")


@slow
def test_longitudes_and_latitudes_of_ones_own_are_on_the_globe(tmp_path):
    file, picture = tmp_path / "fleet.csv", tmp_path / "fleet.png"
    rows = ["1,a,179,-17", "1,b,-179.5,-18", "1,c,178,-18", "2,a,179.2,-16", "3,c,-18,177"]
    file.write_text("\n".join(["minute,truck,Lon,Lat", *rows]))
    options = ["--points", file, "--id", "truck", "--time", "minute", "--out", picture]
    done = demo(*options)
    assert done.exit_code == 0, done.stderr
    assert "line 6: the latitude is 177.0, not from -90 to 90 degrees; the longitude comes first" in done.stdout
    assert "on the globe: Lon and Lat are degrees; --plane takes them for a plane" in done.stdout
    assert "14,709 km²" in done.stdout
    assert done.stdout.splitlines()[-1] == "VERIFIED 2/2"
    assert is_picture(picture)
    plane = demo(*options, "--plane")
    assert plane.exit_code == 0, plane.stderr
    assert "in the plane: Lon and Lat are x and y, and areas square degrees" in plane.stdout
    assert "square units" in plane.stdout
    file.write_text("minute,truck,lon,lat\n1,a,0,0\n1,b,120,0\n1,c,-120,1\n")
    far = demo(*options)
    assert far.exit_code == 2
    assert "a hull reaches 85 degrees. --plane takes degrees for points of a plane" in far.stderr


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("a,b\n1,2\n", [], "name two with --x and --y; it has a, b"),
        ("", [], "is empty"),
        ("x,y\nnan,nan\n", [], "has no points"),
    ],
)
def test_unusable_input_says_what_to_do(tmp_path, text, options, message):
    file = tmp_path / "points.csv"
    file.write_text(text)
    done = demo("--points", file, *options)
    assert done.exit_code == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--plane"], "--geographic and --plane are for --points: the flights are on the globe"),
        (["--day", "x"], "--day 'x' is not a day such as 2013-03-08"),
        (["--out", "d.txt"], "--out d.txt: the name must end in .png"),
        (["--out", "nowhere/d.png"], "--out nowhere/d.png: there is no folder nowhere"),
    ],
)
def test_unusable_options_are_refused_at_once(options, message):
    done = demo(*options)
    assert (done.exit_code, done.stdout) == (2, "")
    assert message in done.stderr


def test_a_day_of_another_year():
    done = demo("--day", "2014-01-01")
    assert done.exit_code == 2
    assert "the data set has the days of 2013" in done.stderr


class Scene:
    """Frames that claim to have points which were never sent."""

    hull_name = "wrong"
    keyed = False
    max_age = None
    length = 2
    circles: ClassVar = {}
    rivals = None
    center = None
    area_scale = 1.0

    def frames(self) -> Iterator[Frame]:
        sent = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        yield Frame("0", sent, sent, ["a", "b", "c"], milestone=True)
        yield Frame("1", np.empty((0, 2)), sent[:2], ["a", "b"], milestone=True)


def test_the_first_difference_is_told():
    with server_process() as address, HullClient(address) as client:
        differences = [step.difference for step in replay(client, Scene())]
    assert differences == [None, "the server holds 3 points, 2 were sent"]


class Doubled(Scene):
    """The same, and all frames are sent."""

    def frames(self) -> Iterator[Frame]:
        for size in (3, 4, 5):
            points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 2.0]])[:size]
            yield Frame(str(size), points[max(size - 1, 0) if size > 3 else 0 :], points, list("abcde"[:size]), True)


def test_a_past_that_differs_is_told():
    with server_process() as address, HullClient(address) as client:
        steps = list(replay(client, Doubled(), history=True))
        assert list(play_again(client, Doubled(), steps)) == [None] * 3
        other = replace(steps[1], vertices=steps[0].vertices)
        missing = replace(steps[2], revision=9)
        found = list(play_again(client, Doubled(), [steps[0], other, steps[2]]))
        assert found[0] is found[2] is None
        assert str(found[1]).startswith(
            "the past has [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], and [[0.0, 0.0], "
        )
        with pytest.raises(RevisionForgottenError):
            list(play_again(client, Doubled(), [steps[0], missing]))


def test_without_pyarrow_nothing_is_played_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = tmp_path / "table.csv"
    table.write_text("x,y\n1,2\n")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    done = demo("--points", table, "--out", tmp_path / "picture.png")
    assert done.exit_code == 0, done.stderr
    *_, past, verified = done.stdout.splitlines()
    assert past.endswith("which needs pyarrow. Install it with: pip install 'dynhull[history]'")
    assert verified == "VERIFIED 1/1"


@pytest.mark.one_process("faults are put into the process that is started")
def test_a_wrong_server_is_found_out(tmp_path, monkeypatch):
    @contextmanager
    def wrong_server() -> Iterator[str]:
        with servers.server_process("--scrub-cpu", "0", "--data", str(tmp_path / "data"), wrap=FORGETFUL) as server:
            yield server.address

    monkeypatch.setattr(show, "server_process", wrong_server)
    points, picture = tmp_path / "points.csv", tmp_path / "picture.png"
    points.write_text("t,x,y\n1,0,0\n1,4,0\n1,0,4\n2,5,5\n")
    done = dynhull("demo", "--points", points, "--time", "t", "--out", picture)
    assert done.exit_code == 1
    *_, compared, difference = done.stdout.splitlines()
    assert compared.startswith("Compared after each batch: ")
    assert compared.endswith(": 0 batches")
    assert difference.startswith("DIFFERENT at 1: the live hull differs from Chan's recomputation: ")
    assert "VERIFIED" not in done.stdout
    assert not picture.exists()
