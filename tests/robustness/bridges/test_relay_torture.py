"""A short run of the torture of a relay; `make robustness` is the long one."""

import subprocess
import sys
from pathlib import Path

from cases import slow


@slow
def test_every_event_arrives_whatever_goes_away() -> None:
    torture = Path(__file__).with_name("relay_torture.py")
    command = [sys.executable, torture, "--downs", "1", "--down", "1", "--kills", "2"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "'times without the endpoint': 1" in run.stdout.splitlines()[-1]


@slow
def test_there_is_one_raise_between_two_clears() -> None:
    torture = Path(__file__).with_name("alarm_torture.py")
    run = subprocess.run([sys.executable, torture, "--faults", "4"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.splitlines()[-1].startswith("exactly one raise between two clears, none lost or repeated: ")
