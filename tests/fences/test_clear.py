"""Positions with an error: on their side by more than it, exactly, also where a distance is met to the last bit."""

from fractions import Fraction
from math import inf, nan, nextafter

import numpy as np
import pytest
from hulls import KEYED_HULLS

from dynhull import FenceIndex, KeyedHull, convex_hull
from dynhull._metres import Metres
from dynhull.globe import Gnomonic

kinds = pytest.mark.parametrize("make", [kind for kind in KEYED_HULLS if kind != "python, tiny leaves"], indirect=True)


@pytest.fixture
def make(request):
    return KEYED_HULLS[request.param]


def squared(p, a, b):
    """The squared distance of a point and a segment."""
    (px, py), (ax, ay), (bx, by) = (tuple(map(Fraction, each)) for each in (p, a, b))
    ux, uy = bx - ax, by - ay
    length = ux * ux + uy * uy
    share = 0 if not length else min(max(((px - ax) * ux + (py - ay) * uy) / length, 0), 1)
    return (px - ax - share * ux) ** 2 + (py - ay - share * uy) ** 2


def edges(ring):
    return zip(ring, [*ring[1:], ring[0]], strict=True)


def is_inside(p, polygon):
    """Whether a point that is on no ring is inside of a polygon with holes: by a ray that goes to the right."""
    (px, py), crossed = tuple(map(Fraction, p)), False
    for ring in polygon:
        for (ax, ay), (bx, by) in edges([tuple(map(Fraction, corner)) for corner in ring]):
            if (ay > py) != (by > py):
                crossed ^= ax + (py - ay) * (bx - ax) / (by - ay) > px
    return crossed


def is_clear(p, polygons, margin, error):
    """The judge: by whole polygons, in fractions."""
    if not error:
        return True
    nearest = [min(squared(p, a, b) for ring in polygon for a, b in edges(ring)) for polygon in polygons]
    inside = [near for near, polygon in zip(nearest, polygons, strict=True) if near and is_inside(p, polygon)]
    if inside:
        return max(inside) > Fraction(error) ** 2
    return all(near > (Fraction(margin) + Fraction(error)) ** 2 for near in nearest)


def near_errors(random, p, polygons, margin):
    """Errors about the distances from the rings: those that are met, and their neighbours."""
    found = []
    for polygon in polygons:
        square = min(squared(p, a, b) for ring in polygon for a, b in edges(ring))
        for length in (float(square) ** 0.5, max(float(square) ** 0.5 - margin, 0.0)):
            found += [length, nextafter(length, 0), nextafter(length, inf)]
    return [0.0, float(random.random()), *found]


@pytest.mark.every(3)
@kinds
@pytest.mark.parametrize("seed", range(3))
def test_polygons_by_fractions(make, seed):
    """Squares, stars with holes and overlapping ones, on a grid where distances are often met to the last bit."""
    random = np.random.default_rng(seed)
    scale = 2.0 ** float(random.integers(-30, 30))
    index = FenceIndex(make())
    looked = attained = 0
    for _ in range(12):
        center = random.integers(-4, 5, 2).astype(float)
        shapes = [np.array([[0, 0], [12, 0], [12, 9], [0, 9]]), np.array([[0, 0], [12, 5], [8, 12], [-5, 12]])]
        polygons = [[((shape + center) * scale).tolist()] for shape in shapes[: 1 + int(random.integers(2))]]
        if random.integers(2):
            polygons[0].append(((np.array([[2, 2], [5, 2], [5, 6]]) + center) * scale).tolist())
        margin = float(random.choice([0.0, 0.1, 1.5])) * scale
        index.set_polygons(1, polygons, margin=margin, closed=bool(random.integers(2)))
        for p in ((random.integers(-12, 40, (6, 2)) / 2) * scale).tolist():
            errors = near_errors(random, p, polygons, margin)
            expected = [is_clear(p, polygons, margin, error) for error in errors]
            assert index.clear(1, [p] * len(errors), errors).tolist() == expected
            looked += len(errors)
            attained += len(set(expected[2:5])) > 1
    assert looked > 500
    assert attained > 5


