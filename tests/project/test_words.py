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


def cases_of(recipe: str) -> set[str]:
    return set(re.findall(r"\b([A-Z]+_CASES)=all\b", recipe))


def test_what_is_left_out_of_the_run_has_a_word_and_ci_runs_what_takes_minutes() -> None:
    recipes = dict(re.findall(r"^([a-z-]+):[^=\n]*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(), re.MULTILINE))
    sources = "".join(path.read_text() for path in (ROOT / "tests").rglob("*.py"))
    left_out = set(re.findall(r"only_with\(\"([A-Z]+_CASES)\"\)", sources))
    assert left_out <= {cases for recipe in recipes.values() for cases in cases_of(recipe)}
    machine, workflow = ((ROOT / file).read_text() for file in (".ci/run", ".github/workflows/ci.yml"))
    words = [set(re.findall(r"\bmake ([a-z-]+)", text)) for text in (machine, workflow)]
    assert words[0] & words[1] >= {"test", "slow", "check"}
    assert {"SLOW_CASES", "BROWSER_CASES"} <= cases_of(recipes["slow"])
    assert "SITE_CASES" in cases_of(recipes["pages"])  # a part of `make check`
