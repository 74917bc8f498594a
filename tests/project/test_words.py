"""The targets of `make`: listed by `make help`, and explained in CONTRIBUTING.md."""

import os
import re
import subprocess
import sys
from pathlib import Path

from peers import program

ROOT = Path(__file__).parents[2]


def test_every_word_is_listed_and_every_documented_word_exists() -> None:
    run = subprocess.run([program("make"), "help"], cwd=ROOT, capture_output=True, text=True, check=True)
    listed = set(re.findall(r"^  make ([a-z-]+) +\S", run.stdout, re.MULTILINE))
    phony = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert listed == set(phony[1].split())
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    documented = {word for page in pages for word in re.findall(r"`make ([a-z-]+)", page.read_text())}
    assert documented - listed == set()


def test_what_has_a_word_of_its_own_is_left_out_of_the_run_and_not_skipped() -> None:
    """Two tests of Ray, and eleven of fifteen cases of a test that has many."""
    paths = ["tests/ray/test_launcher.py", "tests/window/test_window.py::test_implementations_agree_on_large_inputs"]
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", *paths, "-n", "0", "-p", "no:cacheprovider"]
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_CASES")}
    run = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "4/17 tests collected (13 deselected)" in run.stdout
    assert "skipped" not in run.stdout
