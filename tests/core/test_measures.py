"""Diameter, width, smallest box, distances and crossings, against definitions in rational arithmetic."""

from fractions import Fraction
from itertools import combinations, pairwise
from math import inf

import numpy as np
import oracle
import pytest
from hulls import HULLS
from hypothesis import example, given
from inputs import any_points, grid_points, questions
from oracle import assert_rounded, exact, nearest, root, segment_distance

from dynhull import DynamicHull, measure

both = pytest.mark.parametrize("make", HULLS.values(), ids=HULLS.keys())


def squared(p, q):
    (px, py), (qx, qy) = exact(p), exact(q)
    return (px - qx) ** 2 + (py - qy) ** 2


def cross(o, a, b):
    return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])


def edges(rows):
    corners = [exact(p) for p in oracle.hull(rows)]
    return list(zip(corners, corners[1:] + corners[:1], strict=True)) if len(corners) > 1 else []


@given(any_points)
def test_diameter(rows):
    assert_rounded(
        DynamicHull(rows).diameter(), root(max((squared(p, q) for p, q in combinations(rows, 2)), default=Fraction(0)))
    )


@given(any_points)
def test_width(rows):
    widths = [Fraction(max(cross(a, b, exact(p)) for p in rows)) ** 2 / squared(a, b) for a, b in edges(rows)]
    assert_rounded(DynamicHull(rows).width(), root(min(widths, default=Fraction(0))))


@given(any_points)
@example([])
@example([(1.0, 2.0)])
@example([(0.0, 0.0), (1e300, 1e-300), (-1e-300, 1e300), (5e-324, 0.0)])
@example([(np.cos(angle), np.sin(angle)) for angle in np.linspace(0, 6, 80).tolist()])
def test_the_summary_has_the_same_numbers(rows):
    vertices = DynamicHull(rows).vertices()
    found = measure.summary(vertices)
    for name in measure.Summary._fields:
        np.testing.assert_equal(getattr(found, name), getattr(measure, name)(vertices), name)


@given(grid_points)
def test_min_box(rows):
    box = DynamicHull(rows).min_box()
    a, b, c, d = box
    area = float(cross(a, b, d))
    areas = []
    for p, q in edges(rows):
        u = (q[0] - p[0], q[1] - p[1])
        along = [u[0] * Fraction(x) + u[1] * Fraction(y) for x, y in rows]
        height = max(cross(p, q, exact(r)) for r in rows)
        areas.append((max(along) - min(along)) * height / (u[0] ** 2 + u[1] ** 2))
    assert area == pytest.approx(float(min(areas, default=0)), abs=1e-9)
    np.testing.assert_allclose(b - a, c - d, atol=1e-12)
    assert abs(float(np.dot(b - a, d - a))) < 1e-9
    for p in rows:
        for q, r in ((a, b), (b, c), (c, d), (d, a)):
            assert cross(q, r, p) >= -1e-9


@both
@given(questions(8))
@example(([(0.0, 0.0)], [(193.0, 182.0)]))  # 64 bits of this root end halfway between two doubles
@example(([(1.0, 0.0)], [(-(2.0**-53), 0.0)]))  # halfway between two doubles: to the even one, down and up
@example(([(1 + 2.0**-52, 0.0)], [(-(2.0**-53), 0.0)]))
@example(([(-1.7e308, 0.0)], [(1.7e308, 0.0), (9e307, 0.0), (1.7e308, 1.7e308)]))
@example(([(0.0, 0.0), (3.0, 0.0), (0.0, 3.0)], [(3.0, 5e-324), (-5e-324, 1.0), (1.5, 1.5000000000000002)]))
@example(([(0.0, 0.0), (1.7e308, 5e-324)], [(1.0, 5e-324), (1e308, -5e-324), (-1.0, -1.0)]))
def test_distance(make, question):
    rows, queries = question
    corners = oracle.hull(rows)
    sides = list(zip(corners, corners[1:] + corners[:1], strict=True))
    for measured, q in zip(make(rows).distance(queries).tolist(), queries, strict=True):
        if oracle.locate(corners, q) >= 0:
            assert measured == 0
        else:
            assert measured == nearest(root(min(segment_distance(q, a, b) for a, b in sides)))


