"""Runs the command in its arguments with hulls that omit their first vertex, to test what detects a wrong hull."""

import runpy
import sys

from dynhull import DynamicHull

FORGETFUL = [sys.executable, __file__]

if __name__ == "__main__":
    right = DynamicHull.vertices
    DynamicHull.vertices = lambda self: right(self)[1:]
    sys.argv = sys.argv[1:]
    runpy.run_path(sys.argv[0], run_name="__main__")
