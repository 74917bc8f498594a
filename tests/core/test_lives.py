"""A short run of `make fuzz` on the reference: see lives.py."""

import subprocess
import sys
from pathlib import Path

import lives
import pytest
from cases import slow

from dynhull._tree import HullTree


def test_random_lives():
    operations, failure = lives.survive(range(60))
    assert not failure, failure
    assert operations > 1000


def test_a_fault_is_found_and_can_be_lived_again(monkeypatch):
    """A tree that forgets the lower chain's upkeep on deletes."""
    repair = HullTree._climb_removed
    monkeypatch.setattr(
        HullTree, "_climb_removed", lambda tree, path, p, side: side == 1 or repair(tree, path, p, side)
    )
    _, failure = lives.survive(range(60))
    assert failure.startswith("seed ")
    seed = int(failure.split()[1])
    assert lives.survive([seed])[1] == failure


@slow
@pytest.mark.parametrize("words", [["--operations", "300", "--jobs", "1"], ["1", "2"]])
def test_the_command_says_how_many_operations_were_checked(words):
    script = Path(lives.__file__)
    run = subprocess.run([sys.executable, script, *words], capture_output=True, text=True, check=True)
    assert "operations checked" in run.stdout