@kinds
def test_many_corners(make):
    """Areas whose edges lie in a tree, and many polygons."""
    random = np.random.default_rng(5)
    angles = np.arange(60) * 2 * np.pi / 60
    star = np.column_stack([np.cos(angles), np.sin(angles)]) * (3 + np.arange(60) % 2)[:, None]
    polygons = [[(star + 7 * k).tolist()] for k in range(17)]
    index = FenceIndex(make())
    index.set_polygons(1, polygons, margin=0.25)
    index.set_hull(2, convex_hull(star), margin=0.25)
    hull = [[convex_hull(star).tolist()]]
    for p in (random.random((2, 2)) * 20 - 5).tolist():
        errors = near_errors(random, p, polygons[:1], 0.25)[:4]
        assert index.clear(1, [p] * len(errors), errors).tolist() == [is_clear(p, polygons, 0.25, e) for e in errors]
        assert index.clear(2, [p] * len(errors), errors).tolist() == [is_clear(p, hull, 0.25, e) for e in errors]


@kinds
@pytest.mark.parametrize("margin", [0.0, 0.1])
def test_disks_by_fractions(make, margin):
    index = FenceIndex(make())
    index.set_circle(1, 0.5, 0, 7.5, margin=margin)
    random = np.random.default_rng(6)
    for x, y in [(0.5, 0), (3.5, 4), (8, 0), (9.5, 12), *(random.random((60, 2)) * 20 - 10).tolist()]:
        square = (Fraction(x) - Fraction(1, 2)) ** 2 + Fraction(y) ** 2
        length = float(square) ** 0.5
        guesses = [abs(7.5 - length), max(length - 7.5 - margin, 0.0), 7.5]
        errors = [each for guess in guesses for each in (guess, nextafter(guess, 0), nextafter(guess, inf))]
        inner, outer = [Fraction(7.5) - Fraction(e) for e in errors], [Fraction(7.5) + Fraction(e) for e in errors]
        expected = [
            not error or (low > 0 and square < low**2) or square > (high + Fraction(margin)) ** 2
            for error, low, high in zip(errors, inner, outer, strict=True)
        ]
        assert index.clear(1, [[x, y]] * len(errors), errors).tolist() == expected


@kinds
def test_points_segments_and_nothing(make):
    index = FenceIndex(make())
    index.set_hull(1, [[0, 0], [3, 4]])
    index.set_hull(2, [[1, 1]], margin=1)
    index.set_hull(3, [])
    places = [[1.5, 2], [-3, -4], [7, 1], [5, 4]]
    assert index.clear(1, places, [0.1, 5, 5, 1.9]).tolist() == [False, False, False, True]
    assert index.clear(1, places, [0, 4.9, 4.9, 0]).tolist() == [True] * 4
    assert index.clear(2, places, [0.5, 0, 4.9, 4]).tolist() == [False, True, True, False]
    assert index.clear(3, places, [1e300] * 4).tolist() == [True] * 4


@kinds
def test_the_greatest_and_least_numbers(make):
    index = FenceIndex(make())
    index.set_circle(1, 0, 0, 1e308, margin=1e308)
    assert index.clear(1, [[0, 0], [1e308, 1e308]], [1.7e308, 1.7e308]).tolist() == [False, False]
    index.set_polygons(2, [[[[0, 0], [5e-324, 0], [5e-324, 5e-324], [0, 5e-324]]]])
    assert index.clear(2, [[1e-323, 0], [1e-323, 0]], [5e-324, 1e-323]).tolist() == [False, False]
    assert index.clear(2, [[1.5e-323, 0]], [5e-324]).tolist() == [True]


