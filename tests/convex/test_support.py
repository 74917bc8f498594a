"""Support functions of shapes, against points of these shapes."""

from fractions import Fraction
from math import inf, nextafter

import numpy as np
import oracle
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from inputs import any_points, finite, grid_points

from dynhull import DynamicHull
from dynhull.convex import (
    Cloud,
    ball,
    box,
    capsule,
    cone,
    convex_combination,
    cylinder,
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


def test_cylinders_and_cones():
    ways = [[4, 3, 0], [4, 3, 1e-9], [0, 0, 1], [0, 0, -7], [3, -4, -1e300]]
    upright = cylinder([1, 0, 0], [1, 0, 2], 5)
    assert upright.support(ways).tolist() == [[5, 3, 0], [5, 3, 2], [1, 0, 2], [1, 0, 0], [4, -4, 0]]
    assert cone([1, 0, 0], [1, 0, 2], 5).support(ways).tolist() == [
        [5, 3, 0],
        [5, 3, 0],
        [1, 0, 2],
        [1, 0, 0],
        [4, -4, 0],
    ]
    assert cylinder([0, 0, 0], [1, 1, 0], 0).support([[1, 0, 5]]).tolist() == [[1, 1, 0]]
    assert cone([0, 0, 0], [1e308, 0, 0], 1e308).support([[-1, 0, -1e-308]]).tolist() == [[0, 0, -1e308]]
    assert cylinder([0, 0, -1e308], [0, 0, 1e308], 5e-324).support([[5e-324, 0, 0]]).tolist() == [[5e-324, 0, -1e308]]


def test_whether_the_apex_or_the_rim_is_farther_is_exact():
    """In direction (4, 0, 3) both are equally far."""
    shape = cone([0, 0, 0], [0, 0, 4], 3)
    ways = [[4, 0, 3], [4, 0, nextafter(3, 0)], [nextafter(4, inf), 0, 3], [4e300, 0, 3e300]]
    assert shape.support(ways).tolist() == [[0, 0, 4], [3, 0, 0], [3, 0, 0], [0, 0, 4]]


coordinates = st.floats(-1e6, 1e6)
vectors = st.tuples(coordinates, coordinates, coordinates)


@given(vectors, vectors, st.floats(0, 1e6), vectors.filter(any))
def test_disks_are_as_wide_as_their_radius_and_at_right_angles_to_the_axis(p, q, radius, direction):
    """Each coordinate of the rim against the root of its square, in rational numbers."""
    axis = [Fraction(b) - Fraction(a) for a, b in zip(p, q, strict=True)]
    assume(any(axis))
    way = [Fraction(x) for x in direction]
    length, along = sum(x * x for x in axis), sum(x * y for x, y in zip(axis, way, strict=True))
    across = [w - along / length * a for w, a in zip(way, axis, strict=True)]
    square = sum(x * x for x in across)
    found = cylinder(p, q, radius).support([direction])[0]
    end = q if along > 0 or (along == 0 and q < p) else p
    for got, centre, x in zip(found, end, across, strict=True):
        out = oracle.root(Fraction(radius) ** 2 * x * x / square) if square else 0
        error = Fraction(float(got)) - Fraction(centre) - (out if x > 0 else -out)
        assert abs(error) <= 2.0**-52 * (abs(centre) + float(out)) + 5e-324


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
        (lambda: Cloud([]), "points are empty"),
        (lambda: polygon([[0, 0], [1, np.nan]]), "points row 1 is"),
        (lambda: ball([0, 0], -1), "radius is -1"),
        (lambda: ball([0, 0], np.inf), "radius is inf"),
        (lambda: ball([0, np.inf], 1), "centre row 0"),
        (lambda: point(3), r"p must have shape \(d,\)"),
        (lambda: segment([0, 0], [0, 0, 0]), "same dimension"),
        (lambda: minkowski_sum(point([0, 0]), point([0, 0, 0])), "of one dimension"),
        (lambda: convex_combination(point([0, 0]), point([1, 1]), 1.5), "share is 1.5"),
        (lambda: rotated(point([0, 0]), [[1, 1], [0, 1]]), "not an orthogonal matrix"),
        (lambda: rotated(point([0, 0, 0]), 1.0), "rotation is an angle"),
        (lambda: rotated(point([0, 0]), np.nan), "rotation is nan"),
        (lambda: cylinder([0, 0, 0], [0, 0, 1], -1), "radius is -1"),
        (lambda: cylinder([1, 2, 3], [1, 2, 3], 1), r"axis starts and ends at \(1.0, 2.0, 3.0\)"),
        (lambda: cylinder([0, 0], [0, 1], 1), r"p must have shape \(3,\)"),
        (lambda: cone([0, 0, 0], [0, 0, 0], 1), "axis starts and ends"),
        (lambda: cone([0, 0, 0], [0, 0, np.nan], 1), "apex row 0"),
        (lambda: cone([0, 0, 0], [0, 0, 1], np.nan), "radius is nan"),
        (lambda: cone([0, 0, 0], [0, 0, 1], 1).support([[0, 0, 0]]), "directions row 0"),
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
