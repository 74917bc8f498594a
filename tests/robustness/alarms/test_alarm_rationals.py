"""A short run of the comparison of alarms with exact integers; `make robustness` has the long one."""

import re
import subprocess
import sys
from pathlib import Path

from cases import slow


@slow
def test_every_alarm_is_decided_as_exact_integers_decide() -> None:
    command = [sys.executable, Path(__file__).with_name("alarm_rationals.py"), "--batches", "120"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    batches, events, attained, _ = map(int, re.findall(r"\d+", run.stdout.splitlines()[-1]))
    assert batches == 120
    assert events > 100
    assert attained > 50