def crossings(corners, p, q):
    """The ends of a line's part inside, exactly, by clipping it against every edge."""
    p, q = exact(p), exact(q)
    corners = [exact(c) for c in corners]
    found = set()
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        at_a, at_b = cross(p, q, a), cross(p, q, b)
        found |= {v for v, at in ((a, at_a), (b, at_b)) if at == 0}
        if at_a * at_b < 0:
            share = at_a / (at_a - at_b)
            found.add((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
    found = sorted(found, key=lambda v: (q[0] - p[0]) * v[0] + (q[1] - p[1]) * v[1])
    return [found[0], found[-1]] if found else None


@both
@given(questions(12))
@example(([(0.5, 0.0), (0.5 + 2.0**-53, 1.0)], [(0.0, 0.5), (1.0, 0.5)]))  # halfway between two doubles
@example(([(0.5 + 2.0**-53, 0.0), (0.5 + 2.0**-52, 1.0)], [(0.0, 0.5), (1.0, 0.5)]))
@example(([(-1.0, -1.0), (1.0, -3.0), (1.0, 3.0)], [(0.0, 0.0), (3.0, 1.0), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]))
@example(([(-5e-324, 0.0), (5e-324, 5e-324), (0.0, -1.0)], [(0.0, 0.0), (5e-324, 1e-323), (0.0, -0.5), (1.0, 1.0)]))
@example(([(-1.7e308, -1.7e308), (1.7e308, 1.0), (0.0, 1.7e308)], [(0.0, 0.0), (1.0, 3.0), (1e308, 0.0), (1e308, 1.0)]))
def test_intersect_lines(make, question):
    rows, asked = question
    lines = [(p, q) for p, q in pairwise(asked) if p != q]
    if not lines:
        return
    p, q = zip(*lines, strict=True)
    for line, found in zip(lines, make(rows).intersect_lines(p, q), strict=True):
        expected = crossings(oracle.hull(rows), *line)
        if expected is None:
            assert np.isnan(found).all()
        else:
            assert found.tolist() == [[float(x), float(y)] for x, y in expected]


@both
def test_no_points(make):
    hull = make()
    assert (hull.diameter(), hull.width()) == (0.0, 0.0)
    assert np.isnan(hull.min_box()).all()
    assert hull.distance([[1, 2]]).tolist() == [inf]
    assert np.isnan(hull.intersect_lines([[0, 0]], [[1, 1]])).all()


@both
def test_no_questions(make):
    for hull in (make(), make([[0, 0], [1, 2], [3, 0]])):
        assert hull.distance([]).shape == (0,)
        assert hull.intersect_lines([], []).shape == (0, 2, 2)


@both
def test_known_values(make):
    hull = make([[0, 0], [4, 0], [4, 3], [0, 3], [2, 1]])
    assert (hull.diameter(), hull.width()) == (5.0, 3.0)
    assert hull.min_box().tolist() == [[0, 0], [4, 0], [4, 3], [0, 3]]
    assert hull.distance([[-3, -4], [2, 5], [2, 2], [6, 1]]).tolist() == [5, 2, 0, 2]
    assert hull.intersect_lines([[2, 9]], [[2, 8]]).tolist() == [[[2, 3], [2, 0]]]
    assert hull.intersect_lines([[9, 3], [-1, 3]], [[8, 3], [7, 3]]).tolist() == [[[4, 3], [0, 3]], [[0, 3], [4, 3]]]
    assert hull.intersect_lines([[3, 4]], [[5, 2]]).tolist() == [[[4, 3], [4, 3]]]


@both
def test_bad_lines(make):
    hull = make([[0, 0]])
    with pytest.raises(ValueError, match="p and q row 1 are the same point, which defines no line"):
        hull.intersect_lines([[0, 0], [1, 1]], [[0, 1], [1, 1]])
    with pytest.raises(ValueError, match="p and q must have the same length, got 1 and 2"):
        hull.intersect_lines([[0, 0]], [[0, 1], [1, 1]])
    with pytest.raises(ValueError, match=r"q row 0 is .*must be finite"):
        hull.intersect_lines([[0, 0]], [[0, np.nan]])
    with pytest.raises(ValueError, match=r"row 1 is .*must be finite"):
        hull.distance([[0, 0], [np.inf, 1]])
