"""Tests of the simulation: each patch in mutants/ puts in a fault, most of them of the past. How many lives find it?"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import dynhull_server

from .package import NAMES

HERE = Path(__file__).parent
PACKAGES = Path(dynhull_server.__file__).parents[1]
PATCHES = sorted((HERE / "mutants").glob("*.patch"))
# Lives within which a fault must be found.
MOST_LIVES = 10_000
# Seeds of the plans that look for it.
SEED = 1


@dataclass(frozen=True, slots=True)
class Hunt:
    """The search for a fault: the number of lives until it was found, or None, and the finding."""

    name: str
    lives: int | None
    seconds: float
    finding: str


def fits(patch: Path) -> None:
    """Raise RuntimeError if a patch no longer applies to the code."""
    _apply(patch, PACKAGES, "--check")


def _put_in(patch: Path, folder: Path) -> None:
    """Make a copy of the packages with a fault in it."""
    for name in NAMES:
        shutil.copytree(PACKAGES / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    _apply(patch, folder)


def _apply(patch: Path, folder: Path, *options: str) -> None:
    command = ["git", "apply", "-C1", *options, str(patch)]
    applied = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if applied.returncode:
        raise RuntimeError(f"{patch.name} does not fit the code any more: renew it\n{applied.stderr}")


def hunt(patch: Path, lives: int = MOST_LIVES) -> Hunt:
    """Put a fault into a copy of the packages, and look for it."""
    layer = re.search(r"^Layer: (\w+)$", patch.read_text(), re.MULTILINE)
    assert layer is not None, f"{patch} does not say in which layer"
    with tempfile.TemporaryDirectory() as folder:
        _put_in(patch, Path(folder))
        begun = time.monotonic()
        # coverage would look for the lines of the copy when it is gone.
        environment = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_PROCESS")}
        command = ["--package", folder, "run", "--layer", layer[1], "--lives", str(lives), "--seconds", "600"]
        if patch.stem.startswith("alarm_"):
            command.append("--alarms")
        run = subprocess.run(
            [sys.executable, "-m", "simulation", *command, "--seed", str(SEED)],
            cwd=HERE.parent,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
    seconds = time.monotonic() - begun
    if run.returncode == 0:
        return Hunt(patch.stem, None, seconds, "")
    found = re.search(r"(\d+) lives.*, 1 finding\nseed \d+ of the \w+: (.*)", run.stdout)
    if found is None or found[2].startswith(("NameError", "AttributeError", "ImportError")):
        raise RuntimeError(
            f"{patch.name}: the simulation itself fails, or the patch names what is no more\n{run.stdout}\n{run.stderr}"
        )
    return Hunt(patch.stem, int(found[1]), seconds, found[2])


def report(names: list[str]) -> int:
    """Search for each fault, and print after how many lives it was found. Exit code 1 if one was not."""
    missed = 0
    for patch in PATCHES:
        if names and patch.stem not in names:
            continue
        outcome = hunt(patch)
        missed += outcome.lives is None
        lives = f"{outcome.lives:>5}" if outcome.lives is not None else "never"
        print(f"{lives} lives {outcome.seconds:6.1f} s  {outcome.name}: {outcome.finding}", flush=True)
    return int(missed > 0)
