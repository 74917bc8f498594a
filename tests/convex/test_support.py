"""Support functions of shapes, against points of these shapes."""

import numpy as np
import oracle
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inputs import any_points, finite, grid_points

from dynhull import DynamicHull
from dynhull.convex import (
    Cloud,
    ball,
    box,
    capsule,
    convex_combination,
    minkowski_difference,
    minkowski_sum,
    moved,
    point,
    polygon,
    rotated,
    scaled,
    segment,
    sum_of_polygons,
)

directions = st.tuples(finite, finite).filter(any)


@given(any_points, directions)
def test_polygons_are_exact(rows, direction):
    expected = max(sorted(oracle.hull(rows)), key=lambda p: oracle.dot(direction, p))
    for shape in (polygon(rows), Cloud(rows), DynamicHull(rows)):
        assert shape.support([direction]).tolist() == [list(expected)]


def test_clouds_in_space_are_exact():
    """Of points that floats find equally far, the farthest; of points equally far, the least."""
    tiny = 2.0**-60
    cloud = Cloud([[1, 1, 0], [1, 1, tiny], [1, 0, 1], [0, 1, 1]])
    assert cloud.support([[1, 1, 1], [1, 1, 2], [-1, 0, 0]]).tolist() == [[1, 1, tiny], [0, 1, 1], [0, 1, 1]]


def test_shapes():
    ways = [[1, 0], [0, 1], [-1, -2]]
    assert point([3, 4]).support(ways).tolist() == [[3, 4]] * 3
    assert segment([0, 0], [2, 1]).support(ways).tolist() == [[2, 1], [2, 1], [0, 0]]
    assert box([0, 0], [2, 1]).support(ways).tolist() == [[2, 0], [0, 1], [0, 0]]
    assert ball([5, 0], 2).support([[3, 4], [0, -1e300]]) == pytest.approx(np.array([[6.2, 1.6], [5, -2]]))
    assert capsule([0, 0, 0], [0, 0, 9], 1).support([[0, 0, 1], [1, 0, 0]]).tolist() == [[0, 0, 10], [1, 0, 0]]
    assert scaled(ball([1, 1], 1), [2, 3]).support([[1, 0], [0, 1]]).tolist() == [[4, 3], [2, 6]]


@pytest.mark.parametrize("d", [2, 3])
def test_maps_and_sums_are_those_of_the_points(d):
    random = np.random.default_rng(d)
    p, q = random.normal(size=(30, d)), random.normal(size=(20, d))
    ways, offset, factors = random.normal(size=(50, d)), random.normal(size=d), random.uniform(-2, 2, d)
    turn = np.linalg.qr(random.normal(size=(d, d)))[0]
    sums = (p[:, None] + q).reshape(-1, d)
    a, b = Cloud(p), Cloud(q)
    for shape, points in [
        (moved(a, offset), p + offset),
        (rotated(a, turn), p @ turn.T),
        (scaled(a, -1.5), -1.5 * p),
        (scaled(a, factors), factors * p),
        (minkowski_sum(a, b), sums),
        (minkowski_difference(a, b), (p[:, None] - q).reshape(-1, d)),
        (convex_combination(a, b, 0.25), (0.75 * p[:, None] + 0.25 * q).reshape(-1, d)),
    ]:
        reached = (shape.support(ways) * ways).sum(axis=1)
        np.testing.assert_allclose(reached, (points @ ways.T).max(axis=0), rtol=1e-13, atol=1e-13)


def test_a_turned_square_stands_on_its_corner():
    assert rotated(box([-1, -1], [1, 1]), np.pi / 4).support([[0, -1]]) == pytest.approx(np.array([[0, -(2**0.5)]]))


def test_a_live_hull_stays_live_inside_of_others():
    hull = DynamicHull([[0, 0]])
    shape = moved(minkowski_sum(hull, ball([0, 0], 1)), [10, 0])
    assert shape.support([[1, 0]]).tolist() == [[11, 0]]
    hull.insert(5, 0)
    assert shape.support([[1, 0]]).tolist() == [[16, 0]]


@given(grid_points, grid_points)
def test_sum_of_polygons(rows, others):
    sums = [(p[0] + q[0], p[1] + q[1]) for p in rows for q in others]
    assert sum_of_polygons(rows, others).tolist() == [list(p) for p in oracle.hull(sums)]


def test_flat_images():
    """Scaled to a point or to a segment: along what is gone every point is farthest."""
    assert scaled(box([1, 1], [2, 2]), 0).support([[1, 0]]).tolist() == [[0, 0]]
    assert scaled(ball([0, 0], 1), [1, 0]).support([[0, 1]])[0, 1] == 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Cloud([]), "points are none"),
        (lambda: polygon([[0, 0], [1, np.nan]]), "points row 1 is"),
        (lambda: ball([0, 0], -1), "radius is -1"),
        (lambda: ball([0, 0], np.inf), "radius is inf"),
        (lambda: ball([0, np.inf], 1), "centre row 0"),
        (lambda: point(3), r"p must have shape \(d,\)"),
        (lambda: segment([0, 0], [0, 0, 0]), "same dimension"),
        (lambda: minkowski_sum(point([0, 0]), point([0, 0, 0])), "of one dimension"),
        (lambda: convex_combination(point([0, 0]), point([1, 1]), 1.5), "share is 1.5"),
        (lambda: rotated(point([0, 0]), [[1, 1], [0, 1]]), "no orthogonal matrix"),
        (lambda: rotated(point([0, 0, 0]), 1.0), "one angle turns the plane"),
        (lambda: rotated(point([0, 0]), np.nan), "rotation is nan"),
        (lambda: moved(point([0, 0]), [1, 2, 3]), "must have shapes"),
        (lambda: point([0, 0]).support([[0, 0]]), "directions row 0"),
        (lambda: ball([0, 0], 1).support([[1, 0], [np.inf, 1]]), "directions row 1"),
        (lambda: ball([0, 0], 1).support([[1, 0, 0]]), r"directions must have shape \(k, 2\)"),
        (lambda: DynamicHull().support([[1, 0]]), "empty hull"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_no_points_make_no_sum():
    assert sum_of_polygons([], [[0, 0]]).shape == (0, 2)
