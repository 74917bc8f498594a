"""The documentation as its readers get it: the built site, and the programs on its pages."""

import fcntl
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from blocks import blocks

ROOT = Path(__file__).parents[2]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What needs the site is run by `make pages`, which builds it, and so by `make check`."""
    for item in items:
        if "site" in getattr(item, "fixturenames", ()) and item.get_closest_marker("only_with") is None:
            item.add_marker(pytest.mark.only_with("SITE_CASES"))


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """The folder of the site, as `make docs` builds it: by `make pages` before, else once for all workers of a run."""
    if os.environ.get("SITE_CASES") == "all":
        return ROOT / "build" / "site"
    if worker_id == "master":
        return build(tmp_path_factory.mktemp("site"))
    shared = tmp_path_factory.getbasetemp().parent
    with (shared / "site.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        folder = shared / "site"
        return folder if folder.exists() else build(folder)


def build(folder: Path) -> Path:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    quiet = {"NO_MKDOCS_2_WARNING": "1", "DISABLE_MKDOCS_2_WARNING": "true"}
    done = subprocess.run(command, cwd=ROOT, env=os.environ | quiet, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture
def take_text(site: Path) -> Callable[[str], str]:
    """The code blocks of the page of that name, as text."""
    return lambda page: "".join(block.shown for block in blocks((site / page / "index.html").read_text()))


@pytest.fixture
def take_program(site: Path, tmp_path: Path) -> Callable[[str, str], Path]:
    """Saves the code block of that title, from the page of that name, as a reader would."""

    def take(page: str, title: str) -> Path:
        (block,) = [each for each in blocks((site / page / "index.html").read_text()) if each.title == title]
        program = tmp_path / title
        program.write_text(block.text)
        return program

    return take
