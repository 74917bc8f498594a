"""Intersection, distance and depth: against rational arithmetic in the plane, against python-fcl in space."""

from fractions import Fraction
from itertools import combinations, pairwise, product
from math import isqrt

import numpy as np
import oracle
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inputs import any_points, grid_points
from judges import fcl_body, fcl_distance
from oracle import root

from dynhull import DynamicHull
from dynhull.convex import (
    Cloud,
    ball,
    box,
    capsule,
    cone,
    cylinder,
    moved,
    point,
    polygon,
    rotated,
    scaled,
    segment,
    sum_of_polygons,
)
from dynhull.gjk import contact, distance_many, intersect, intersect_many
from dynhull.static import hull_nd


@given(any_points, any_points)
def test_whether_polygons_intersect_is_exact(rows, others):
    expected = oracle.polygons(rows, others) == 0
    assert intersect(polygon(rows), polygon(others)) == expected
    assert intersect(DynamicHull(rows), Cloud(others)) == expected
    assert contact(DynamicHull(rows), polygon(others)).intersect == expected
    assert intersect_many([rows], [others]).tolist() == [expected]


@given(grid_points, grid_points)
def test_distance_and_closest_points_of_polygons(rows, others):
    distance = float(root(oracle.polygons(rows, others)))
    found = contact(polygon(rows), DynamicHull(others))
    assert found.distance == pytest.approx(distance, rel=1e-13, abs=0)
    assert distance_many([rows], [others]) == pytest.approx(distance, rel=1e-13, abs=0)
    p, q = found.points
    if distance:
        np.testing.assert_allclose(q - p, found.normal * distance, atol=1e-13)
        assert np.abs(DynamicHull(rows).distance([p])).max() < 1e-13
        assert np.abs(DynamicHull(others).distance([q])).max() < 1e-13


def depth_by_definition(rows, others):
    """How far the origin is from the boundary of the difference, over its edges."""
    corners = sum_of_polygons(rows, [(-x, -y) for x, y in others])
    if len(corners) < 3:
        return 0.0
    ways = np.roll(corners, -1, axis=0) - corners
    return float(np.min((ways[:, 1] * corners[:, 0] - ways[:, 0] * corners[:, 1]) / np.hypot(*ways.T)))


@given(grid_points, grid_points)
def test_depth_of_polygons(rows, others):
    found = contact(polygon(rows), polygon(others))
    if found.intersect:
        assert found.depth == pytest.approx(depth_by_definition(rows, others), abs=1e-13)
        parted = contact(polygon(rows), moved(polygon(others), found.normal * (found.depth + 1e-9)))
        assert not parted.intersect
        assert parted.distance == pytest.approx(1e-9, rel=1e-3)


def test_touching_by_one_unit_in_the_last_place():
    """Boxes that share an edge, and the same boxes with the smallest gap there is."""
    left = box([0, 0], [1, 1])
    for gap in (0.0, 2.0**-52):
        for right in (box([1 + gap, 0], [2, 1]), box([1 + gap, 1], [2, 2]), polygon([[1 + gap, 0.5], [2, 0], [2, 1]])):
            assert intersect(left, right) == (gap == 0)
            assert contact(left, right).distance == gap
            assert contact(left, right).depth == 0


@pytest.mark.parametrize("gap", [0.0, 2.0**-52])
@pytest.mark.parametrize("way", [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 3.0)])
def test_segments_on_one_line(way, gap):
    """They have an end in common, or the smallest gap there is; no edge of one is beside the other."""
    start, end, again, last = ([t * way[0], t * way[1]] for t in (0, 1, 1 + gap, 2))
    for one, other in (([start, end], [again, last]), ([start, end], [again]), ([end], [again, last])):
        distance = 0.0 if gap == 0 else pytest.approx(gap * np.hypot(*way), rel=0.5)
        for a, b in ((one, other), (other, one)):
            assert intersect(polygon(a), polygon(b)) == (gap == 0)
            assert contact(polygon(a), polygon(b)).distance == distance


