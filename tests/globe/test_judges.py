"""Hulls on the globe against others: S2 on the sphere, fifty digits, pyproj on the ellipsoid, airports."""

import numpy as np
import pytest
from globes import agrees_with_s2, around, random_center, random_set, triple
from pyproj import Geod

from dynhull import DynamicHull, GeoHull

WGS84 = Geod(ellps="WGS84")
# Below this, the determinant of three directions may have another sign in the projection: places are rounded to 2 nm.
DOUBTFUL = 1e-14

AIRPORTS = {
    "NAN": (177.443, -17.7554), "SUV": (178.559, -18.0433), "TVU": (-179.877, -16.6906), "LBS": (179.34, -16.4667),
    "AKL": (174.792, -37.0081), "HNL": (-157.922, 21.3187), "PPT": (-149.607, -17.5537), "ANC": (-149.996, 61.1744),
    "NRT": (140.386, 35.7647), "LYR": (15.4656, 78.2461), "YLT": (-62.2806, 82.5178),
}  # fmt: skip


def test_vertices_and_contains_against_s2():
    """benchmarks/globe.py does the same with 10,000 sets."""
    rng = np.random.default_rng(1)
    for _ in range(150):
        center, radius, points = random_set(rng, 1000)
        hull = GeoHull(points, center=center)
        assert agrees_with_s2(hull, around(rng, center, min(1.2 * radius, 89), 30), center)


def test_every_turn_is_to_the_left_and_every_place_on_the_right_side():
    rng = np.random.default_rng(2)
    for _ in range(25):
        center, radius, points = random_set(rng, 40)
        hull = GeoHull(points, center=center)
        vertices = hull.vertices()
        edges = list(zip(vertices.tolist(), np.roll(vertices, -1, axis=0).tolist(), strict=True))
        for place in points[:10].tolist():
            assert all(triple(a, b, place) > -DOUBTFUL for a, b in edges)
        places = around(rng, center, min(1.2 * radius, 84), 8)
        for place, sign in zip(places.tolist(), hull.locate(places).tolist(), strict=True):
            least = min(triple(a, b, place) for a, b in edges)
            if abs(least) > DOUBTFUL:
                assert sign == (1 if least > 0 else -1)


