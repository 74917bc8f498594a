"""The documentation as its readers get it: the built site, and the programs on its pages."""

import fcntl
import os
import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


class TitledCode(HTMLParser):
    """The code blocks of a page that have a title, by their titles."""

    def __init__(self) -> None:
        super().__init__()
        self.blocks: dict[str, str] = {}
        self._title = ""
        self._reads_title = self._reads_code = False

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag == "span" and ("class", "filename") in attributes:
            self._title, self._reads_title = "", True
        elif tag == "code" and self._title:
            self._reads_code = True
            self.blocks[self._title] = ""

    def handle_data(self, data: str) -> None:
        if self._reads_title:
            self._title += data
        elif self._reads_code:
            self.blocks[self._title] += data

    def handle_endtag(self, tag: str) -> None:
        if tag == "span":
            self._reads_title = False
        elif tag == "code" and self._reads_code:
            self._title, self._reads_code = "", False


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """The folder of the site, built as `make docs` builds it: once, for all workers of a run."""
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
def take_program(site: Path, tmp_path: Path) -> Callable[[str, str], Path]:
    """Saves the code block of that title, from the page of that name, as a reader would."""

    def take(page: str, title: str) -> Path:
        reader = TitledCode()
        reader.feed((site / page / "index.html").read_text())
        program = tmp_path / title
        program.write_text(reader.blocks[title])
        return program

    return take
