"""Random lives with allocations that fail: short runs of the fuzzers, which `make fuzz` runs under sanitizers."""

import subprocess
from pathlib import Path

from cases import slow

HERE = Path(__file__).parent
KEPT = (HERE / "seeds.txt").read_text().split()
SEEDS = {"points": KEPT, "entities": map(str, range(20)), "windows": [], "fences": map(str, range(20))}
# Without sanitizers and optimization, which take long to compile.
FLAGS = ["-O0", "-ffp-contract=off", "-pthread", "-DDYNHULL_FAIL_ALLOCATIONS"]
FLAGS += ["-DDYNHULL_LEAF=4", "-DDYNHULL_HASH_SEED=1", "-DDYNHULL_ROWS_A_THREAD=3"]


@slow
def test_random_lives(fuzzer):
    """Kept seeds, then random ones."""
    program = fuzzer("fuzz_together.cpp", *FLAGS)
    for what, seeds in SEEDS.items():
        for arguments in filter(None, [[*seeds], ["--seconds", "1"]]):
            done = subprocess.run([program, what, *arguments], capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{what}: {done.stdout}{done.stderr}"
