"""The programs of the page about fleets, copied from it and run as a reader would run them."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import dynhull
from server_process import server_process


def run(program: Path, *options: str) -> str:
    done = subprocess.run([sys.executable, str(program), *options], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_fleet_has_named_corners(
    take_program: Callable[[str, str], Path], take_text: Callable[[str], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    positions, corners = (take_program("how-to/fleets", title) for title in ("positions.py", "corners.py"))
    text = take_text("how-to/fleets")
    with server_process() as server:
        monkeypatch.setenv("DYNHULL_ADDRESS", server.address)
        commands = [line.split()[1:] for line in COMMANDS.splitlines()]
        for line, command in zip(COMMANDS.splitlines(), commands, strict=True):
            assert line in text
            done = dynhull(*command)
            assert done.exit_code == 0, done.stderr
        assert done.stdout.splitlines() == ["9.9\t53.6\ttruck-9", "11.6\t48.1\tvan-3", "13.4\t52.5\ttruck-7"]
        assert run(positions, "--address", server.address).startswith("200 vehicles, corners: vehicle-")
        printed = run(corners, "--address", server.address, "--events", "1")
        assert "joined ['vehicle-" in printed
        assert "\n[   1 -128]\n" in printed or "\n[   0 -128]\n" in printed


COMMANDS = """\
dynhull create fleets/vehicles --keyed str --geographic --max-age 30m
dynhull put fleets/vehicles truck-7 13.4 52.5
dynhull put fleets/vehicles van-3 11.6 48.1
dynhull put fleets/vehicles truck-9 9.9 53.6
dynhull query fleets/vehicles vertices --keys"""
