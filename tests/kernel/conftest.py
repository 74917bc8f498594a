import pytest

from dynhull.implementation import kernel


def pytest_collection_modifyitems(items):
    """Without the kernel there is nothing here to test."""
    if kernel is None:
        here = __file__.rpartition("/")[0]
        items[:] = [item for item in items if not str(item.path).startswith(here)]


@pytest.fixture(scope="session")
def compiler():
    import os
    import shutil

    return os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
