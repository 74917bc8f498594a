"""Boxes, the smallest circle, and measures of large hulls, against definitions in rational arithmetic."""

from fractions import Fraction
from itertools import combinations

import numpy as np
import oracle
import pytest
from hypothesis import given
from inputs import any_points, grid_points
from oracle import assert_rounded, exact, root

from dynhull import DynamicHull, convex_hull, measure


def boxes(rows):
    """Length and height of the box along each edge, times the edge's length, and that length squared."""
    corners = [exact(p) for p in oracle.hull(rows)]
    for (px, py), (qx, qy) in zip(corners, corners[1:] + corners[:1], strict=True):
        ux, uy = qx - px, qy - py
        along = [ux * x + uy * y for x, y in corners]
        across = [ux * (y - py) - uy * (x - px) for x, y in corners]
        yield max(along) - min(along), max(across), ux * ux + uy * uy


@given(grid_points)
def test_min_perimeter_box(rows):
    a, b, c, d = DynamicHull(rows).min_perimeter_box()
    sides = [float((length + height) ** 2 / squared) for length, height, squared in boxes(rows) if squared]
    assert (np.hypot(*(b - a)) + np.hypot(*(d - a))) ** 2 == pytest.approx(min(sides, default=0), abs=1e-9)
    np.testing.assert_allclose(b - a, c - d, atol=1e-12)


def test_least_area_and_least_perimeter_differ():
    hull = DynamicHull([[3, 3], [4, 8], [1, 4], [0, 3]])
    small, short = hull.min_box(), hull.min_perimeter_box()
    area, perimeter = (
        [f(*np.hypot(*(box[[1, 3]] - box[0]).T)) for box in (small, short)] for f in (np.multiply, np.add)
    )
    assert area[0] < area[1]
    assert perimeter[0] > perimeter[1]


def smallest_circle(rows):
    """By definition: the least of all circles through two or three of the points that hold every point."""
    points = [exact(p) for p in oracle.hull(rows)]
    if len(points) == 1:
        return points[0], Fraction(0)
    circles = [
        (((ax + bx) / 2, (ay + by) / 2), ((ax - bx) ** 2 + (ay - by) ** 2) / 4)
        for (ax, ay), (bx, by) in combinations(points, 2)
    ]
    for (ax, ay), (bx, by), (cx, cy) in combinations(points, 3):
        # The centre is as far from a as from b, and from c: two linear equations.
        e, f, g, h = bx - ax, by - ay, cx - ax, cy - ay
        r, s = (bx * bx + by * by - ax * ax - ay * ay) / 2, (cx * cx + cy * cy - ax * ax - ay * ay) / 2
        x, y = (r * h - f * s) / (e * h - f * g), (e * s - r * g) / (e * h - f * g)
        circles.append(((x, y), (x - ax) ** 2 + (y - ay) ** 2))
    holding = [c for c in circles if all((x - c[0][0]) ** 2 + (y - c[0][1]) ** 2 <= c[1] for x, y in points)]
    return min(holding, key=lambda circle: circle[1])


@given(any_points)
def test_min_circle(rows):
    centre, radius = DynamicHull(rows).min_circle()
    (x, y), squared = smallest_circle(rows)
    assert centre == (float(x), float(y))
    assert_rounded(radius, root(squared))


def test_no_points():
    hull = DynamicHull()
    assert np.isnan(hull.min_perimeter_box()).all()
    centre, radius = hull.min_circle()
    assert np.isnan(centre).all()
    assert radius == 0


@given(any_points)
def test_area_and_centroid(rows):
    corners = [exact(p) for p in oracle.hull(rows)]
    crosses = [p[0] * q[1] - p[1] * q[0] for p, q in zip(corners, corners[1:] + corners[:1], strict=True)]
    hull = DynamicHull(rows)
    try:
        assert hull.area == float(sum(crosses) / 2)
    except OverflowError:
        assert hull.area == np.inf
    if sum(crosses):
        for axis in (0, 1):
            sums = [p[axis] + q[axis] for p, q in zip(corners, corners[1:] + corners[:1], strict=True)]
            moment = sum(c * s for c, s in zip(crosses, sums, strict=True))
            assert hull.centroid[axis] == float(moment / (3 * sum(crosses)))


def test_measures_of_a_large_hull():
    """Many vertices, symmetric up to rounding: floats cannot choose among the diameters and the boxes."""
    angle = np.arange(20_000) * (2 * np.pi / 20_000)
    vertices = convex_hull(np.column_stack([np.cos(angle), np.sin(angle)]))
    opposite = np.roll(vertices, -len(vertices) // 2, axis=0)
    squares = [
        sum((Fraction(s) - Fraction(t)) ** 2 for s, t in zip(p, q, strict=True))
        for p, q in zip(vertices.tolist(), opposite.tolist(), strict=True)
    ]
    assert measure.diameter(vertices) ** 2 == pytest.approx(float(max(squares)), rel=1e-15)
    assert measure.width(vertices) == pytest.approx(2, rel=1e-7)
    assert measure.min_circle(vertices)[1] == pytest.approx(1, rel=1e-15)
    assert measure.area(vertices) == pytest.approx(np.pi, rel=1e-7)
    assert measure.min_box(vertices) == pytest.approx(measure.min_perimeter_box(vertices), abs=2.1)


@pytest.mark.parametrize("name", ["area", "perimeter", "centroid", "bounds"])
def test_measures_follow_every_change(name):
    hull = DynamicHull([[0, 0], [4, 0], [0, 3]])
    before = getattr(hull, name)
    hull.insert(4, 9)
    assert getattr(hull, name) == getattr(DynamicHull(hull.points()), name) != before
    hull.delete(4, 9)
    assert getattr(hull, name) == before
    hull.clear()
    assert str(getattr(hull, name)) == str(getattr(DynamicHull(), name))


def test_a_measure_that_is_written_to_stays():
    hull = DynamicHull([[0, 0], [4, 0], [4, 3]])
    box = hull.min_box()
    kept = box.copy()
    box[:] = 7
    np.testing.assert_array_equal(hull.min_box(), kept)
