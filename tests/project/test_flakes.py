"""`make flakes` on a suite of two tests, one of which fails now and then."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from cases import slow

pytestmark = slow

METER = Path(__file__).parents[1] / "flakes.py"
SUITE = {
    "conftest.py": 'def pytest_addoption(parser): parser.addoption("--order-seed", type=int)\n',
    "tests/test_a.py": (
        "import os\n"
        "def test_good(): pass\n"
        "def test_now_and_then(pytestconfig):\n"
        '    seed = pytestconfig.getoption("order_seed")\n'
        "    if seed == 9: os._exit(7)\n"
        '    assert seed != 2, "on Tuesdays"\n'
    ),
    ".gitignore": "build/\n__pycache__/\n",
}
Flakes = Callable[..., tuple[int, str]]


def git(folder: Path, *arguments: str) -> None:
    named = ["-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false"]
    subprocess.run(["git", *named, *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    (tmp_path / "tests").mkdir()
    for name, text in SUITE.items():
        (tmp_path / name).write_text(text)
    git(tmp_path, "init")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-m", "a suite")
    return tmp_path


@pytest.fixture
def flakes(suite: Path) -> Flakes:
    def run(*arguments: object) -> tuple[int, str]:
        command = [sys.executable, str(METER), *map(str, arguments), "--", "-p", "no:cacheprovider"]
        ended = subprocess.run(command, cwd=suite, capture_output=True, text=True, check=False)
        assert "Traceback" not in ended.stderr
        return ended.returncode, ended.stdout + ended.stderr

    return run


def test_a_series_goes_on_and_counts_what_failed(suite: Path, flakes: Flakes) -> None:
    code, shown = flakes("--runs", 1)
    assert (code, "run 1 of 1, busy 0: 2 passed" in shown) == (0, True)
    (suite / "page.md").write_text("only documentation")
    git(suite, "add", ".")
    git(suite, "commit", "-m", "a page")
    code, shown = flakes("--runs", 2)
    assert code == 1
    assert "run 1 of 2" not in shown
    assert "run 2 of 2, busy 0: 1 passed, 1 failed" in shown
    assert "tests.test_a::test_now_and_then: failed in 1 of 2 runs" in shown
    assert "on Tuesdays" in shown
    (suite / "tests" / "test_a.py").write_text("def test_good(): pass\n")
    assert "commit first" in flakes("--runs", 0)[1]
    git(suite, "commit", "-am", "mended")
    assert "there are no runs of" in flakes("--runs", 0)[1]


def test_a_run_that_dies_has_failed(flakes: Flakes) -> None:
    code, shown = flakes("--runs", 1, "--seed", 9, "--busy", 1)
    assert code == 1
    assert "run 1 of 1, busy 1: " in shown
    assert "(the run itself): failed in 1 of 1 runs" in shown
    assert "it ended with code 7" in shown
