"""Faults that a named test must find fit the code; `make soak` sees that they are found."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent))
from named import PATCHES, fits


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.stem)
def test_a_fault_can_be_put_back_in(patch):
    fits(patch)
