"""Runs the command that follows, with hulls that forget their first vertex: for the tests of what notices that."""

import runpy
import sys

from dynhull import DynamicHull

if __name__ == "__main__":
    right = DynamicHull.vertices
    DynamicHull.vertices = lambda self: right(self)[1:]
    sys.argv = sys.argv[1:]
    runpy.run_path(sys.argv[0], run_name="__main__")
