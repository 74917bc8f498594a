"""Every sign equals the one from rational arithmetic."""

from itertools import permutations, product
from pathlib import Path

import numpy as np
import oracle
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from inputs import EXTREME, ULP, point

import dynhull

CASES = Path(__file__).parents[1] / "data" / "orient2d.txt"


def test_published_cases():
    rows = np.loadtxt(CASES)
    assert len(rows) == 1000
    a, b, c, signs = rows[:, 1:3], rows[:, 3:5], rows[:, 5:7], rows[:, 7]
    np.testing.assert_array_equal(dynhull.orient2d(a, b, c), signs)
    for p, q, r, sign in zip(a, b, c, signs, strict=True):
        assert dynhull.orient2d(p, q, r) == sign
        assert oracle.turn(tuple(p), tuple(q), tuple(r)) == sign


def test_perturbation_grid():
    """Kettner, Mehlhorn, Pion, Schirra, Yap: 65,536 points around (0.5, 0.5), one unit in the last place apart."""
    steps = 0.5 + np.arange(256) * ULP
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)
    signs = dynhull.orient2d(grid, (12, 12), (24, 24))
    for i, j in product(range(256), repeat=2):
        a = (0.5 + i * ULP, 0.5 + j * ULP)
        expected = oracle.turn(a, (12.0, 12.0), (24.0, 24.0))
        assert signs[i, j] == expected
        assert dynhull.orient2d(a, (12.0, 12.0), (24.0, 24.0)) == expected


@given(point, point, point)
@example((5e-324, 0.0), (0.0, 5e-324), (0.0, 0.0))
@example((1.7e308, 1.7e308), (-1.7e308, -1.7e308), (0.0, 5e-324))
@example((1.7e308, -1.7e308), (-1.7e308, 1.7e308), (0.0, 0.0))
@example((1e-200, 2e-200), (2e-200, 4e-200), (3e-200, 6e-200))
def test_any_three_points(a, b, c):
    for p, q, r in permutations((a, b, c)):
        expected = oracle.turn(p, q, r)
        assert dynhull.orient2d(p, q, r) == expected
        assert dynhull.orient2d([p], q, r).tolist() == [expected]


def test_mixtures_of_extreme_coordinates():
    values = np.array(EXTREME + [-value for value in EXTREME])
    rng = np.random.default_rng(0)
    triples = rng.choice(values, size=(20_000, 3, 2))
    triples[::3, 2] = (triples[::3, 0] / 2 + triples[::3, 1] / 2) + 0.0
    signs = dynhull.orient2d(triples[:, 0], triples[:, 1], triples[:, 2])
    for (a, b, c), sign in zip(triples.tolist(), signs.tolist(), strict=True):
        assert sign == oracle.turn(a, b, c)


def test_broadcasting():
    a = np.zeros((3, 1, 2))
    b = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    signs = dynhull.orient2d(a, b, (1, 1))
    assert signs.shape == (3, 4)
    assert signs.dtype == np.int8
    assert signs[0].tolist() == [1, -1, -1, 1]
    assert isinstance(dynhull.orient2d((0, 0), (1, 0), (0, 1)), int)


@given(st.sampled_from(["a", "b", "c"]), st.sampled_from([np.nan, np.inf, -np.inf]))
def test_not_finite_is_refused(name, value):
    arguments = {"a": (0, 0), "b": [(1, 0), (2, 0)], "c": (0, 1)}
    arguments[name] = [(0, 0), (value, 1)]
    with pytest.raises(ValueError, match=rf"^{name} row 1 is .*must be finite"):
        dynhull.orient2d(**arguments)