@kinds
def test_each_subject_against_the_others(make):
    """Who is the only one at a vertex is compared with the hull without it, also before `take` has seen a change."""
    random = np.random.default_rng(7)
    hull = make()
    index = FenceIndex(hull)
    index.set_hull(1, [], margin=0.5, without_self=True)
    attained = 0
    for step in range(40):
        places = random.integers(0, 9, (int(random.integers(1, 12)), 2)).astype(float)
        keys = [f"k{number}" for number in range(len(places))]
        hull.remove_many(list(hull.keys()), missing="ignore")
        hull.put_many(keys, places)
        if step % 2:
            index.take()
        for p in np.unique(places, axis=0).tolist():
            alone = (places == p).all(axis=1).sum() == 1
            others = places[(places != p).any(axis=1)] if alone else places
            corners = convex_hull(others).tolist() if len(others) else []
            polygons = [[corners]] if corners else []
            errors = near_errors(random, p, polygons, 0.5)
            expected = [is_clear(p, polygons, 0.5, error) for error in errors]
            assert index.clear(1, [p] * len(errors), errors).tolist() == expected, (places, p)
            attained += len(set(expected[2:5])) > 1
            (distance,) = index.distances(1, [p]).tolist()
            around = [squared(p, a, b) for a, b in edges(corners)] if corners else []
            inside = len(corners) > 2 and (is_inside(p, [corners]) or not min(around))
            nearest = Fraction(0) if inside else min(around, default=inf)
            assert distance == pytest.approx(float(nearest) ** 0.5, rel=1e-15, abs=0)
    assert attained > 20


@kinds
def test_metres_on_the_globe(make):
    """Inside of one of the polygons, or outside of all with the margin, by more than an error in metres."""
    random = np.random.default_rng(8)
    frame = Gnomonic((13.4, 52.5))
    square = np.array([[0, 0], [0.6, 0], [0.6, 0.4], [0, 0.4]])
    rings = [square + np.array(corner) for corner in ((13.2, 52.3), (13.5, 52.5))]
    segment_ends = rings[0][::2]
    laid = [[frame.project_all(ring).tolist()] for ring in rings]
    metres, looked = Metres(frame), set()
    index = FenceIndex(make(), frame=frame)
    index.set_polygons(1, laid, margin=1000)
    index.set_hull(2, frame.project_all(np.array(sorted(map(tuple, segment_ends)))), margin=1000)
    index.set_hull(3, [])
    for place in frame.project_all(random.random((40, 2)) * [1.6, 1.2] + [12.9, 52]).tolist():
        far = [nearest_metres(metres, place, polygon) for polygon in laid]
        inside = [near for near, polygon in zip(far, laid, strict=True) if is_inside(place, polygon)]
        guesses = [each for near in far for each in (near, max(near - 1000, 0))]
        errors = [0.0, *guesses, *np.nextafter(guesses, 0).tolist(), *np.nextafter(guesses, inf).tolist()]
        expected = [not e or (max(inside) > e if inside else min(far) > 1000 + e) for e in errors]
        assert index.clear(1, [place] * len(errors), errors).tolist() == expected
        looked.update(zip([bool(inside)] * len(errors), expected, strict=True))
        segment = nearest_metres(metres, place, [frame.project_all(segment_ends).tolist()])
        errors = np.maximum([segment - 1000.001, segment - 999.999, segment], 0).tolist()
        assert index.clear(2, [place] * 3, errors).tolist() == [not e or segment > 1000 + e for e in errors]
        assert index.clear(3, [place], [250_000]).tolist() == [True]
    with pytest.raises(ValueError, match=r"row 1 is 249500\.0: at most 249000 metres with the margin"):
        index.clear(1, [[0, 0], [0, 0]], [1, 249_500])
    assert looked == {(True, True), (True, False), (False, True), (False, False)}


def nearest_metres(metres, place, polygon):
    ends = np.array([edge for ring in polygon for edge in edges(ring)])
    return float(metres.to_edges(np.broadcast_to(place, (len(ends), 2)), ends[:, 0], ends[:, 1]).min())


def test_what_is_refused():
    index = FenceIndex(KeyedHull())
    index.set_circle(1, 0, 0, 1)
    for errors, message in [
        ([1, -1], "row 1 is -1.0"),
        ([nan, 1], "row 0 is nan"),
        ([1, inf], "row 1 is inf"),
        ([1], r"shape \(1,\)"),
    ]:
        with pytest.raises(ValueError, match=message):
            index.clear(1, [[0, 0], [1, 1]], errors)
    with pytest.raises(KeyError):
        index.clear(3, [[0, 0]], [1])
