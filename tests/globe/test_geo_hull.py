"""GeoHull as a user has it: what goes in, what comes out, and what is refused."""

import copy
import pickle
import sys

import numpy as np
import oracle
import pytest
from globes import GEO_HULLS, around, random_center
from hypothesis import given
from hypothesis import strategies as st

from dynhull import GeoHull, MissingPointError
from dynhull._globe import Gnomonic

FIJI = [(177.4, -17.8), (178.4, -18.1), (-179.9, -16.8), (179.4, -16.4), (179.0, -17.2)]


@pytest.fixture(params=GEO_HULLS)
def make(request):
    return GEO_HULLS[request.param]


def expected_vertices(hull):
    """By rational arithmetic on the projections of the hull's points."""
    points = [tuple(row) for row in hull.points().tolist()]
    if not points:
        return []
    places, _ = Gnomonic(hull.center).project(np.array(points))
    names = {}
    for point, place in zip(points, map(tuple, places.tolist()), strict=True):
        names[place] = min(names.get(place, point), point)
    ring = [names[place] for place in oracle.hull(names)]
    start = ring.index(min(ring))
    return ring[start:] + ring[:start]


def assert_right(hull):
    hull.check()
    assert [tuple(row) for row in hull.vertices().tolist()] == expected_vertices(hull)


def test_a_hull_across_the_antimeridian(make):
    hull = make(FIJI)
    assert hull.vertices().tolist() == [[-179.9, -16.8], [179.4, -16.4], [177.4, -17.8], [178.4, -18.1]]
    assert hull.locate([(180, -16.8), (-180, -16.8), (180, -17), (177.4, -17.8)]).tolist() == [1, 1, -1, 0]
    assert 178 < hull.center[0] < 180
    assert 2.1e10 < hull.area < 2.2e10  # square metres


@pytest.mark.parametrize("pole", [90, -90])
def test_a_hull_around_a_pole(make, pole):
    hull = make([(lon, pole * 0.8) for lon in range(-180, 180, 30)])
    assert len(hull.vertices()) == 12
    assert abs(hull.center[1] - pole) < 1e-9
    assert hull.locate([(17, pole), (0, 0), (0, -pole), (15, pole * 0.79)]).tolist() == [1, -1, -1, -1]
    hull.insert_many([(5, pole), (-170, pole)])
    assert (hull.count(5, pole), hull.count(-170, pole), hull.count(6, pole)) == (1, 1, 0)
    assert_right(hull)


def test_an_edge_is_a_great_circle(make):
    hull = make([(-60, 40), (60, 40), (0, 20)])
    bulge = np.degrees(np.arctan(np.tan(np.radians(40)) / np.cos(np.radians(60))))  # north of the parallel
    assert hull.locate([(0, 41), (0, bulge - 1e-9), (0, bulge + 1e-9)]).tolist() == [1, 1, -1]


def test_pairs_at_one_place_are_points_of_their_own(make):
    hull = make(center=(175, 0))
    hull.insert_many([(180, 0), (180, 0), (-180, 0), (170, 5), (170, -5)])
    assert (len(hull), hull.distinct) == (5, 4)
    assert hull.points().tolist() == [[-180, 0], [170, -5], [170, 5], [180, 0], [180, 0]]
    assert hull.vertices().tolist() == [[-180, 0], [170, 5], [170, -5]]
    assert hull.count_many([(180, 0), (-180, 0), (540 - 360, 0)]).tolist() == [2, 1, 2]
    before = hull.changes
    assert hull.delete(-180, 0)  # the vertex is called by another name now
    assert hull.changes == before + 1
    assert hull.vertices().tolist() == [[170, -5], [180, 0], [170, 5]]
    assert not hull.delete(180, 0)
    with pytest.raises(MissingPointError, match=r"point \(-180\.0, 0\.0\) is missing"):
        hull.delete(-180, 0)
    assert hull.insert(-180, 0)
    assert (180, 0) in hull
    assert (-180, 0) in hull
    assert_right(hull)


