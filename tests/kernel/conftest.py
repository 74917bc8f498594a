import os
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
