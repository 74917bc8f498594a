"""Windows on random inputs, with allocations that fail: a short run of fuzz_window.cpp, without sanitizers."""

import subprocess
from pathlib import Path

FLAGS = ["-std=c++20", "-O0", "-ffp-contract=off", "-pthread", "-DDYNHULL_FAIL_ALLOCATIONS", "-DDYNHULL_LEAF=4"]


def test_random_lives(compiler, tmp_path):
    program = tmp_path / "fuzz_window"
    source = Path(__file__).with_name("fuzz_window.cpp")
    subprocess.run([compiler, *FLAGS, source, "-o", program], check=True)
    run = subprocess.run([program, "--seconds", "1"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