def test_points_come_back_as_they_were_given(make):
    rng = np.random.default_rng(1)
    for _ in range(20):
        given_points = around(rng, random_center(rng), rng.uniform(0.001, 80), 50)
        given_points[:10, 0] += np.where(given_points[:10, 0] < 0, 360, -360)  # another way to write the same
        hull = make(given_points)
        assert sorted(hull.points().tolist()) == sorted(given_points.tolist())
        assert {tuple(row) for row in hull.vertices().tolist()} <= {tuple(row) for row in given_points.tolist()}
        assert_right(hull)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (
            [(0, 0), (12, 95)],
            r"points row 1 is \(12\.0, 95\.0\): a latitude must be from -90 to 90 degrees; longitude ",
        ),
        ([(0, 0), (120, 95)], r"points row 1 is \(120\.0, 95\.0\): a latitude must be from -90 to 90 degrees$"),
        ([(0, 0), (1, 2), (-360.5, 2)], r"points row 2 is \(-360\.5, 2\.0\): a longitude must be from -360 to 360"),
        ([(0, 0), (0, np.nan)], r"points row 1 is \(0\.0, nan\): coordinates must be finite"),
        ([(0, 0), (0, 85.1)], r"points row 1 is \(0\.0, 85\.1\): 85\.100000 degrees from the centre \(0\.0, 0\.0\); "),
        (
            [(0, 0), (180, 0)],
            r"points row 1 is \(180\.0, 0\.0\): 180\.000000 degrees from .*; a hull reaches 85 degrees",
        ),
        ([0, 1], r"points must have shape \(n, 2\)"),
    ],
)
def test_bad_points_change_nothing(make, points, message):
    hull = make([(0, 0), (1, 1)], center=(0, 0))
    before = hull.copy()
    with pytest.raises(ValueError, match=message):
        hull.insert_many(points)
    with pytest.raises(ValueError, match=message):
        hull.apply([1] * len(points), points)
    assert hull == before
    assert hull.changes == before.changes


@pytest.mark.parametrize(
    ("lon", "lat", "error", "message"),
    [
        (0, 91, ValueError, r"the point is \(0\.0, 91\.0\): a latitude must be"),
        (361, 0, ValueError, r"the point is \(361\.0, 0\.0\): a longitude must be"),
        ("0", 0, TypeError, "lon: coordinates must be real numbers"),
        (0, np.inf, ValueError, "lat is inf"),
        (0, 86, ValueError, r"the point is \(0\.0, 86\.0\): 86\.000000 degrees from the centre"),
    ],
)
def test_a_bad_point_changes_nothing(make, lon, lat, error, message):
    hull = make([(0, 0), (1, 1)], center=(0, 0))
    before = hull.copy()
    with pytest.raises(error, match=message):
        hull.insert(lon, lat)
    assert hull == before


@pytest.mark.parametrize(
    ("center", "message"),
    [
        ((0, 91), r"center is \(0\.0, 91\.0\): a latitude must be from -90 to 90"),
        ((400, 0), r"center is \(400\.0, 0\.0\): a longitude must be"),
        ((0, np.nan), "latitude of center is nan"),
        (5, r"center must be \(longitude, latitude\), got 5"),
        ((1, 2, 3), r"center must be \(longitude, latitude\)"),
    ],
)
def test_bad_centres(make, center, message):
    with pytest.raises(ValueError, match=message):
        make(center=center)
    hull = make(FIJI)
    before = hull.copy()
    with pytest.raises(ValueError, match=message):
        hull.recenter(center)
    assert hull == before


def test_85_degrees_are_reached_in_every_direction(make):
    hull = make(center=(0, 0))
    hull.insert_many([(85, 0), (-85, 0), (0, 85), (0, -85)])
    assert len(hull.vertices()) == 4
    hull = make(center=(30, 90))
    hull.insert_many([(lon, 5) for lon in range(-180, 180, 7)])
    assert_right(hull)
    with pytest.raises(ValueError, match=r"85\.000001 degrees"):
        hull.insert(3, 5 - 1e-6)
    assert hull.locate([(3, 4), (3, -90)]).tolist() == [-1, -1]
    assert hull.distance([(7 * 3 - 180, -5)])[0] == pytest.approx(1.1057e6, rel=1e-4)  # ten degrees to the south
    with pytest.raises(ValueError, match=r"points row 1 is \(3\.0, 4\.0\): 86"):
        hull.tangents([(3, 6), (3, 4)])


def test_the_first_points_choose_the_centre(make):
    hull = make()
    assert hull.center is None
    assert hull.locate([(0, 0)]).tolist() == [-1]
    assert hull.delete_many([(1, 2)], missing="ignore") == 0
    with pytest.raises(MissingPointError, match=r"row 0: point \(1\.0, 2\.0\)"):
        hull.delete_many([(1, 2)])
    assert hull.center is None
    with pytest.raises(ValueError, match="the mean direction of the first points"):
        hull.insert_many([(0, 0), (90, 0), (180, 0)])
    assert hull.center is None
    hull.insert_many([(179, 10), (-179, 10)])
    assert hull.center == pytest.approx((-180, 10), abs=0.01)
    center = hull.center
    hull.insert_many([(150, 10)])
    hull.clear()
    assert hull.center == center
    assert (len(hull), hull.distinct, hull.vertices().shape) == (0, 0, (0, 2))
    assert make(center=(350, 10)).center == (-10, 10)


def test_recenter(make):
    hull = make([(0, 0), (10, 0), (5, 5)], center=(80, 0))
    before = hull.changes
    hull.recenter()
    assert hull.center == pytest.approx((5, 5 / 3), abs=0.01)
    assert hull.changes == before
    assert_right(hull)
    with pytest.raises(ValueError, match=r"points row 0 is \(0\.0, 0\.0\): 90\.000000 degrees from the centre"):
        hull.recenter((90, 0))
    assert hull.center == pytest.approx((5, 5 / 3), abs=0.01)
    hull.recenter((-70, 3))
    assert hull.center == (-70, 3)
    hull.clear()
    with pytest.raises(ValueError, match="center is None, and there are no points"):
        hull.recenter()


