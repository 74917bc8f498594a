"""A machine without the programs that some tests need: the summary counts those tests, and CI refuses them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from cases import slow

ROOT = Path(__file__).parents[2]
NEEDY = ["tests/deploy/test_kit.py", "-k", "configuration or alerts", "-n", "0", "-p", "no:cacheprovider"]


NAMED = "no promtool: install Debian's package prometheus (see `make peers`)"


@slow
@pytest.mark.parametrize(("required", "code", "counted"), [("", 0, f"Skipped: {NAMED}: 2 tests"), ("1", 1, "2 failed")])
def test_without_promtool(tmp_path: Path, required: str, code: int, counted: str) -> None:
    environment = {**os.environ, "PATH": str(tmp_path), "DYNHULL_REQUIRE_PEERS": required}
    command = [sys.executable, "-m", "pytest", *NEEDY]
    run = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == code, run.stdout + run.stderr
    assert counted in run.stdout
    assert NAMED in run.stdout
