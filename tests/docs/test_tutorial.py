"""The programs of the tutorial, copied from its page and run as a reader would run them."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from server_process import PATIENCE, server_process


def start(program: Path, *options: str) -> "subprocess.Popen[str]":
    command = [sys.executable, str(program), *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_the_fence_follows_the_fleet(take_program: Callable[[str, str], Path]) -> None:
    fly, fence = (take_program("tutorial", title) for title in ("fly.py", "fence.py"))
    with server_process() as server:
        fleet = start(fly, "--address", server.address, "--minutes", "90", "--pause", "0.02")
        assert fleet.stdout.read(3) == "\n00"  # the hull is there
        alarm = start(fence, "--address", server.address, "--events", "20")
        printed, errors = alarm.communicate(timeout=PATIENCE)
        assert alarm.returncode == 0, errors
        assert re.search(r"the fence has \d+ corners at revision \d+", printed)
        rest, errors = fleet.communicate(timeout=PATIENCE)
        assert fleet.returncode == 0, errors
        assert rest.rstrip().endswith("in the air")
