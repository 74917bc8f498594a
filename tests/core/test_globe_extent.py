"""Bounds of hulls on the globe, and places inside them for labels."""

import numpy as np
import pytest

import dynhull
from dynhull import globe, measure


def around(center, angle, n):
    frame = globe.Gnomonic(center)
    spread = np.random.default_rng(n).uniform(-1, 1, (n, 2))  # whichever tests run: some hulls cannot be recentred
    return frame.unproject(spread * np.tan(np.radians(angle)))


REACHED = np.degrees(np.arctan(np.tan(np.radians(10)) / np.cos(np.radians(1))))  # of the edge between two places at 10
CENTERS = [(0, 0), (180, 10), (-179, -60), (20, 89), (77, -90), (123, 85), (-90, 45)]


@pytest.mark.parametrize("angle", [0.01, 3, 40])
@pytest.mark.parametrize("center", CENTERS)
def test_bounds_are_those_of_the_boundary(center, angle):
    hull = dynhull.GeoHull(around(center, angle, 30))
    west, south, east, north = hull.bounds
    way = hull.boundary(max(hull.perimeter / 20_000, 1))
    if (hull.locate([(0, 90), (0, -90)]) > 0).any():
        assert (west, east) == (-180, 180)
        assert 90 in (north, -south)
    else:
        around_center = (way[:, 0] - hull.center[0] + 180) % 360 - 180
        for bound, reached in (west, around_center.min()), (east, around_center.max()):
            assert abs((bound - reached - hull.center[0] + 180) % 360 - 180) < 1e-9
        assert south == pytest.approx(way[:, 1].min(), abs=1e-5)
    assert north == pytest.approx(max(way[:, 1].max(), north if north == 90 else -90), abs=1e-5)
    assert (way[:, 1] <= north + 1e-12).all()
    assert (way[:, 1] >= south - 1e-12).all()


@pytest.mark.parametrize(
    ("places", "expected"),
    [
        ([], (np.nan,) * 4),
        ([(180, 5)], (-180, 5, -180, 5)),
        ([(190, 5)], (-170, 5, -170, 5)),
        ([(170, 1), (180, 2)], (170, 1, 180, 2)),
        ([(170, 0), (-170, 0)], (170, 0, -170, 0)),
        ([(180, 0), (-175, 1), (-175, -1)], (-180, -1, -175, 1)),
        ([(0, 80), (90, 80), (180, 80), (-90, 80)], (-180, 80, 180, 90)),
        ([(10, 80), (100, 80), (0, 90)], (10, 80, 100, 90)),
        ([(-179, 10), (179, 10), (179, -10), (-179, -10)], (179, -REACHED, -179, REACHED)),
    ],
)
def test_odd_bounds(places, expected):
    found = dynhull.GeoHull(np.array(places, float).reshape(-1, 2)).bounds
    assert found == pytest.approx(expected, abs=1e-12, nan_ok=True)


@pytest.mark.parametrize("center", CENTERS)
def test_a_label_is_inside(center):
    for angle in 1e-9, 0.01, 60:
        hull = dynhull.GeoHull(around(center, angle, 7), center)
        hull.recenter()
        sides = hull.locate([hull.label_point()])
        assert sides[0] == 1 or (angle < 1e-6 and sides[0] == 0)
    sliver = dynhull.GeoHull([(10, 0), (20, 0), (15, 5e-16)])
    assert sliver.locate([sliver.label_point()])[0] >= 0
    assert np.isnan(dynhull.GeoHull().label_point()).all()


def test_a_label_in_the_plane():
    for scale in 5e-324, 1e-300, 1, 1e300:
        points = np.random.default_rng(9).normal(size=(9, 2)) * scale
        hull = dynhull.DynamicHull(points)
        assert hull.locate([hull.label_point()])[0] >= (1 if scale > 1e-320 else 0)
    assert dynhull.DynamicHull([(0, 0), (4, 0), (0, 3)]).label_point() == pytest.approx((4 / 3, 1))
    assert dynhull.DynamicHull([(0, 0), (1, 1)]).label_point() == (0, 0)
    assert np.isnan(measure.label_point(np.empty((0, 2)))).all()
