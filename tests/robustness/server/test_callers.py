"""A short run of `callers.py`."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))
from callers import callers


def test_callers_go_away(tmp_path: Path) -> None:
    callers(tmp_path, calls=1500, kills=2, seed=1)
