"""Efficient frontiers, against direct maximisation and definitions."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import oracle
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynhull.envelope import Frontier

point = st.tuples(st.integers(1, 12).map(float), st.integers(-6, 12).map(float))
points = st.lists(point, min_size=1, max_size=12)
rates = st.integers(-40, 40).map(lambda i: i / 2)


def sharpe(p, rate):
    return (Fraction(p[1]) - Fraction(rate)) / Fraction(p[0])


@given(points, rates)
def test_tangency_maximises_the_sharpe_ratio(rows, rate):
    frontier = Frontier(rows)
    best = max(rows, key=lambda p: (sharpe(p, rate), p[0]))
    assert frontier.tangency(rate) == best
    assert frontier.sharpe_ratio(rate) == float(sharpe(best, rate))


@given(points)
def test_the_tangency_moves_at_the_rates_that_are_told(rows):
    frontier = Frontier(rows)
    moves = frontier.tangencies()
    assert all(a < b for a, b in pairwise(moves.rates.tolist()))
    ends = [-1e3, *moves.rates.tolist(), 1e3]  # all risks and returns are small
    assert [frontier.tangency((a + b) / 2) for a, b in pairwise(ends)] == [tuple(p) for p in moves.points.tolist()]


def mixtures_beat(rows, p):
    """Whether a point or a mixture of two is better than p: no more risk, no less return, and not the same."""
    corners = oracle.hull(rows)
    for a in corners:
        for b in corners:
            # The best return of the segment at risk up to that of p, where the segment has such risks.
            (ax, ay), (bx, by) = ((Fraction(x), Fraction(y)) for x, y in (min(a, b), max(a, b)))
            x, y = Fraction(p[0]), Fraction(p[1])
            if ax > x:
                continue
            share = min(Fraction(1), (x - ax) / (bx - ax)) if bx > ax else Fraction(0)
            for risk, gain in ((ax, ay), (ax + share * (bx - ax), ay + share * (by - ay))):
                if gain > y or (gain == y and risk < x):
                    return True
    return False


@given(points, points)
def test_dominated_by_definition(rows, others):
    assert Frontier(rows).dominated(others).tolist() == [mixtures_beat(rows, p) for p in others]


@given(points, point)
def test_efficient_points_are_those_that_nothing_beats(rows, new):
    frontier = Frontier(rows)
    efficient = frontier.efficient()
    assert not frontier.dominated(efficient).any()
    assert np.all(np.diff(efficient, axis=0) > 0)
    changed = frontier.add(*new)
    assert changed == (not np.array_equal(efficient, frontier.efficient()))
    assert frontier.remove(*new) == changed
    np.testing.assert_array_equal(frontier.efficient(), efficient)
    assert len(frontier) == len(rows)
    assert frontier.points().tolist() == sorted([list(p) for p in rows])


def test_a_frontier_without_points():
    frontier = Frontier()
    assert frontier.efficient().shape == frontier.tangencies().points.shape == (0, 2)
    assert frontier.dominated([[1, 1]]).tolist() == [False]
    with pytest.raises(ValueError, match="without points has no tangency"):
        frontier.tangency(0)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda f: f.add(0, 1), "points row 0 has risk 0.0: must be positive"),
        (lambda f: f.add(1, np.nan), "points row 0"),
        (lambda f: f.dominated([[1, 1], [-1, 0]]), "points row 1 has risk -1"),
        (lambda f: f.tangency(np.inf), "rate is inf"),
    ],
)
def test_bad_input(ask, message):
    frontier = Frontier([[1, 1]])
    with pytest.raises(ValueError, match=message):
        ask(frontier)
    assert len(frontier) == 1


def test_a_point_that_is_not_there():
    with pytest.raises(KeyError, match="is missing and cannot be deleted"):
        Frontier([[1, 1]]).remove(1, 2)
