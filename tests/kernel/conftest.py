import os
import shutil
from pathlib import Path

import pytest

from dynhull._implementation import kernel

HERE = Path(__file__).parent
COMPILER = os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")


def pytest_ignore_collect(collection_path):
    """Without the kernel there is nothing here to test."""
    return True if kernel is None and HERE in collection_path.parents else None


def pytest_collection_modifyitems(items):
    """Without a compiler there is nothing to fuzz."""
    items[:] = [item for item in items if COMPILER is not None or "compiler" not in getattr(item, "fixturenames", ())]


@pytest.fixture(scope="session")
def compiler():
    return COMPILER
