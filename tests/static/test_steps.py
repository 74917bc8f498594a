"""The running times that the docstrings claim, in counted steps."""

import math

import pytest
from static_work import count, points_with_vertices

from dynhull import convex_hull


@pytest.mark.parametrize("algorithm", ["graham_scan", "monotone_chain"])
def test_sorting_algorithms_do_not_depend_on_the_number_of_vertices(algorithm):
    n = 3000
    steps = [count(algorithm, n, h).steps for h in (3, 30, 300, n)]
    assert max(steps) <= 1.2 * min(steps)
    assert max(steps) <= n * math.log2(n) + 4 * n


def test_jarvis_looks_at_every_point_from_every_vertex():
    assert count("jarvis_march", 500, 40).orientations == 40 * 498


@pytest.mark.parametrize("n", [3000, 10_000])
def test_chan_grows_with_the_logarithm_of_the_number_of_vertices(n):
    steps = {h: count("chan", n, h).steps / n for h in (3, 30, 300)}
    assert all(per_point <= 9 * math.log2(h) for h, per_point in steps.items())
    # From 3 vertices to 300 the logarithm grows 5.2 times, its square 27 times.
    assert steps[300] <= 5.2 * steps[3]


@pytest.mark.parametrize(("n", "h"), [(3, 3), (1000, 3), (1000, 1000)])
def test_the_input_has_as_many_vertices_as_asked_for(n, h):
    xy = points_with_vertices(n, h)
    assert len(xy) == n
    assert len(convex_hull(xy)) == h
