"""Every sign equals the one from rational arithmetic."""

import random
from fractions import Fraction
from itertools import combinations_with_replacement, permutations, product
from math import inf
from pathlib import Path

import numpy as np
import oracle
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from inputs import EXTREME, ULP, point

import dynhull
from dynhull import _predicates as predicates
from dynhull._predicates import cross_sign, cross_signs, direction_sign, dot_sign, dot_signs, orientation

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
    # The last point is the one that the others are taken relative to: rounding differs for each.
    rotations = [
        dynhull.orient2d(*three)
        for three in ((grid, (12, 12), (24, 24)), ((12, 12), (24, 24), grid), ((24, 24), grid, (12, 12)))
    ]
    for i, j in product(range(256), repeat=2):
        a = (0.5 + i * ULP, 0.5 + j * ULP)
        expected = oracle.turn(a, (12.0, 12.0), (24.0, 24.0))
        assert [signs[i, j] for signs in rotations] == [expected] * 3
        assert orientation((12.0, 12.0), (24.0, 24.0), a) == expected
        assert orientation(a, (12.0, 12.0), (24.0, 24.0)) == expected


def test_points_very_near_a_line():
    random_ = random.Random(0)
    triples = []
    for _ in range(5000):
        (ax, ay), (bx, by) = [(random_.random(), random_.random()) for _ in range(2)]
        along = random_.random() * 3 - 1
        triples.append(((ax, ay), (bx, by), (ax + along * (bx - ax), ay + along * (by - ay))))
    a, b, c = np.array(triples).transpose(1, 0, 2)
    expected = [oracle.turn(*triple) for triple in triples]
    assert dynhull.orient2d(a, b, c).tolist() == expected
    assert [orientation(*triple) for triple in triples] == expected
    assert [orientation(r, p, q) for p, q, r in triples] == expected


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


def exact(*points):
    return [(Fraction(x), Fraction(y)) for x, y in points]


def sign(value):
    return (value > 0) - (value < 0)


def exact_crossing(*points):
    """By the contract: the two heights on the vertical line through z, in rational numbers."""
    a, b, c, d, z = exact(*points)
    height_ab, height_cd = height(a, b, z, inf), height(c, d, z, -inf)
    return (height_ab > height_cd) - (height_ab < height_cd)


def height(p, q, z, steep):
    if p[0] == q[0]:
        return z[1] if p[0] == z[0] else steep
    return p[1] + (q[1] - p[1]) * (z[0] - p[0]) / (q[0] - p[0])


@pytest.fixture(scope="module", params=["python", "cpp"])
def crossing(request):
    if request.param == "python":
        return predicates.crossing
    if dynhull.KERNEL == "python":
        pytest.skip("the kernel is not built")
    return dynhull._kernel.crossing


@given(st.lists(point, min_size=5, max_size=5))
def test_any_crossing(crossing, points):
    a, b, z, c, d = sorted((x + 0.0, y + 0.0) for x, y in points)
    assume(a < b < z and c < d and (a[0] < b[0] or c[0] < d[0]))
    assert crossing(a, b, c, d, z) == exact_crossing(a, b, c, d, z)


def test_every_crossing_on_a_small_grid(crossing):
    """Vertical edges on both sides, and z above, below and at the ends of them."""
    grid = list(product((0.0, 1.0, 2.0), repeat=2))
    for a, b, z, c, d in combinations_with_replacement(grid, 5):
        if a < b < z and c < d and (a[0] < b[0] or c[0] < d[0]):
            assert crossing(a, b, c, d, z) == exact_crossing(a, b, c, d, z)


@pytest.mark.parametrize("scale", [1.0, 1e-150, 1e120])
def test_lines_that_cross_very_near_the_vertical(crossing, scale):
    """Where the two heights differ by less than rounding: the sign that no hull test can be sure to need."""
    random_ = random.Random(0)
    signs = set()
    for _ in range(2000):
        a, b, c, d = sorted((random_.random(), random_.random()) for _ in range(4))
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = exact(a, b, c, d)
        slope_ab, slope_cd = (by - ay) / (bx - ax), (dy - cy) / (dx - cx)
        z = float((ay - cy + slope_cd * cx - slope_ab * ax) / (slope_cd - slope_ab)), random_.random()
        if b < z <= c:
            points = [(x * scale, y * scale) for x, y in (a, b, c, d, z)]
            signs.add(exact_crossing(*points))
            assert crossing(*points) == exact_crossing(*points)
    assert {-1, 1} <= signs


@given(point, point, point)
def test_any_direction(d, a, b):
    expected = sign(oracle.dot(d, b) - oracle.dot(d, a))
    assert direction_sign(d, a, b) == expected


def test_directions_across_an_edge():
    """Directions as near as rounding gets to the normal of the edge, whose own difference is rounded too."""
    random_ = random.Random(0)
    for _ in range(3000):
        a, b = [tuple(random_.uniform(-1, 1) * 10 ** random_.uniform(-3, 3) for _ in range(2)) for _ in range(2)]
        stretch = random_.random()
        d = stretch * (a[1] - b[1]), stretch * (b[0] - a[0])
        assert direction_sign(d, a, b) == sign(oracle.dot(d, b) - oracle.dot(d, a))


def exact_cross_and_dot(*points):
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = exact(*points)
    (ux, uy), (vx, vy) = (bx - ax, by - ay), (dx - cx, dy - cy)
    return sign(ux * vy - uy * vx), sign(ux * vx + uy * vy)


def check_cross_and_dot(quadruples):
    """One by one, and as arrays."""
    expected = [exact_cross_and_dot(*points) for points in quadruples]
    assert [(cross_sign(*points), dot_sign(*points)) for points in quadruples] == expected
    arrays = np.array(quadruples).transpose(1, 0, 2)
    assert list(zip(cross_signs(*arrays).tolist(), dot_signs(*arrays).tolist(), strict=True)) == expected


@given(st.lists(st.tuples(point, point, point, point), min_size=1, max_size=5))
@example([((0.0, 0.0), (1.7e308, 1.7e308), (-1.7e308, 0.0), (0.0, -1.7e308))])
@example([((0.0, 0.0), (1e-200, 3e-200), (0.0, 0.0), (1e-200, 3e-200))])
def test_any_two_vectors(quadruples):
    check_cross_and_dot(quadruples)


def test_vectors_very_nearly_parallel_or_perpendicular():
    """As near as rounding gets to one direction, or to the right angle with it."""
    random_ = random.Random(0)
    quadruples = []
    for i in range(2000):
        a, b, c = [tuple(random_.uniform(-1, 1) * 10 ** random_.uniform(-3, 3) for _ in range(2)) for _ in range(3)]
        x, y = b[0] - a[0], b[1] - a[1]
        x, y = (x, y) if i % 2 else (-y, x)
        stretch = random_.uniform(-2, 2)
        quadruples.append((a, b, c, (c[0] + stretch * x, c[1] + stretch * y)))
    check_cross_and_dot(quadruples)
