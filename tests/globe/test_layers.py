"""Layers, depth, influence and the hull of the nearest points on the globe, against their definitions."""

from fractions import Fraction
from math import floor

import numpy as np
import pytest
from cases import slow
from globes import GEO_HULLS, GEO_KEYED_HULLS, GEO_WINDOW_HULLS, around, random_center

from dynhull import GeoHull
from dynhull.globe import Gnomonic, distance
from dynhull.globe import area as area_of


@pytest.fixture(params=GEO_HULLS)
def kind(request):
    return request.param


def random_sets():
    """Caps of metres to 60 degrees, around poles and on the antimeridian, with copies and several names of a place."""
    rng = np.random.default_rng(5)
    for center in [(180.0, 0.0), (0.0, -90.0), (33.0, 90.0), random_center(rng)]:
        for radius, n in [(1e-4, 12), (5, 40), (60, 25)]:
            points = around(rng, center, radius, n)
            again = points[: n // 4].copy()
            again[:, 0] += np.where(again[:, 0] > 0, -360, 360)
            yield center, np.concatenate([points, points[:3], again, [center]])


def without(points, places, frame):
    """The points that are at none of these places."""
    projected, gone = (set(map(tuple, frame.project(each)[0].tolist())) for each in (points, places))
    assert gone <= projected
    return np.array([p for p, q in zip(points, frame.project(points)[0].tolist(), strict=True) if tuple(q) not in gone])


def test_layers_depth_and_influence_by_definition(kind):
    for center, points in random_sets():
        hull, frame = GEO_HULLS[kind](points, center), Gnomonic(center)
        rest, layers = points, []
        while len(rest):
            layers.append(GeoHull(rest, center).vertices())
            rest = without(rest, layers[-1], frame)
        for k in (0, 1, 3, 99):
            assert [each.tolist() for each in hull.layers(k)] == [each.tolist() for each in layers[:k]]
        asked = np.concatenate([points, around(np.random.default_rng(6), center, 80, 20), [(-center[0], -center[1])]])
        depths = sum(GeoHull(layer, center).contains(asked).astype(int) for layer in layers[:3])
        assert hull.depth(asked, 3).tolist() == depths.tolist()
        lost = [hull.area - GeoHull(without(points, vertex[None], frame), center).area for vertex in hull.vertices()]
        assert hull.influence() == pytest.approx(lost, rel=1e-9, abs=1)
        assert (hull.influence() > 0).all()


def test_the_hull_of_the_nearest_points(kind):
    for center, points in random_sets():
        hull = GEO_HULLS[kind](points, center)
        mean = Gnomonic.about(points)
        angles = [mean.angle(point) for point in points]
        for percent in (0, 50, 95, 100):
            limit = sorted(angles)[floor((len(points) - 1) * Fraction(percent, 100))]
            chosen = points[[angle <= limit for angle in angles]]
            assert hull.mcp(percent).tolist() == GeoHull(chosen, center).vertices().tolist()
    with pytest.raises(ValueError, match=r"percent is 101\.0: must be from 0 to 100"):
        hull.mcp(101)


@slow
def test_sketches_and_how_far_the_hull_reaches_beyond_them(kind):
    sets = [points for _, points in random_sets()][::4]  # around all centres, of all radii
    sets.append(around(np.random.default_rng(8), (12.0, 40.0), 80, 9))  # edges pass over others
    sets.append(np.array([(0.0, 80.0), (120.0, 80.0), (-120.0, 80.0), (50.0, 30.0), (230.0, 28.0)]))
    for points in sets:
        hull = GEO_HULLS[kind](points)
        vertices = hull.vertices()
        everywhere = np.concatenate([vertices, hull.boundary(hull.perimeter / 500)])
        for k in (1, 2, 3, 5, 8):
            few, error = hull.sketch(k)
            assert len(few) == min(k, len(vertices))
            assert [vertex for vertex in vertices.tolist() if vertex in few.tolist()] == few.tolist()
            beyond = everywhere[GeoHull(few, hull.center).locate(everywhere) < 0]
            farthest = max(distance(few, beyond).max(initial=0.0), 0.0)
            assert farthest <= error <= farthest * 1.02 + 1e-6 or (error == 0 and k >= len(vertices))
    with pytest.raises(ValueError, match="k is 0"):
        hull.sketch(0)


def test_few_points(kind):
    hull = GEO_HULLS[kind]()
    assert (hull.layers(3), hull.influence().tolist(), hull.depth([(0, 0)], 2).tolist()) == ([], [], [0])
    assert hull.mcp(95).shape == (0, 2)
    assert (hull.sketch(3)[0].shape, hull.sketch(3)[1]) == ((0, 2), 0.0)
    hull.insert_many([(180, 0), (-180, 0), (170, 0)])
    assert [each.tolist() for each in hull.layers(5)] == [[[-180, 0], [170, 0]]]
    assert hull.influence().tolist() == [0, 0]
    hull.insert(175, 5)
    assert hull.influence() == pytest.approx([hull.area] * 3)
    assert hull.area == area_of(hull.vertices())
    with pytest.raises(ValueError, match="k is -1"):
        hull.layers(-1)


def test_entities_and_windows_have_them_too(kind):
    center, points = next(random_sets())
    points = np.unique(points, axis=0)
    expected = GeoHull(points, center)
    keyed = GEO_KEYED_HULLS[kind]("int", center=center)
    keyed.put_many(range(len(points)), points)
    window = GEO_WINDOW_HULLS[kind](max_age=1e6, center=center)
    window.add(points, times=np.arange(float(len(points))))
    for hull in (keyed, window):
        assert [each.tolist() for each in hull.layers(2)] == [each.tolist() for each in expected.layers(2)]
        assert hull.influence().tolist() == expected.influence().tolist()
        assert hull.mcp(80).tolist() == expected.mcp(80).tolist()
        assert (hull.sketch(5)[0].tolist(), hull.sketch(5)[1]) == (
            expected.sketch(5)[0].tolist(),
            expected.sketch(5)[1],
        )
