"""A short run of the torture; `make robustness` is the long one."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

from cases import slow


@slow
def test_no_promise_is_broken():
    torture = Path(__file__).with_name("torture.py")
    command = [sys.executable, torture, "--breath", "0.2", "--faults", "10"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    counts = run.stdout.splitlines()[-1]
    clock_back, kills = ("1 clock back, ", 2) if shutil.which("faketime") else ("", 3)
    others = f"1 copy, 1 damage, 1 descriptors, 1 full disk, {kills} kill, 1 pause, 1 restore, 1 sever;"
    assert f"faults: {clock_back}{others}" in counts
    assert "lost: 0, doubled: 0" in counts
    assert int(re.search(r"batches acknowledged: (\d+)", counts)[1]) > 100
