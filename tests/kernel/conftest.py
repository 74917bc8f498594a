import hashlib
import os
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from peers import program

from dynhull._implementation import kernel

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
BUILT = ROOT / "build" / "fuzzers"


def pytest_ignore_collect(collection_path):
    """Skip the tests of this folder where the kernel is not built."""
    return True if kernel is None and HERE in collection_path.parents else None


@pytest.fixture(scope="session")
def compiler():
    return program(os.environ.get("CXX", "c++"), "c++", "g++", "clang++")


@pytest.fixture(scope="session")
def fuzzer(compiler: str) -> Callable[..., Path]:
    """Compiles a fuzzer of this folder: once for each state of the sources, as that takes longer than its run."""

    def built(source: str, *flags: str) -> Path:
        sources = sorted([*HERE.glob("*.?pp"), *(ROOT / "dynhull" / "kernel").rglob("*.?pp")])
        version = subprocess.run([compiler, "--version"], capture_output=True, check=True).stdout
        state = hashlib.sha256(b"\0".join([version, *map(str.encode, flags), *(each.read_bytes() for each in sources)]))
        program = BUILT / f"{Path(source).stem}-{state.hexdigest()[:16]}"
        if not program.exists():
            BUILT.mkdir(parents=True, exist_ok=True)
            for older in BUILT.glob(f"{Path(source).stem}-*"):
                older.unlink(missing_ok=True)
            with tempfile.TemporaryDirectory(dir=BUILT) as folder:
                unfinished = Path(folder) / "program"
                subprocess.run([compiler, "-std=c++20", *flags, HERE / source, "-o", unfinished], check=True)
                unfinished.rename(program)
        return program

    return built
