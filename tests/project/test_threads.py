"""What two threads do first, at the same time."""

import subprocess
import sys

import pytest

# numpy imports some of its parts when they are first used. Between the import and the moment at which numpy has the
# part, a second thread that uses it recurses for ever (python/cpython#149728); here until that thread has ended.
TWO_THREADS = """
import sys, threading
import numpy as np
{before}

class Slow(type(np)):
    def __setattr__(self, name, value):
        if name == "ma":
            importing.set()
            ended.wait()
        super().__setattr__(name, value)

importing, ended = threading.Event(), threading.Event()
np.__class__ = Slow

def first():
    {call}
    importing.set()

thread = threading.Thread(target=first)
thread.start()
importing.wait()
try:
    {call}
finally:
    ended.set()
    thread.join()
"""


@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("before", "call"),
    [
        ("import dynhull_server.app", "np.unique([1])"),
        ("from dynhull.convex import Cloud", "Cloud([(0, 0), (1, 0)])"),
        ("from dynhull.decompose import convex_pieces", "convex_pieces([(0, 0), (1, 0), (0, 1)])"),
        ("from dynhull.range_search import RangeSearch", "RangeSearch([]).polygons([[[(0, 0), (1, 0), (0, 1)]]])"),
        ("from dynhull.static import hull_nd", "hull_nd([(0, 0), (1, 0)])"),
    ],
    ids=["server", "convex", "decompose", "range_search", "hull_nd"],
)
def test_two_threads_may_be_the_first_that_need_a_part_of_numpy(before, call):
    program = TWO_THREADS.format(before=before, call=call)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