def test_recentering_may_decide_otherwise_by_nanometres(make):
    """On the equator, points are collinear for a centre on it."""
    hull = make([(0, 0), (10, 0), (25, 0)], center=(10, 0))
    assert len(hull.vertices()) == 2
    hull.insert(12, 1)
    before = hull.changes
    vertices = hull.vertices()
    hull.recenter((11, 40))
    assert hull.changes == before + (not np.array_equal(hull.vertices(), vertices))
    assert_right(hull)


def test_deletes_and_batches(make):
    hull = make(FIJI)
    assert hull.apply([-1, 1, 1, -1], [FIJI[0], (176, -17), (176, -17), FIJI[4]]) == 4
    assert hull.count(176, -17) == 2
    assert FIJI[0] not in hull
    with pytest.raises(MissingPointError) as caught:
        hull.delete_many([(176, -17), (176, -17), (176, -17)])
    assert (caught.value.point, caught.value.row) == ((176, -17), 2)
    assert hull.delete_many([(176, -17)] * 3 + [(0, 0), (-4, 0)], missing="ignore") == 2
    with pytest.raises(ValueError, match="missing must be"):
        hull.delete_many([], missing="no")
    assert_right(hull)


def test_tangents(make):
    hull = make(FIJI)
    ((left, right), inside) = hull.tangents([(170, -17), (179, -17)])
    assert left.tolist() == [179.4, -16.4]
    assert right.tolist() == [178.4, -18.1]
    assert np.isnan(inside).all()
    assert np.isnan(make(center=(0, 0)).tangents([(3, 4)])).all()


def test_as_a_value(make):
    hull = make(FIJI + FIJI[:2])
    twin = copy.deepcopy(hull)
    assert hull == twin
    twin.insert(170, 0)
    assert hull != twin
    assert (170, 0) not in hull
    assert hull != make(FIJI + FIJI[:2], center=(170, 0))
    assert hull != 5
    assert repr(hull) == f"<{make.__name__} of 7 points, 4 vertices>"
    installed = GeoHull(FIJI)
    installed.insert(170, 0)
    back = pickle.loads(pickle.dumps(installed))
    assert back == installed
    assert back.changes == installed.changes
    assert np.array_equal(back.vertices(), installed.vertices())
    with pytest.raises(TypeError, match="unhashable"):
        hash(hull)
    with pytest.raises(ValueError, match=r"a point is \(lon, lat\), got 5"):
        assert 5 in hull


def test_points_of_other_libraries(make):
    geopandas, pandas, shapely = (pytest.importorskip(name) for name in ("geopandas", "pandas", "shapely"))
    frame = pandas.DataFrame(FIJI, columns=["lon", "lat"])
    series = geopandas.GeoSeries([shapely.Point(*point) for point in FIJI])
    for points in (frame, series, {"type": "MultiPoint", "coordinates": FIJI}, iter(FIJI)):
        assert make(points) == make(FIJI)


def test_measures_need_pyproj(monkeypatch):
    from dynhull import _ellipsoid

    monkeypatch.setitem(sys.modules, "pyproj", None)
    _ellipsoid.geod.cache_clear()
    with pytest.raises(ImportError, match=r"pip install 'dynhull\[geo\]'"):
        _ = GeoHull(FIJI).area
    assert GeoHull(FIJI).contains([(179, -17)]).all()


degrees = st.integers(-6, 6).map(lambda step: 15.0 * step)
near_pole = st.tuples(st.sampled_from([0.0, 90.0, -90.0, 180.0, -180.0, 45.0]), st.sampled_from([90.0, 89.0, 80.0]))
across = st.tuples(st.sampled_from([170.0, 180.0, -180.0, -170.0, 190.0, 179.0]), st.integers(-3, 3).map(float))
equator = st.tuples(degrees.map(lambda lon: lon / 2), st.just(0.0) | st.integers(-2, 2).map(lambda i: i * 5e-324))
metres = st.tuples(st.integers(-9, 9).map(lambda i: 10 + i * 1e-5), st.integers(-9, 9).map(lambda i: 50 + i * 1e-5))


@given(st.one_of(*(st.lists(kind, min_size=1, max_size=14) for kind in (near_pole, across, equator, metres))))
def test_decisions_are_those_of_rational_arithmetic(points):
    for make in GEO_HULLS.values():
        hull = make(points)
        assert_right(hull)
        corners, _ = Gnomonic(hull.center).project(hull.vertices())
        places, _ = Gnomonic(hull.center).project(np.array(points))
        ring = oracle.hull([tuple(row) for row in corners.tolist()])
        assert hull.locate(points).tolist() == [oracle.locate(ring, tuple(row)) for row in places.tolist()]
