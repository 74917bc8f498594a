"""The programs of docs/tutorial.md, as a reader would run them."""

import re
import subprocess
import sys
from pathlib import Path

from server_process import server_process

EXAMPLES = Path(__file__).parents[2] / "docs/examples"


def start(program: str, *options: str) -> "subprocess.Popen[str]":
    command = [sys.executable, str(EXAMPLES / program), *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_the_fence_follows_the_fleet() -> None:
    with server_process() as server:
        fleet = start("fly.py", "--address", server.address, "--minutes", "200", "--pause", "0.02")
        assert fleet.stdout.read(3) == "\n00"  # the hull is there
        fence = start("fence.py", "--address", server.address, "--events", "20")
        said, complaints = fence.communicate(timeout=60)
        assert fence.returncode == 0, complaints
        assert re.search(r"the fence has \d+ corners at revision \d+", said)
        rest, complaints = fleet.communicate(timeout=60)
        assert fleet.returncode == 0, complaints
        assert rest.rstrip().endswith("in the air")
