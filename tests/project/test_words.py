"""The targets of `make`: listed by `make help`, and explained in CONTRIBUTING.md."""

import re
import subprocess
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
