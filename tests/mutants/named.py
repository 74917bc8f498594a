"""Faults that a named test must find: each patch in named/ puts one into the code and says which test that is.

    python tests/mutants/named.py [NAME ...]

The simulation has patches of its own (tests/simulation/mutants); these are of what it does not run. The test runs with
a copy of the package in place of the installed one, in its own process and in all that it starts.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parents[2]
PATCHES = sorted(Path(__file__).with_name("named").glob("*.patch"))
# Python imports this before anything else.
FIRST = """
import sys

sys.path.append({tests!r})
from simulation.package import use_package

use_package({folder!r}, ({package!r},))
"""


def package_of(patch: Path) -> str:
    """The package that a patch changes."""
    return _line(patch, r"--- a/(\w+)/.*")


def fits(patch: Path) -> None:
    """Raise RuntimeError if a patch no longer applies to the code."""
    _apply(patch, _place(patch).parent, "--check")


def is_found(patch: Path) -> bool:
    """Whether the named test fails with the fault. Raises RuntimeError if it does not run."""
    package, place = package_of(patch), _place(patch)
    test = _line(patch, r"Test: (.*)")
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(place, Path(folder) / package, ignore=shutil.ignore_patterns("__pycache__"))
        _apply(patch, Path(folder))
        first = FIRST.format(tests=str(ROOT / "tests"), folder=folder, package=package)
        (Path(folder) / "sitecustomize.py").write_text(first)
        # coverage would look for the lines of the copy when it is gone.
        environment = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_PROCESS")}
        run = subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", test],
            cwd=ROOT,
            env=environment | {"PYTHONPATH": folder},
            capture_output=True,
            text=True,
            check=False,
        )
    if not re.search(r"\d+ (passed|failed)", run.stdout) or " error" in run.stdout.splitlines()[-1]:
        raise RuntimeError(f"{patch.name}: {test} does not run\n{run.stdout}\n{run.stderr}")
    return run.returncode == 1


def _place(patch: Path) -> Path:
    spec = find_spec(package_of(patch))
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent


def _line(patch: Path, pattern: str) -> str:
    found = re.search(f"^{pattern}$", patch.read_text(), re.MULTILINE)
    assert found is not None, f"{patch} has no line {pattern}"
    return found[1]


def _apply(patch: Path, folder: Path, *options: str) -> None:
    command = ["git", "apply", "-C1", *options, str(patch)]
    applied = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if applied.returncode:
        raise RuntimeError(f"{patch.name} does not fit the code any more: renew it\n{applied.stderr}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Put faults of the past back in, and run their tests.")
    parser.add_argument("names", nargs="*", help="which (default: all)")
    names = parser.parse_args().names
    missed = 0
    for patch in PATCHES:
        if not names or patch.stem in names:
            found = is_found(patch)
            missed += not found
            print(f"{'found' if found else 'NOT FOUND':9}  {patch.stem}: {_line(patch, 'Test: (.*)')}", flush=True)
    sys.exit(missed > 0)


if __name__ == "__main__":
    main()
