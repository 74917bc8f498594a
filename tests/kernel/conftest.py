import os
import subprocess
from pathlib import Path

import pytest
from peers import program

from dynhull._implementation import kernel

HERE = Path(__file__).parent


def pytest_ignore_collect(collection_path):
    """Skip the tests of this folder where the kernel is not built."""
    return True if kernel is None and HERE in collection_path.parents else None


@pytest.fixture(scope="session")
def compiler():
    return program(os.environ.get("CXX", "c++"), "c++", "g++", "clang++")


@pytest.fixture
def fuzz(compiler, tmp_path):
    """Builds a fuzzer, without sanitizers to be quick, and runs it once with each of these arguments."""

    def run(source, *flags, runs):
        build = [compiler, "-std=c++20", "-O0", "-ffp-contract=off", "-pthread", "-DDYNHULL_FAIL_ALLOCATIONS"]
        program = tmp_path / "fuzz"
        subprocess.run([*build, "-DDYNHULL_LEAF=4", *flags, HERE / source, "-o", program], check=True)
        for arguments in runs:
            done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stdout + done.stderr

    return run
