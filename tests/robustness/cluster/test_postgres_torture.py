"""A short run of the torture; `make robustness-cluster` has the long one."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from cases import slow
from postgresql import postgres_program


@slow
@pytest.mark.skipif(os.geteuid() != 0, reason="PostgreSQL refuses to run as the root that a namespace makes of others")
def test_no_promise_is_broken():
    postgres_program("postgres")  # else the test is skipped
    torture = Path(__file__).with_name("postgres_torture.py")
    command = [sys.executable, torture, "--breath", "0.05", "--faults", "2"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    counts = run.stdout.splitlines()[-1]
    assert "faults: 1 crash, 1 zombie;" in counts
    assert "lost: 0, doubled: 0" in counts
    assert int(re.search(r"batches acknowledged: (\d+)", counts)[1]) > 100