@pytest.mark.parametrize("d", [2, 3])
def test_rounded_shapes(d):
    x, y = np.eye(d)[:2]
    zero = np.zeros(d)
    assert contact(ball(zero, 1), ball(5 * x, 2)).distance == 2
    assert contact(ball(zero, 1), ball(2 * x, 1)).intersect
    assert contact(ball(zero, 2), ball(zero, 3)).depth == pytest.approx(5)
    assert contact(ball(zero, 2), ball(x, 2)).points == pytest.approx(np.array([2 * x, -x]))
    assert contact(capsule(-9 * x, 9 * x, 1), capsule(4 * y, 9 * y, 2)).distance == pytest.approx(1)
    assert contact(capsule(-9 * x, 9 * x, 1), capsule(-9 * y, 9 * y, 1)).depth == pytest.approx({2: 11, 3: 2}[d])
    assert contact(box(zero, zero + 2), ball(zero + 1, 1)).depth == pytest.approx(2)
    turned = rotated(scaled(moved(ball(zero, 1), 2 * x), 3), np.eye(d))
    assert contact(turned, point(zero)).distance == pytest.approx(3)


@pytest.mark.parametrize("d", [2, 3])
def test_curves_are_followed(d):
    """A disk or ball scaled unevenly: the distance along its axis is known."""
    x = np.eye(d)[0]
    ellipse = scaled(ball(np.zeros(d), 1), [3, *[1] * (d - 1)])
    assert contact(ellipse, point(5 * x)).distance == pytest.approx(2, abs=1e-6)
    assert contact(ellipse, point(0.5 * np.eye(d)[1])).depth == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_identical_sets(d):
    cube = box(np.zeros(d), np.ones(d))
    assert contact(cube, cube).depth == pytest.approx(1)
    assert contact(point(np.ones(d)), point(np.ones(d))).depth == 0
    assert contact(segment(np.zeros(d), np.ones(d)), segment(np.zeros(d), np.ones(d))).depth == 0


