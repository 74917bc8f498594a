"""Fences on random inputs, with allocations that fail: a short run of fuzz_fences.cpp, without sanitizers."""

import subprocess
from pathlib import Path

import pytest

FLAGS = ["-std=c++20", "-O0", "-ffp-contract=off", "-pthread", "-DDYNHULL_FAIL_ALLOCATIONS", "-DDYNHULL_LEAF=4"]


@pytest.mark.long
def test_random_lives(compiler, tmp_path):
    program = tmp_path / "fuzz_fences"
    source = Path(__file__).with_name("fuzz_fences.cpp")
    subprocess.run([compiler, *FLAGS, "-DDYNHULL_HASH_SEED=1", source, "-o", program], check=True)
    for arguments in (map(str, range(20)), ["--seconds", "1"]):
        run = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stdout + run.stderr
