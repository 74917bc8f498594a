"""The programs of the tutorial, copied from its page and run as a reader would run them."""

import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from metrics import measured, scrape
from patience import wait_until
from server_process import PATIENCE


def start(program: Path, *options: str) -> "subprocess.Popen[str]":
    command = [sys.executable, str(program), *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_the_fence_follows_the_fleet(take_program: Callable[[str, str], Path]) -> None:
    fly, fence = (take_program("tutorial", title) for title in ("fly.py", "fence.py"))
    with measured() as (server, metrics):
        fleet = start(fly, "--address", server.address, "--minutes", "90", "--pause", "0.02")
        assert fleet.stdout.read(3) == "\n06"  # the hull is there
        fleet.send_signal(signal.SIGSTOP)  # it could be over before the other program has begun
        alarm = start(fence, "--address", server.address, "--events", "20")
        wait_until(lambda: scrape(metrics)["dynhull_watchers"])
        fleet.send_signal(signal.SIGCONT)
        printed, errors = alarm.communicate(timeout=PATIENCE)
        assert alarm.returncode == 0, errors
        assert re.search(r"the fence has \d+ corners at revision \d+", printed)
        rest, errors = fleet.communicate(timeout=PATIENCE)
        assert fleet.returncode == 0, errors
        assert rest.rstrip().endswith("in the air")
