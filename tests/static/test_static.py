"""Static algorithms against definitions in rational arithmetic."""

import numpy as np
import oracle
import pytest
from hypothesis import example, given, settings
from inputs import CIRCLE, points

from dynhull import DynamicHull, convex_hull, static
from dynhull.static.trace import Pop, Push, Round, Turn

ALGORITHMS = [static.monotone_chain, static.chan]
every = pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda f: f.__name__)

KILLER = [
    (7.3000000000000194, 7.3000000000000167),
    (24.000000000000068, 24.000000000000071),
    (24.00000000000005, 24.000000000000053),
    (0.50000000000001621, 0.50000000000001243),
    (8.0, 4.0),
    (4.0, 9.0),
    (15.0, 27.0),
    (25.0, 25.0),
    (19.0, 11.0),
]


def tuples(array):
    return list(map(tuple, array.tolist()))


@every
@given(rows=points(40))
@settings(max_examples=200)
@example(rows=CIRCLE)
@example(rows=KILLER)
@example(rows=[])
@example(rows=[(1.0, 2.0)] * 2)
def test_hull(algorithm, rows):
    assert tuples(algorithm(rows)) == oracle.hull(rows)
    assert tuples(algorithm(rows, collinear="keep")) == oracle.boundary(rows)
    assert tuples(convex_hull(rows)) == tuples(DynamicHull(rows).vertices()) == oracle.hull(rows)


@every
def test_empty_has_two_columns(algorithm):
    assert algorithm([]).shape == (0, 2)


@every
def test_bad_input(algorithm):
    with pytest.raises(ValueError, match=r"points row 1 is \(nan, 0\.0\)"):
        algorithm([[0, 0], [np.nan, 0]])
    with pytest.raises(ValueError, match='collinear must be "drop" or "keep"'):
        algorithm([[0, 0]], collinear="all")


def test_chan_rounds_square_the_guess():
    rng = np.random.default_rng(3)
    corners = np.array(CIRCLE)
    inside = rng.uniform(-50, 50, (4000, 2))
    rows = rng.permutation(np.concatenate([corners, inside]))
    rounds = []
    hull = static.chan(rows, trace=rounds)
    n, h = len(rows), len(hull)
    assert 16 < h < 256
    assert rounds == [
        Round(2, -(-n // 2), 2, n * 1.0, False),
        Round(4, -(-n // 4), 4, n * 2.0, False),
        Round(16, -(-n // 16), 16, n * 4.0, False),
        Round(256, -(-n // 256), h, n * 8.0, True),
    ]


def test_monotone_chain_trace_explains_the_hull():
    rows = [(0, 0), (2, 1), (4, 0), (2, 0)]
    trace = []
    hull = tuples(static.monotone_chain(rows, trace=trace))
    for event in trace:
        if isinstance(event, Turn):
            assert event.sign == oracle.turn(event.a, event.b, event.c)
    stacks, stack = [], []
    for event in trace:
        if isinstance(event, Push):
            if event.point == (0.0, 0.0):
                stack = []
                stacks.append(stack)
            stack.append(event.point)
        elif isinstance(event, Pop):
            assert stack.pop() == event.point
    lower, upper = stacks
    assert hull == lower + upper[-2:0:-1] == [(0.0, 0.0), (4.0, 0.0), (2.0, 1.0)]