def test_flat_sets_in_space():
    square = Cloud([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    assert contact(square, moved(square, [1, 1, 0])).depth == 0
    assert contact(square, moved(square, [1, 1, 3])).distance == 3
    assert contact(square, segment([1, 1, -1], [1, 1, 2])).depth == pytest.approx(1)


@pytest.fixture(scope="module")
def bodies():
    random = np.random.default_rng(7)
    return [random.normal(size=(12, 3)) + 1.5 * random.normal(size=3) for _ in range(120)]


def test_cylinders_and_cones_against_their_sections():
    """A solid of revolution is as far from a point as its section in the plane through the point and the axis."""
    random = np.random.default_rng(4)
    for _ in range(40):
        base, top = random.normal(size=(2, 3))
        radius, p = random.uniform(0.1, 2), base + random.normal(size=3)
        height = np.linalg.norm(top - base)
        along = (p - base) @ (top - base) / height
        place = point([np.linalg.norm(p - base - along * (top - base) / height), along])
        for solid, section in (
            (cylinder(base, top, radius), [[-radius, 0], [radius, 0], [radius, height], [-radius, height]]),
            (cone(base, top, radius), [[-radius, 0], [radius, 0], [0, height]]),
        ):
            found, expected = contact(solid, point(p)), contact(polygon(section), place)
            assert found.intersect == expected.intersect
            assert found.distance == pytest.approx(expected.distance, abs=1e-6)
            assert found.depth == pytest.approx(expected.depth, abs=1e-6)


def test_agrees_with_fcl_in_space(bodies):
    judged = [fcl_body(points) for points in bodies]
    shapes = [Cloud(points) for points in bodies]
    iterations = []
    for i in range(0, 120, 2):
        found, expected = contact(shapes[i], shapes[i + 1]), fcl_distance(judged[i], judged[i + 1])
        assert found.intersect == (expected < 0)
        if not found.intersect:
            assert found.distance == pytest.approx(expected, rel=1e-6)
            iterations.append(found.iterations)
    assert 3 <= np.mean(iterations) <= 6


def test_few_iterations_in_the_plane():
    random = np.random.default_rng(1)
    pairs = [(random.normal(size=(8, 2)), random.normal(size=(8, 2)) + 3 * random.normal(size=2)) for _ in range(200)]
    found = [contact(polygon(p), polygon(q)) for p, q in pairs]
    assert 2.5 <= np.mean([c.iterations for c in found]) <= 5


def depth_in_space(p, q):
    """How far the origin is inside of the nearest face of the difference, negative outside; 0 where that is flat."""
    difference = hull_nd((np.asarray(p)[:, None] - q).reshape(-1, 3))
    if difference.dimension < 3:
        return 0.0
    return float((difference.normals * difference.vertices[difference.faces[:, 0]]).sum(axis=1).min())


def test_depth_in_space_by_definition(bodies):
    for p, q in pairwise(bodies[:30]):
        found, depth = contact(Cloud(p), Cloud(q)), depth_in_space(p, q)
        assert found.intersect == (depth >= 0)
        assert found.depth == pytest.approx(max(depth, 0), abs=1e-12)


def test_depth_of_bodies_with_faces_in_one_plane():
    random = np.random.default_rng(2)
    for _ in range(150):
        p, q = (random.integers(0, 4, (random.integers(1, 12), 3)).astype(float) for _ in range(2))
        found, depth = contact(Cloud(p), Cloud(q)), depth_in_space(p, q)
        if abs(depth) > 1e-12:
            assert found.intersect == (depth > 0)
        assert found.depth == pytest.approx(max(depth, 0), abs=1e-12)


def test_many_pairs_at_once_agree_with_one_by_one():
    random = np.random.default_rng(5)
    a = random.integers(-4, 4, (400, 5, 2)).astype(float)
    b = random.integers(-4, 4, (400, 4, 2)) + random.integers(-5, 5, (400, 1, 2)).astype(float)
    alone = [contact(polygon(p), polygon(q)) for p, q in zip(a, b, strict=True)]
    assert intersect_many(a, b).tolist() == [c.intersect for c in alone]
    np.testing.assert_allclose(distance_many(a, b), [c.distance for c in alone], rtol=1e-13, atol=0)
    assert intersect_many(a[:0], b[:0]).shape == distance_many(a[:0], b[:0]).shape == (0,)


def test_live_hulls_touch_exactly_without_reading_them():
    """Two dynamic hulls with a vertex in common, then one unit in the last place apart."""
    circle = np.array([(np.cos(t), np.sin(t)) for t in np.linspace(0, 6.28, 5000)])
    a, b = DynamicHull(circle), DynamicHull([[1, 0], [2, 1], [2, -1]])
    assert intersect(a, b)
    b.delete(1, 0)
    b.insert(np.nextafter(1, 2), 0)
    assert not intersect(a, b)
    assert contact(a, b).distance == 2.0**-52


def test_unions():
    corner = [box([0, 0], [3, 1]), box([0, 0], [1, 3])]
    assert not intersect(corner, box([2, 2], [3, 3]))
    assert contact(corner, [box([9, 0], [10, 1]), box([2, 2], [3, 3])]).distance == 1
    assert contact(corner, box([2, 0], [5, 1])).depth == 1


def test_extreme_coordinates():
    assert contact(point([0, 0]), point([3e-200, 4e-200])).distance == pytest.approx(5e-200)
    assert contact(point([-3e200, 0]), point([0, 4e200])).distance == pytest.approx(5e200)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: intersect([], point([0, 0])), "at least one piece"),
        (lambda: intersect(point([0, 0, 0]), point([0, 0])), "dimension 2 or 3, got 3 and 2"),
        (lambda: contact(Cloud([[0, 0, 0, 0]]), Cloud([[0, 0, 0, 0]])), "dimension 2 or 3, got 4 and 4"),
        (lambda: contact(DynamicHull(), point([0, 0])), "empty hull"),
        (lambda: intersect_many([[0, 0]], [[0, 0]]), r"a must have shape \(k, m, 2\)"),
        (lambda: intersect_many([[[0, 0]]], np.zeros((2, 1, 2))), "same length, got 1 and 2"),
        (lambda: distance_many([[[0, np.nan]]], [[[0, 0]]]), "a row 0"),
    ],
)
def test_bad_input(ask, message):
    with pytest.raises(ValueError, match=message):
        ask()


def test_a_sliver_beside_the_origin():
    """Ends so far away that the error of their weighted sums exceeds the distance."""
    sliver = [(1166548778139278.0, 0.0), (1.0, 0.0), (-1.4295695843808416e16, 256955.0)]
    distance = float(root(oracle.polygons([(0.0, 0.0)], sliver)))
    assert contact(point([0, 0]), polygon(sliver)).distance == pytest.approx(distance, rel=1e-9)
    assert distance_many([[[0, 0]]], [sliver]) == pytest.approx(distance, rel=1e-9)


def test_the_gap_between_far_away_sets_is_exact():
    """Coordinates of 2**53 and a gap of one: the decision and the distance survive."""
    far = 2.0**53
    found = contact(box([far - 2, 0], [far - 1, 1]), box([far, 0], [far + 2, 1]))
    assert (found.intersect, found.distance) == (False, 1.0)
    assert Fraction(found.distance) == 1


