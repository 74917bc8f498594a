"""Runs the command in its arguments with fences that omit the first key inside, to test what detects that."""

import runpy
import sys

from dynhull import FenceIndex

WRONG_FENCES = [sys.executable, __file__]

if __name__ == "__main__":
    right = FenceIndex.inside
    FenceIndex.inside = lambda self, fence: right(self, fence)[1:]
    sys.argv = sys.argv[1:]
    runpy.run_path(sys.argv[0], run_name="__main__")
