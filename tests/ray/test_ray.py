"""Hulls of Ray Datasets. One session of Ray for all of it, in a process of its own: Ray takes seconds to start."""

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from patience import PATIENCE

pytestmark = [pytest.mark.long, pytest.mark.only_with("RAY_CASES")]

PROBLEMS = {
    "block": ("ValueError", "bad.parquet, row 1234 is (inf, 0.0)"),
    "file": ("ValueError", "bad.parquet, row 1234 is (inf, 0.0)"),
    "unnamed": ("ValueError", "dataset has the columns a, b, c: name two, x first"),
    "absent": ("ValueError", "columns has 'height', but dataset has the columns lat, name, lon"),
    "array": ("TypeError", "dataset must be a ray.data.Dataset, got ndarray"),
    "not finite": ("ValueError", "block of 2 rows, row 1 is (3.0, nan): coordinates must be finite"),
    "missing": ("ValueError", "columns x and y, block of 2 rows, row 1: y is missing"),
    "inexact": ("ValueError", "row 0 is 1152921504606846977: no double has this value"),
    "words": ("TypeError", "row 0: coordinates must be real numbers, got 'one'"),
}


@pytest.fixture(scope="module")
def found():
    script = Path(__file__).with_name("session.py")
    # Not a folder of pytest's: the names of Ray's sockets would be too long.
    with TemporaryDirectory(dir="/tmp", ignore_cleanup_errors=True) as folder:
        command = [sys.executable, script, folder]
        run = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_the_hull_of_a_dataset_is_that_of_its_points(found):
    assert found["equal"]
    assert found["vertices"] > 1000


@pytest.mark.parametrize("problem", PROBLEMS)
def test_errors_say_what_is_wrong_and_where(found, problem):
    kind, words = PROBLEMS[problem]
    assert found[problem][0] == kind
    assert words in found[problem][1]


def test_files_other_columns_and_integers(found):
    assert found["files"]
    assert found["turned"]
    assert found["integers"] == [[0, 0], [9, 0], [8, 2], [2, 2]]
