"""The hull on flat maps: RFC 7946, and edges made of short segments. The judge is shapely."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from globes import around, directions, random_center, random_set, ring_winds_left
from pyproj import Geod

from dynhull import GeoHull


def rings_of(geometry):
    parts = geometry["coordinates"]
    return [part[0] for part in (parts if geometry["type"] == "MultiPolygon" else [parts])]


def assert_rfc_7946(geometry):
    shape = shapely.geometry.shape(geometry)
    assert shape.is_valid
    for ring in rings_of(geometry):
        assert ring[0] == ring[-1]
        assert ring_winds_left(ring)
        assert all(-180 <= lon <= 180 and -90 <= lat <= 90 for lon, lat in ring)
        assert all(a != b for a, b in pairwise(ring))
    return shape


NORTH = [(0.0, 80.0), (120.0, 80.0), (-120.0, 80.0)]


@pytest.mark.parametrize(
    ("points", "geometry"),
    [
        ([], {"type": "Polygon", "coordinates": ()}),
        ([(190, 5)], {"type": "Point", "coordinates": (-170, 5)}),
        ([(180, 5)], {"type": "Point", "coordinates": (180, 5)}),
        ([(10, 0), (20, 5)], {"type": "LineString", "coordinates": ((10, 0), (20, 5))}),
        ([(180, 0), (180, 10)], {"type": "LineString", "coordinates": ((-180, 0), (-180, 10))}),
        (
            [(170, 0), (-170, 0)],
            {"type": "MultiLineString", "coordinates": (((-170, 0), (-180, 0)), ((180, 0), (170, 0)))},
        ),
        ([(10, 0), (20, 0), (15, 5)], {"type": "Polygon", "coordinates": (((10, 0), (20, 0), (15, 5), (10, 0)),)}),
        (
            [(190, 0), (200, 0), (195, 5)],
            {"type": "Polygon", "coordinates": (((-170, 0), (-160, 0), (-165, 5), (-170, 0)),)},
        ),
        (
            [(180, 0), (180, 9), (170, 5)],
            {"type": "Polygon", "coordinates": (((170, 5), (180, 0), (180, 9), (170, 5)),)},
        ),
        (
            [(180, 0), (180, 9), (-170, 5)],
            {"type": "Polygon", "coordinates": (((-170, 5), (-180, 9), (-180, 0), (-170, 5)),)},
        ),
        (  # a pole as a vertex is a line on the map, and so is one on an edge
            [(170, 80), (5, 90), (160, 80)],
            {"type": "Polygon", "coordinates": (((160, 80), (170, 80), (170, 90), (160, 90), (160, 80)),)},
        ),
        (
            [(0, 80), (180, 80), (90, 80)],
            {"type": "Polygon", "coordinates": (((0, 80), (90, 80), (180, 80), (180, 90), (0, 90), (0, 80)),)},
        ),
        (
            [(0, -80), (180, -80), (-90, -80)],
            {
                "type": "Polygon",
                "coordinates": (((-90, -80), (-180, -80), (-180, -90), (0, -90), (0, -80), (-90, -80)),),
            },
        ),
    ],
)
def test_small_hulls(points, geometry):
    hull = GeoHull(points, center=points[0] if points else None)
    assert hull.__geo_interface__ == geometry
    if geometry["type"].endswith("Polygon") and points:
        assert_rfc_7946(geometry)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_pole_inside(sign):
    hull = GeoHull([(lon, sign * lat) for lon, lat in NORTH])
    shape = assert_rfc_7946(hull.geojson())
    assert shape.geom_type == "Polygon"
    assert shape.covers(shapely.points([(-180, sign * 90), (180, sign * 90), (17, sign * 89), (60, sign * 85)])).all()
    assert not shape.covers(shapely.points([(60, sign * 70), (0, 0)])).any()


def test_the_cut_is_where_the_great_circles_cross():
    hull = GeoHull([(170, 40), (-170, 40), (180, 20)])
    shape = assert_rfc_7946(hull.geojson())
    assert shape.geom_type == "MultiPolygon"
    crossing = np.degrees(np.arctan(np.tan(np.radians(40)) / np.cos(np.radians(10))))
    for ring, lon in zip(rings_of(hull.geojson()), (180, -180), strict=True):
        assert max(lat for at, lat in ring if at == lon) == pytest.approx(crossing, abs=1e-12)


def test_random_hulls_are_valid_and_right():
    """The flat polygon has the hull's area, and holds the same places."""
    rng = np.random.default_rng(3)
    geod = Geod(ellps="WGS84")
    for _ in range(12):
        center, radius, points = random_set(rng, 50)
        if radius < 0.5:
            continue
        hull = GeoHull(points, center=center)
        assert_rfc_7946(hull.geojson())
        shape = assert_rfc_7946(hull.geojson(max_segment=20_000))
        boundary = hull.boundary(max_segment=20_000)
        area, _ = geod.polygon_area_perimeter(*boundary.T)
        parts = shapely.get_parts(shape)
        flat = sum(geod.polygon_area_perimeter(*part.exterior.coords.xy)[0] for part in parts)
        assert flat == pytest.approx(area, rel=1e-6)
        places = around(rng, center, min(radius * 1.3, 89), 200)
        # A chord of 20 km on the map is up to some 100 metres from the great circle, more beside a pole.
        places = places[(hull.distance(places) > 2000) | hull.contains(places)]
        places = places[np.abs(places[:, 1]) < 88]
        inside = hull.contains(places)
        margin = np.array([distance_to_ring(boundary, place) for place in places])
        clear = margin > 2000
        assert (shapely.covers(shape, shapely.points(places)) == inside)[clear].all()


def distance_to_ring(boundary, place):
    """Metres, roughly, to the nearest of its places, which are 20 km apart."""
    chords = np.linalg.norm(directions(boundary) - directions(np.array([place])), axis=1)
    return max(chords.min() * 6371e3 - 10_000, 0)


def test_segments_are_short_and_on_the_great_circle():
    rng = np.random.default_rng(4)
    geod = Geod(ellps="WGS84")
    for _ in range(20):
        center, _, points = random_set(rng, 30)
        hull = GeoHull(points, center=center)
        limit = hull.perimeter / rng.integers(3, 300)
        ring = hull.boundary(max_segment=limit)
        _, _, lengths = geod.inv(*ring.T, *np.roll(ring, -1, axis=0).T)
        assert lengths.max() <= limit * (1 + 1e-9)
        vertices = {tuple(row) for row in hull.vertices().tolist()}
        assert vertices <= {tuple(row) for row in ring.tolist()}
        assert np.array_equal(ring[0], hull.vertices()[0])
        assert hull.distance(ring).max() < 1e-6  # metres
    line = GeoHull([(0, 0), (10, 0)])
    assert line.boundary(max_segment=400_000).tolist() == pytest.approx(
        np.column_stack([[0, 10 / 3, 20 / 3, 10], [0] * 4])
    )


@pytest.mark.parametrize("segment", [0, -1, np.nan, 1e-3])
def test_bad_segments(segment):
    with pytest.raises(ValueError, match="max_segment is"):
        GeoHull([(0, 0), (40, 0), (0, 40)]).boundary(max_segment=segment)


def test_a_hull_is_read_by_shapely():
    rng = np.random.default_rng(5)
    hull = GeoHull(around(rng, random_center(rng), 0.5, 100))
    assert shapely.geometry.shape(hull).is_valid
