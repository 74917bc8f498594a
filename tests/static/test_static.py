"""Static algorithms against definitions in rational arithmetic."""

from itertools import pairwise

import numpy as np
import oracle
import pytest
from hulls import ALGORITHMS
from hypothesis import example, given
from inputs import CIRCLE, points

from dynhull import static
from dynhull.static.trace import Groups, Pop, Push, Round, Rounds, Scan, Turn, Wrap

every = pytest.mark.parametrize("algorithm", ALGORITHMS.values(), ids=ALGORITHMS.keys())


def tuples(array):
    return list(map(tuple, array.tolist()))


@every
@given(rows=points(40))
@example(rows=CIRCLE)
@example(rows=[])
@example(rows=[(1.0, 2.0)] * 2)
def test_hull(algorithm, rows):
    assert tuples(algorithm(rows)) == oracle.hull(rows)
    assert tuples(algorithm(rows, collinear="keep")) == oracle.boundary(rows)


@every
def test_empty_has_two_columns(algorithm):
    assert algorithm([]).shape == (0, 2)


@every
def test_bad_input(algorithm):
    with pytest.raises(ValueError, match=r"points row 1 is \(nan, 0\.0\)"):
        algorithm([[0, 0], [np.nan, 0]])
    with pytest.raises(ValueError, match='collinear must be "drop" or "keep"'):
        algorithm([[0, 0]], collinear="all")


EXAMPLE = [(0, 0), (4, 0), (5, 2), (4, 4), (2, 3), (0, 4), (1, 2), (2, 1)]
CORNERS = [(0, 0), (4, 0), (5, 2), (4, 4), (0, 4)]


def test_graham_worked_example():
    trace = []
    assert tuples(static.graham_scan(EXAMPLE, trace=trace)) == CORNERS
    scan, *events = trace
    assert scan == Scan("hull", ((0, 0), (4, 0), (5, 2), (2, 1), (4, 4), (2, 3), (1, 2), (0, 4)))
    turns = [event for event in events if isinstance(event, Turn)]
    assert [turn.cross for turn in turns] == [8, 5, -7, 4, 5, 1, -3, -4, 8]
    assert [turn.sign for turn in turns] == [1, 1, -1, 1, 1, 1, -1, -1, 1]
    assert len([event for event in events if isinstance(event, Push)]) == 8
    assert [event.point for event in events if isinstance(event, Pop)] == [(2, 1), (1, 2), (2, 3)]


def test_graham_takes_equal_angles_nearer_first_but_keeps_the_last_ray_farther_first():
    rows = [(0, 0), (0, 1), (0, 2), (2, 2), (1, 1), (2, 0), (1, 0)]
    scans = []
    for collinear in ("drop", "keep"):
        trace = []
        static.graham_scan(rows, collinear=collinear, trace=trace)
        scans.append(trace[0].points)
    assert scans[0] == ((0, 0), (1, 0), (2, 0), (1, 1), (2, 2), (0, 1), (0, 2))
    assert scans[1] == ((0, 0), (1, 0), (2, 0), (1, 1), (2, 2), (0, 2), (0, 1))


def test_jarvis_looks_at_every_other_point_from_every_vertex():
    trace = []
    hull = tuples(static.jarvis_march(EXAMPLE, trace=trace))
    turns = [event for event in trace if isinstance(event, Turn)]
    assert [event.point for event in trace if isinstance(event, Push)] == hull == CORNERS
    assert len(turns) == len(hull) * (len(EXAMPLE) - 2)
    assert [turn.a for turn in turns[:: len(EXAMPLE) - 2]] == hull


def hull_of_size(n, h):
    """n points in random order, h of them the vertices: on a circle, the others well inside."""
    rng = np.random.default_rng(3)
    angle = 2 * np.pi * np.arange(h) / h
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return rng.permutation(np.concatenate([corners, rng.uniform(-0.5, 0.5, (n - h, 2))]))


@pytest.mark.parametrize("n", [1000, 20_000])
@pytest.mark.parametrize("trace_type", [list, Rounds])
def test_chan_rounds_square_the_guess(n, trace_type):
    """For 100 vertices the rounds cost n, 2n, 4n, 8n, and the fourth closes, whatever n."""
    trace = trace_type()
    hull = static.chan(hull_of_size(n, 100), trace=trace)
    assert len(hull) == 100
    assert trace_type is list or all(isinstance(event, Round) for event in trace)
    assert [event for event in trace if isinstance(event, Round)] == [
        Round(2, -(-n // 2), 2, n * 1.0, False),
        Round(4, -(-n // 4), 4, n * 2.0, False),
        Round(16, -(-n // 16), 16, n * 4.0, False),
        Round(256, -(-n // 256), 100, n * 8.0, True),
    ]


@given(rows=points(80))
@example(rows=[])
@example(rows=[(1.0, 1.0)] * 20)
def test_chan_without_steps_has_the_same_rounds(rows):
    steps, rounds = [], Rounds()
    assert tuples(static.chan(rows, trace=steps)) == tuples(static.chan(rows, trace=rounds)) == oracle.hull(rows)
    assert rounds == [event for event in steps if isinstance(event, Round)]


def test_chan_trace_shows_groups_and_tangents():
    trace = []
    hull = tuples(static.chan(EXAMPLE, trace=trace))
    last = max(i for i, event in enumerate(trace) if isinstance(event, Groups))
    groups, *wraps, end = trace[last:]
    assert groups == Groups(16, (tuple(CORNERS),))
    assert [wrap.vertex for wrap in wraps] == hull
    assert [wrap.best for wrap in wraps] == [*hull[1:], hull[0]]
    assert end == Round(16, 1, 5, 32.0, True)
    for groups, wrap in pairwise(trace):
        if isinstance(groups, Groups):
            assert all(tuple(oracle.hull(hull)) == hull for hull in groups.hulls)
            assert isinstance(wrap, Wrap)
            for hull, tangent in zip(groups.hulls, wrap.tangents, strict=True):
                assert tangent in hull
                assert tangent == wrap.vertex or all(oracle.turn(wrap.vertex, tangent, p) >= 0 for p in hull)


@pytest.mark.parametrize("collinear", ["drop", "keep"])
@pytest.mark.parametrize("algorithm", [static.graham_scan, static.monotone_chain], ids=lambda f: f.__name__)
def test_pushes_and_pops_leave_the_hull(algorithm, collinear):
    rows = [(0, 0), (2, 1), (4, 0), (2, 0), (3, 0.5), (2, 1), (1, 0.5), (2, 0.5)]
    trace = []
    hull = tuples(algorithm(rows, collinear=collinear, trace=trace))
    chains = {}
    for event in trace:
        if isinstance(event, Scan):
            chain = chains[event.name] = []
        elif isinstance(event, Push):
            chain.append(event.point)
        elif isinstance(event, Pop):
            assert chain.pop() == event.point
        else:
            assert event.sign == oracle.turn(event.a, event.b, event.c) == np.sign(event.cross)
            assert (event.a, event.b) == tuple(chain[-2:])
    if len(chains) == 2:
        chains["hull"] = chains["lower chain"] + chains["upper chain"][-2:0:-1]
    assert hull == chains["hull"] == (oracle.hull(rows) if collinear == "drop" else oracle.boundary(rows))
