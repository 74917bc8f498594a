"""The static hulls under sanitizers, on random inputs: see fuzz_static.cpp."""

import subprocess

from cases import slow

FLAGS = ["-O0", "-ffp-contract=off", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-pthread"]


@slow
def test_random_inputs(fuzzer):
    program = fuzzer("fuzz_static.cpp", *FLAGS)
    run = subprocess.run([program, "--seconds", "2"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
