"""A short run of the torture of fences; `make robustness` is the long one."""

import re
import subprocess
import sys
from pathlib import Path

from cases import slow


@slow
def test_every_event_follows_from_the_positions_and_none_is_missing() -> None:
    torture = Path(__file__).with_name("fence_torture.py")
    command = [sys.executable, torture, "--steps", "2500"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    counts = {name: int(count) for name, count in re.findall(r"'([\w, ]+)': (\d+)", run.stdout.splitlines()[-1])}
    least = {"ENTER": 100, "EXIT": 100, "BEGIN": 1, "kills": 3, "not committed": 9, "unknown, committed": 9}
    least |= {
        "CreateFence together": 2,
        "DeleteFence together": 2,
        "checked": 25,
        "delayed": 3,
        "DWELL": 5,
        "verified": 8,
    }
    assert all(counts.get(name, 0) >= number for name, number in least.items()), counts