def test_small_sets_are_as_on_a_plane():
    """Within a kilometre, seen from the middle, a degree is a degree up to a factor in each direction."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        center = float(rng.uniform(-180, 180)), float(rng.uniform(-60, 60))
        points = around(rng, center, 1e-5, 50)
        flat = (points - center) % 360
        flat = np.where(flat > 180, flat - 360, flat)
        plane, globe = DynamicHull(flat), GeoHull(points)
        assert len(plane.vertices()) == len(globe.vertices())
        area = plane.area * np.cos(np.radians(center[1])) * 111_000**2
        assert globe.area == pytest.approx(area, rel=0.02)


def test_area_and_perimeter_against_pyproj():
    rng = np.random.default_rng(4)
    for _ in range(100):
        center, _, points = random_set(rng, 300)
        hull = GeoHull(points, center=center)
        area, perimeter = WGS84.polygon_area_perimeter(*hull.vertices().T)
        assert area > 0
        assert (hull.area, hull.perimeter) == pytest.approx((area, perimeter), rel=1e-9)
    line = GeoHull([(0, 0), (10, 10)])
    assert (line.area, line.perimeter) == (0, pytest.approx(2 * WGS84.inv(0, 0, 10, 10)[2]))
    assert (GeoHull([(3, 4)]).area, GeoHull([(3, 4)]).perimeter, GeoHull([(3, 4)]).diameter()) == (0, 0, 0)
    assert (GeoHull().area, GeoHull().perimeter, GeoHull().diameter()) == (0, 0, 0)


def test_measures_follow_the_hull():
    hull = GeoHull([(0, 0), (1, 0), (0, 1)])
    area = hull.area
    hull.insert(1, 1)
    assert hull.area == pytest.approx(2 * area, rel=1e-3)
    hull.clear()
    assert hull.area == 0


def test_diameter_against_every_pair():
    rng = np.random.default_rng(5)
    for _ in range(30):
        center, _, points = random_set(rng, 200)
        hull = GeoHull(points, center=center)
        vertices = hull.vertices()
        a, b = np.triu_indices(len(vertices), 1)
        _, _, lengths = WGS84.inv(*vertices[a].T, *vertices[b].T)
        assert hull.diameter() == lengths.max()


def test_distance_against_many_places_of_the_boundary():
    """The distance to each of some thousand places is at least that to the hull, and for the nearest hardly more."""
    rng = np.random.default_rng(6)
    for _ in range(20):
        center, radius, points = random_set(rng, 30)
        hull = GeoHull(points, center=center)
        step = hull.perimeter / 4000
        ring = hull.boundary(max_segment=step)
        places = np.concatenate([around(rng, center, min(1.5 * radius, 89), 6), around(rng, random_center(rng), 90, 3)])
        for place, found in zip(places, hull.distance(places), strict=True):
            if hull.contains([place])[0]:
                assert found == 0
                continue
            lon, lat = np.broadcast_to(place[:, None], (2, len(ring)))
            _, _, lengths = WGS84.inv(lon, lat, *ring.T)
            nearest = lengths.min()
            # Half a step beside the foot of a perpendicular.
            assert found <= nearest + 1e-6
            assert nearest <= np.hypot(found, step / 2) * (1 + 1e-9) + 1e-6


def test_distance_of_a_place_beside_an_edge_is_exact_to_a_micrometre():
    """From a point of an edge, metres away at a right angle on the ellipsoid, and back."""
    rng = np.random.default_rng(7)
    hull = GeoHull([(170, -40), (-170, -42), (175, 10)])
    ring = hull.boundary(max_segment=1000.0)
    for i in rng.integers(1, len(ring) - 1, 50):
        before, here, after = ring[i - 1 : i + 2]
        if any(np.array_equal(each, vertex) for each in (before, here, after) for vertex in hull.vertices()):
            continue
        forward, _, _ = WGS84.inv(*before, *after)
        middle = WGS84.inv(*here, *after)[0]
        away = 10 ** rng.uniform(-2, 5)
        outside = WGS84.fwd(*here, middle + 90, away)[:2]
        assert abs((forward - middle + 180) % 360 - 180) < 0.1
        # The azimuth of the edge, from a chord of a kilometre, is wrong by some 1e-7: of second order in the distance.
        assert hull.distance([outside])[0] == pytest.approx(away, rel=1e-8, abs=1e-6)


def test_distances_of_an_empty_hull_of_one_place_and_of_a_segment():
    assert GeoHull(center=(0, 0)).distance([(0, 0), (170, 0)]).tolist() == [np.inf] * 2
    assert GeoHull([(0, 0)]).distance([(1, 0), (0, 0)]).tolist() == [WGS84.inv(1, 0, 0, 0)[2], 0]
    assert GeoHull([(-10, 0), (10, 0)]).distance([(0, 1), (12, 0)]).tolist() == pytest.approx(
        [WGS84.inv(0, 1, 0, 0)[2], WGS84.inv(12, 0, 10, 0)[2]], abs=1e-6
    )


def test_airports_around_the_pacific():
    places = list(AIRPORTS.values())
    with pytest.raises(
        ValueError, match=r"row 9 is .* 88\.011561 degrees from the centre .* \(`center` gives another\)"
    ):
        GeoHull(places)
    hull = GeoHull(places, center=(-175, 35))
    names = {place: name for name, place in AIRPORTS.items()}
    found = [names[tuple(place)] for place in hull.vertices().tolist()]
    assert agrees_with_s2(hull, np.array([(180, 90), (180, 0), (0, 0)]), hull.center)
    assert found == ["PPT", "YLT", "LYR", "NRT", "AKL"]
    assert hull.contains([(0, 90), (180, 0), (0, 0)]).tolist() == [True, True, False]
    assert WGS84.inv(*AIRPORTS["AKL"], *AIRPORTS["LYR"])[2] == hull.diameter()
