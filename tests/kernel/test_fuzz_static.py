"""The static hulls under sanitizers, on random inputs: see fuzz_static.cpp."""

import subprocess
from pathlib import Path

FLAGS = ["-std=c++20", "-O0", "-ffp-contract=off", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]


def test_random_inputs(compiler, tmp_path):
    program = tmp_path / "fuzz_static"
    source = Path(__file__).with_name("fuzz_static.cpp")
    subprocess.run([compiler, *FLAGS, source, "-pthread", "-o", program], check=True)
    run = subprocess.run([program, "--seconds", "2"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
