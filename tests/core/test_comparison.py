"""Whether a measure is greater or less than a bound, as exact rationals decide."""

from fractions import Fraction
from math import inf, isfinite, nextafter, sqrt

import numpy as np
import pytest

import dynhull
from dynhull.measure import LastVertices, _comparison, compare
from dynhull.measure._area import doubled_area
from dynhull.measure._extent import squared_diameter, squared_width

SHAPES = ["square", "grid", "thin", "far"]
# From 2^-300, where products underflow, to 2^300, where squares of them overflow.
SCALES = [0, -230, 230, -300, 300]


def shaped(shape: str, random: np.random.Generator) -> np.ndarray:
    points = random.random((int(random.integers(3, 90)), 2))
    if shape == "grid":
        return np.round(points * 4)
    if shape == "thin":
        points[:, 1] = points[:, 0] * 0.3 + random.random(len(points)) * 2.0 ** -float(random.integers(1, 60))
    if shape == "far":
        return points * 2.0 ** -float(random.integers(0, 50)) + 1000
    return points


def squared(vertices: np.ndarray, measure: str) -> Fraction:
    """The square of a measure; the area itself."""
    if measure == "area":
        return doubled_area(vertices) / 2
    return squared_diameter(vertices) if measure == "diameter" else squared_width(vertices)


@pytest.mark.every(3)
@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("shape", SHAPES)
def test_it_is_exact_also_beside_the_bound_and_at_any_scale(shape: str, scale: int) -> None:
    random = np.random.default_rng(SHAPES.index(shape))
    for _ in range(20):
        vertices = dynhull.convex_hull(shaped(shape, random) * 2.0**scale)
        for measure in ("area", "diameter", "width"):
            exact = squared(vertices, measure)
            value = float(exact) if measure == "area" else sqrt(exact)
            beside = [value, nextafter(value, 0), nextafter(value, inf), value * (1 + 1e-15), value * (1 - 1e-13)]
            for bound in (*beside, 2 * value, value / 2, 0.0, 5e-324, 1e308):
                if isfinite(bound):
                    limit = Fraction(bound) if measure == "area" else Fraction(bound) ** 2
                    assert compare(vertices, measure, bound) == (exact > limit) - (exact < limit), (measure, bound)


@pytest.mark.skipif(dynhull.KERNEL == "python", reason="the reference has no filter but that of the area")
def test_a_bound_that_is_not_near_needs_no_fractions(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def exactly(*_: object) -> tuple[int, Fraction, Fraction]:
        asked.append("extent")
        return 25, Fraction(9), Fraction(1)

    monkeypatch.setattr(_comparison, "extent_of_few", exactly)
    monkeypatch.setattr(_comparison, "_compare_area", lambda *_: asked.append("area"))
    rectangle = np.array([[0, 0], [4, 0], [4, 3], [0, 3]], float)
    for measure, value in (("area", 12), ("diameter", 5), ("width", 3)):
        assert compare(rectangle, measure, value * (1 + 1e-9)) == -1
        assert compare(rectangle, measure, value * (1 - 1e-9)) == 1
    assert asked == []
    assert compare(rectangle, "width", 3.0) == 0
    assert asked == ["extent"]


@pytest.mark.parametrize("keyed", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_vertices_are_taken_where_the_sign_is_one_of_those_that_are_named(shape: str, *, keyed: bool) -> None:
    random = np.random.default_rng(SHAPES.index(shape))
    hull = dynhull.KeyedHull("int") if keyed else dynhull.DynamicHull()
    last, nothing, doubts = LastVertices(), dynhull.DynamicHull(), 0
    assert (len(last), last.points().shape) == (0, (0, 2))
    for _ in range(40):
        points = shaped(shape, random)
        hull.clear()
        if isinstance(hull, dynhull.KeyedHull):
            hull.update(np.arange(len(points), dtype=np.uint64), points)
        else:
            hull.insert_many(points)
        vertices = hull.vertices()
        for measure in ("area", "diameter", "width"):
            exact = squared(vertices, measure)
            value = float(exact) if measure == "area" else sqrt(exact)
            for bound in (value, nextafter(value, inf), value * (1 + 1e-13), 2 * value, value / 2, 0.0):
                sign = compare(vertices, measure, bound)
                for least, most in ((-1, -1), (-1, 0), (0, 1), (1, 1)):
                    last.take(nothing)
                    taken, named = last.taker(hull, measure, bound, least, most)(), least <= sign <= most
                    assert named or not taken, (measure, bound)
                    assert np.array_equal(last.points(), vertices if taken else nothing.vertices())
                    doubts += named and not taken
        last.take(hull)
        assert np.array_equal(last.points(), vertices)
        assert len(last) == len(vertices)
    assert doubts == 0 or dynhull.KERNEL == "cpp"


@pytest.mark.parametrize("bound", [0.0, 5e-324, 1.0, 1e308])
def test_points_and_segments_have_neither_area_nor_width(monkeypatch: pytest.MonkeyPatch, bound: float) -> None:
    asked = []
    if dynhull.KERNEL == "cpp":  # which decides it without fractions
        monkeypatch.setattr(_comparison, "_sign", lambda *_: asked.append("exactly"))
    for number in range(3):
        vertices = np.array([[0.5, 0.25], [3.5, 4.25]])[:number]
        for measure in ("area", "width", "diameter") if number < 2 else ("area", "width"):
            assert compare(vertices, measure, bound) == (-1 if bound else 0), (number, measure)
    assert asked == []
    segment = np.array([[0.5, 0.25], [3.5, 4.25]])
    assert [compare(segment, "diameter", each) for each in (4.9, 5.1)] == [1, -1]
    assert asked == []
