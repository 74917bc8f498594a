"""A short run of the torture of ingests; `make robustness` is the long one."""

import re
import subprocess
import sys
from pathlib import Path

from cases import slow


@slow
def test_every_point_is_there_once() -> None:
    torture = Path(__file__).with_name("ingest_torture.py")
    command = [sys.executable, torture, "--kills", "2"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    points, lost, doubled = map(int, re.findall(r": (\d+)", run.stdout.splitlines()[-1])[-3:])
    assert points > 1000
    assert (lost, doubled) == (0, 0)
