"""In which coordinate reference system points are: degrees belong on the globe, others in a plane."""

import sys

import geopandas
import pyproj
import pytest

from dynhull import DynamicHull, GeoHull, KeyedHull, convex_hull
from dynhull.crs import described
from dynhull.static import chan

PLACES = geopandas.GeoDataFrame(geometry=geopandas.points_from_xy([13, 14, 13.5], [52, 52, 53]), crs=4326)
METRES = PLACES.to_crs(32633)


@pytest.mark.parametrize("installed", [True, False])
@pytest.mark.parametrize(
    ("system", "degrees"),
    [
        ("EPSG:4326", True),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", True),
        ("http://www.opengis.net/def/crs/OGC/1.3/CRS84", True),
        ("OGC:CRS83", True),
        ("CRS84", True),
        ("urn:ogc:def:crs:EPSG::4269", True),
        ("urn:ogc:def:crs:EPSG:6.9:4258", True),
        ("http://www.opengis.net/def/crs/EPSG/0/4258", True),
        ("http://www.opengis.net/gml/srs/epsg.xml#4326", True),
        (4269, True),
        (pyproj.CRS(4269).to_json_dict(), True),
        (pyproj.CRS("EPSG:4326+5773").to_json_dict(), True),
        (pyproj.CRS(4674), True),
        ("urn:ogc:def:crs:EPSG::32633", False),
        ("epsg:3857", False),
        (25832, False),
        (pyproj.CRS(2056).to_json_dict(), False),
        ("EPSG:4807", None),  # in grads from Paris
        (pyproj.CRS(4807).to_json_dict(), None),
        ("metres", None),
        ({"type": "EngineeringCRS"}, None),
    ],
)
def test_which_systems_are_degrees(monkeypatch, installed, system, degrees):
    if not installed:
        monkeypatch.setitem(sys.modules, "pyproj", None)
    assert described(system).degrees is degrees


def test_without_pyproj_others_are_not_known(monkeypatch):
    assert described("EPSG:2056").degrees is False
    monkeypatch.setitem(sys.modules, "pyproj", None)
    assert described("EPSG:2056") == ("EPSG:2056", None)


@pytest.mark.parametrize(
    "use",
    [
        DynamicHull,
        lambda places: DynamicHull().insert_many(places),
        lambda places: KeyedHull("str").put_many(["a", "b", "c"], places),
        convex_hull,
        chan,
    ],
    ids=["hull", "insert_many", "put_many", "convex_hull", "chan"],
)
def test_degrees_in_a_plane_are_warned_about(recwarn, use):
    use(METRES)
    use(PLACES.set_crs(None, allow_override=True))
    assert not recwarn
    use(PLACES)
    (warned,) = recwarn
    assert "longitudes and latitudes (WGS 84), taken for x and y of a plane" in str(warned.message)
    assert "GeoHull" in str(warned.message)
    assert warned.filename == __file__


def test_metres_are_no_places(recwarn):
    GeoHull(PLACES).insert_many(PLACES.to_crs(4258).geometry)
    GeoHull(PLACES.set_crs(None, allow_override=True))
    hull = GeoHull()
    for use in (GeoHull, hull.insert_many, hull.locate):
        with pytest.raises(ValueError, match=r"in WGS 84 / UTM zone 33N, not in degrees .*: use to_crs\(4326\)"):
            use(METRES)
    assert not recwarn
