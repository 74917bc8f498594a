"""A short run of the fuzzer of entities, without sanitizers to be quick."""

import subprocess
from pathlib import Path

SOURCE = Path(__file__).with_name("fuzz_keyed.cpp")


def test_fuzz_keyed(compiler, tmp_path):
    program = tmp_path / "fuzz"
    build = [
        compiler,
        "-std=c++20",
        "-O0",
        "-ffp-contract=off",
        "-pthread",
        "-DDYNHULL_FAIL_ALLOCATIONS",
        "-DDYNHULL_LEAF=4",
    ]
    subprocess.run([*build, "-DDYNHULL_HASH_SEED=1", str(SOURCE), "-o", str(program)], check=True)
    for arguments in (map(str, range(20)), ["--seconds", "1"]):
        run = subprocess.run([str(program), *arguments], capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stdout