def exact_root(value):
    """The root of a rational number to 120 bits, whatever its size."""
    shift = max(0, 240 - value.numerator.bit_length() + value.denominator.bit_length()) // 2
    return Fraction(isqrt((value.numerator << 2 * shift) // value.denominator), 1 << shift)


def exact_depth(p, q):
    """From the supporting lines or planes through points of the difference: 0 where one has the origin outside."""
    scale = max(value.as_integer_ratio()[1] for point in p + q for value in point)
    a, b = ([[int(Fraction(value) * scale) for value in point] for point in points] for points in (p, q))
    corners = {tuple(s - t for s, t in zip(u, v, strict=True)) for u, v in product(a, b)}
    squares = []
    for first, *others in combinations(corners, len(p[0])):
        ways = [[s - t for s, t in zip(other, first, strict=True)] for other in others]
        if len(ways) == 1:
            normal = (ways[0][1], -ways[0][0])
        else:
            (ux, uy, uz), (vx, vy, vz) = ways
            normal = (uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)
        heights = [sum(n * (s - t) for n, s, t in zip(normal, corner, first, strict=True)) for corner in corners]
        if any(normal) and (min(heights) == 0 or max(heights) == 0):
            offset = sum(n * s for n, s in zip(normal, first, strict=True)) * (1 if max(heights) == 0 else -1)
            if min(heights) == max(heights) or offset < 0:
                return Fraction(0)
            squares.append(Fraction(offset**2, sum(n * n for n in normal)))
    return exact_root(min(squares)) / scale if squares else Fraction(0)


def extent(points):
    """Of the box around them, its longest side."""
    return max(max(map(Fraction, values)) - min(map(Fraction, values)) for values in zip(*points, strict=True))


def any_size(d):
    """Small sets of points of any size: plain, along an axis a trillion times longer, far away, tiny, huge."""
    whole = st.integers(-4, 4).map(float)
    near = st.tuples(whole, st.integers(-3, 3)).map(lambda pair: pair[0] + pair[1] * 1e-13)
    sizes = st.sampled_from([1.0, 6.5e11, 1e-9, 1e-160, 1e-300, 1e160, 1e295])
    stretches = st.tuples(*[st.sampled_from([1.0, 1.0, 1e12, 1e-12, 0.7])] * d)
    offsets = st.tuples(*[st.sampled_from([0.0, 0.0, 1.3, 1e8 / 3, -1e12])] * d)
    rows = st.sampled_from([whole, near]).flatmap(
        lambda value: st.lists(st.tuples(*[value] * d), min_size=1, max_size=4)
    )
    whole_rows = st.lists(st.tuples(*[whole] * d), min_size=4, max_size=4)  # many overlap in space, too

    def placed(points, size, stretch, offset):
        return [tuple((x * s + o) * size for x, s, o in zip(p, stretch, offset, strict=True)) for p in points]

    twice = st.one_of(st.tuples(rows, rows), st.tuples(whole_rows, whole_rows))
    pairs = st.tuples(twice, sizes, stretches, offsets)
    same = pairs.map(lambda pair: tuple(placed(points, *pair[1:]) for points in pair[0]))
    mixed = st.tuples(same, same).map(lambda two: (two[0][0], two[1][1]))
    return st.one_of(same, mixed)


@pytest.mark.parametrize("d", [2, 3])
def test_depth_and_distance_at_every_size(d):
    @given(any_size(d))
    def within_the_bound(pair):
        p, q = pair
        bound = extent(p + q) / 10**12 + Fraction(5e-324)
        found = contact(Cloud(p), Cloud(q))
        assert abs(Fraction(found.depth) - exact_depth(p, q)) <= bound
        if d == 2:
            squared = oracle.polygons(p, q)
            assert found.intersect == (squared == 0)
            for distance in (found.distance, *distance_many([p], [q]).tolist()):
                assert abs(Fraction(distance) - exact_root(squared)) <= bound

    within_the_bound()


def test_thin_sets_that_overlap_deeply():
    """A point that a segment of another size passes by closely: the walk in floats stands still beside it."""
    point = [(1597.3546340389446, 2328.7767867430694)]
    around = [
        (1597.3546340389546, 2328.736786743069),
        (1597.3546340389546, 2328.7767867430694),
        (1597.3546340389146, 2328.7767867430694),
        (1597.3546340389746, 2328.7967867430693),
    ]
    assert contact(Cloud(point), Cloud(around)).depth == pytest.approx(float(exact_depth(point, around)), rel=1e-9)
