"""A short run of the torture of fences of a server that is killed; `make robustness` is the long one."""

import re
import subprocess
import sys
from pathlib import Path

from cases import slow


@slow
def test_every_event_is_there_once_after_kills() -> None:
    torture = Path(__file__).with_name("kill_torture.py")
    command = [sys.executable, torture, "--steps", "1500", "--kills", "2", "--worlds", "1"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    counts = {name: int(count) for name, count in re.findall(r"'([\w ]+)': (\d+)", run.stdout.splitlines()[-1])}
    least = {"steps": 1500, "kills": 2, "ENTER": 50, "EXIT": 50, "seen at once": 1, "verified fences": 10}
    assert all(counts.get(name, 0) >= number for name, number in least.items()), counts
