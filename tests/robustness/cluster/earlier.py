"""Tries this version beside an earlier one: a cluster that is upgraded, and the tests of each on servers of the other.

    python tests/robustness/cluster/earlier.py COMMIT -- tests/client

The earlier version gets a folder and an environment of its own, build/upgrade/COMMIT. Both versions run their own tests
with servers of the other one. Tests of what the other version does not have yet fail; whoever reads the result knows
which these are.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[3]
SUPPORT = ROOT / "tests" / "support"


def said(*words: str) -> str:
    """What a command of git says."""
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def made(commit: str) -> Path:
    """The folder of a commit, with an environment."""
    folder = ROOT / "build" / "upgrade" / said("rev-parse", "--short=12", f"{commit}^{{commit}}")
    if not folder.is_dir():
        folder.mkdir(parents=True)
        archive = subprocess.Popen(["git", "archive", commit], cwd=ROOT, stdout=subprocess.PIPE)
        subprocess.run(["tar", "-x", "-C", folder], stdin=archive.stdout, check=True)
        if archive.wait():
            raise SystemExit(f"git archive {commit} has failed")
    subprocess.run(["make", ".venv/.test"], cwd=folder, check=True)
    return folder


def tested(tests: Path, server: Path, paths: Sequence[str]) -> int:
    """Run the tests of one version on servers of another one. Returns the exit code of pytest."""
    print(f"tests of {tests} on servers of {server}", flush=True)
    environment = {
        **os.environ,
        "PYTHONPATH": str(SUPPORT),
        "OTHER_SERVER": str(server / ".venv/bin/dynhull"),
    }
    words = [tests / ".venv/bin/pytest", "-p", "other_server", "-q", "-n", "2", *paths]
    return subprocess.run(words, cwd=tests, env=environment, check=False).returncode


def main() -> None:
    parser = argparse.ArgumentParser(description="Try this version beside an earlier one.")
    parser.add_argument("commit", help="the earlier version")
    parser.add_argument("tests", nargs="+", help="which tests, as paths")
    options = parser.parse_args()
    base = made(options.commit)
    script = Path(__file__).with_name("upgrade.py")
    codes = [
        subprocess.run([sys.executable, script, "--base", base / ".venv/bin/dynhull"], check=False).returncode,
        tested(ROOT, base, options.tests),
        tested(base, ROOT, options.tests),
    ]
    sys.exit(max(codes))


if __name__ == "__main__":
    main()
