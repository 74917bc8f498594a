"""A short run of `callers.py`."""

from pathlib import Path

from callers import callers
from cases import slow


@slow
def test_callers_go_away(tmp_path: Path) -> None:
    callers(tmp_path, calls=1500, kills=2, seed=1)
