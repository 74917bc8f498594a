"""Points from geometry libraries and data frames, and hulls for them."""

from itertools import pairwise
from xml.etree import ElementTree

import geopandas
import numpy as np
import pandas as pd
import polars
import pyarrow
import pytest
import shapely
from shapely.geometry import shape

from dynhull import DynamicHull, GeoHull, convex_hull
from dynhull.convex import minkowski_sum, moved
from dynhull.decompose import convex_pieces
from dynhull.gjk import contact, intersect

PAIRS = [(0.0, 0.0), (4.0, 0.0), (5.0, 5.0), (0.0, 4.0), (1.0, 1.0)]
CORNERS = [[0, 0], [4, 0], [5, 5], [0, 4]]
X, Y = ([pair[i] for pair in PAIRS] for i in (0, 1))
POINTS = [shapely.Point(pair) for pair in PAIRS]


def interleaved(points):
    return pyarrow.FixedSizeListArray.from_arrays(np.array(points).ravel(), 2)


SERIES = geopandas.GeoSeries(POINTS)
FRAME = geopandas.GeoDataFrame({"x2": X, "place": SERIES}, geometry="place")
FEATURE = {"type": "Feature", "geometry": {"type": "MultiPoint", "coordinates": PAIRS}, "properties": None}


@pytest.mark.parametrize(
    "source",
    [
        shapely.MultiPoint(PAIRS),
        shapely.LineString(PAIRS),
        POINTS,
        np.array(POINTS),
        geopandas.GeoSeries(POINTS),
        geopandas.GeoDataFrame({"name": list("abcde")}, geometry=POINTS),
        geopandas.GeoDataFrame({"x": X, "y": Y, "name": list("abcde")}),  # no geometry: a frame
        FEATURE,
        {"type": "FeatureCollection", "features": [FEATURE]},
        {"type": "GeometryCollection", "geometries": [FEATURE["geometry"]]},
        [FEATURE["geometry"]],
        pd.DataFrame({"Lat": Y, "name": list("abcde"), "Lon": X}),
        pd.DataFrame({"y": Y, "x": X}),
        pd.DataFrame({"y": Y, "x": X, "geometry": list("abcde")}),  # not of geopandas
        pd.DataFrame({"a": X, "b": Y}),
        pd.DataFrame(PAIRS),
        pd.DataFrame({"name": list("abcde"), "a": X, "b": Y})[["a", "b"]],
        polars.DataFrame({"y": [int(y) for y in Y], "x": X, "id": range(5)}),
        polars.LazyFrame({"lat": Y, "lon": X, "id": range(5)}),
        polars.DataFrame({"latitude": Y, "longitude": X}).to_struct("place"),
        pyarrow.table({"latitude": Y, "longitude": X, "id": range(5)}),
        *(SERIES.to_arrow(geometry_encoding="geoarrow", interleaved=each) for each in (True, False)),
        SERIES.to_arrow(geometry_encoding="WKB"),
        FRAME.to_arrow(geometry_encoding="geoarrow"),
        FRAME.to_arrow(geometry_encoding="WKB"),
        pyarrow.table(FRAME.to_arrow(geometry_encoding="geoarrow", interleaved=False)),
        pyarrow.chunked_array([interleaved(PAIRS[:1]), interleaved(PAIRS[1:])]),
        pyarrow.StructArray.from_arrays([Y, X, X], ["y", "x", "z"]),
        pyarrow.array(shapely.to_wkb(POINTS).tolist(), pyarrow.large_binary()),
    ],
    ids=lambda source: type(source).__name__,
)
def test_points_come_from(source: object) -> None:
    hull = DynamicHull(source)
    assert hull.points().tolist() == sorted(map(list, PAIRS))
    assert hull.insert_many(source) == hull.delete_many(source) == hull.apply([1] * 5, source) == 5
    assert hull.locate(source).tolist() == [0, 0, 0, 0, 1]
    assert convex_hull(source).tolist() == CORNERS


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (shapely.Polygon(PAIRS[:4], [[(1, 1), (2, 1), (2, 2)]]), [*PAIRS[:4], (1, 1), (2, 1), (2, 2)]),
        (shapely.MultiPolygon([shapely.box(0, 0, 1, 1)]), [(0, 0), (0, 1), (1, 0), (1, 1)]),
        (shapely.MultiLineString([[(0, 0), (1, 1)], [(2, 0), (1, 1)]]), [(0, 0), (1, 1), (1, 1), (2, 0)]),
        (shapely.LinearRing(PAIRS[:4]), PAIRS[:4]),
        ([shapely.Point(1, 2, 3), shapely.LineString([(3, 4, 5), (6, 7, 8)])], [(1, 2), (3, 4), (6, 7)]),
        (shapely.Polygon(), []),
    ],
)
def test_shapes_give_every_vertex_once(source: object, expected: list[tuple[float, float]]) -> None:
    assert DynamicHull(source).points().tolist() == sorted(map(list, expected))


@pytest.mark.parametrize(
    ("source", "complaint"),
    [
        ([POINTS[0], None], "points row 1 is None: must be a geometry"),
        ([POINTS[0], shapely.Point()], "points row 1 is an empty Point"),
        ([shapely.LineString(PAIRS), shapely.Point()], "points row 1 is an empty Point"),
        (geopandas.GeoSeries([*POINTS, None]), "points row 5 is None"),
        ({"type": "Feature", "geometry": None}, "a Feature without geometry"),
        ({"type": "Circle"}, "'Circle': not a GeoJSON geometry"),
        (
            pd.DataFrame({"a": X, "b": Y, "c": Y}),
            r"the columns a, b, c: choose two, x first, as in frame\[\['a', 'b'\]\]",
        ),
        (pd.DataFrame({"x": X, "y": Y, "lon": X, "lat": Y}), "choose two"),
        (pd.DataFrame({"x": X, "X": X, "y": Y}), "choose two"),
        (pd.DataFrame({"y": X, "z": Y}), "the columns y, z: choose two"),
        (pd.DataFrame({"height": X, "lon": Y}), "the columns height, lon: choose two"),
        (pd.DataFrame([[1.0, 2.0]], columns=["x", "x"]), "the columns x, x: choose two"),
        (pd.DataFrame({"x": [1.0, None], "y": [1.0, 2.0]}), r"points row 1 is \(nan, 2.0\)"),
        (pd.DataFrame({"x": [1, 2**53 + 1], "y": [0.5, 0.5]}), "points row 1 is 9007199254740993: no double"),
        (polars.DataFrame({"x": [1.0, None], "y": [1.0, 2.0]}), r"points row 1 is \(nan, 2.0\)"),
        (geopandas.GeoSeries([*POINTS, None]).to_arrow(geometry_encoding="WKB"), "points row 5 is null: leave it out"),
        (geopandas.GeoSeries([shapely.box(0, 0, 1, 1)]).to_arrow(geometry_encoding="geoarrow"), "geoarrow.polygon"),
        (geopandas.GeoSeries([*POINTS, shapely.Point()]).to_arrow(geometry_encoding="geoarrow"), "points row 5 is"),
        (pyarrow.array([b"none"]), "points are not well-known binary"),
    ],
)
def test_what_has_no_points_is_an_error(source: object, complaint: str) -> None:
    hull = DynamicHull(PAIRS)
    with pytest.raises(ValueError, match=complaint):
        hull.insert_many(source)
    assert len(hull) == 5


@pytest.mark.parametrize("encoding", ["geoarrow", "WKB"])
def test_arrow_that_names_its_reference_system(encoding: str) -> None:
    degrees = SERIES.set_crs(4326).to_arrow(geometry_encoding=encoding)
    assert len(GeoHull(degrees)) == 5
    with pytest.warns(UserWarning, match="taken for x and y of a plane"):
        DynamicHull(degrees)
    frame = FRAME.set_crs(32633).to_arrow(geometry_encoding=encoding)
    assert len(DynamicHull(frame)) == 5
    with pytest.raises(ValueError, match="WGS 84 / UTM zone 33N, not in degrees"):
        GeoHull(frame)


def test_a_single_object_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"points must have shape \(n, 2\), got None"):
        DynamicHull(np.array(None))


def test_text_columns_are_an_error() -> None:
    with pytest.raises(TypeError, match="points row 0: coordinates must be real numbers"):
        DynamicHull(pd.DataFrame({"x": ["1", "2"], "y": ["3", "4"]}))


@pytest.mark.parametrize(
    ("count", "kind", "area"), [(0, "Polygon", 0), (1, "Point", 0), (2, "LineString", 0), (5, "Polygon", 20)]
)
def test_hulls_are_geometries(count: int, kind: str, area: float) -> None:
    hull = DynamicHull(PAIRS[:count])
    geometry = shape(hull)
    assert (geometry.geom_type, geometry.area, geometry.is_empty) == (kind, area, count == 0)
    assert geometry.equals(shapely.MultiPoint(PAIRS[:count]).convex_hull) or count == 0
    assert DynamicHull(geometry) == DynamicHull(hull.vertices())
    assert DynamicHull(hull) == DynamicHull(hull.vertices())


@pytest.mark.parametrize("count", range(6))
def test_hulls_are_geometries_of_shapely_and_texts(count: int) -> None:
    hull = DynamicHull(np.array(PAIRS[:count]).reshape(-1, 2) / 3)
    assert hull.to_shapely().equals(shape(hull)) or count == 0
    assert shapely.from_wkt(hull.wkt) == hull.to_shapely()
    globe = GeoHull([(177.4, -17.8), (178.4, -18.1), (-179.9, -16.8), (179.4, -16.4)])
    assert globe.to_shapely().geom_type == "MultiPolygon"
    assert shapely.from_wkt(globe.wkt) == globe.to_shapely()


def test_a_hull_of_whole_numbers_as_text() -> None:
    assert DynamicHull(PAIRS).wkt == "POLYGON ((0 0, 4 0, 5 5, 0 4, 0 0))"


@pytest.mark.parametrize("hull", [DynamicHull, GeoHull])
def test_the_rows_that_are_vertices(hull: type) -> None:
    frame = pd.DataFrame({"name": list("abcdeb"), "lon": [*X, X[1]], "lat": [*Y, Y[1]]})
    made = hull(frame)
    rows = made.vertex_rows(frame)
    assert frame.iloc[rows][["lon", "lat"]].to_numpy().tolist() == made.vertices().tolist()
    assert sorted(frame.name.iloc[rows]) == ["a", "b", "c", "d"]
    assert hull().vertex_rows(frame).tolist() == []
    with pytest.raises(ValueError, match=r"the vertex \(5\.0, 5\.0\) is none of the points"):
        made.vertex_rows(frame[frame.name != "c"])


def test_geometries_points_and_frames_are_convex_sets() -> None:
    square, corner = shapely.box(0, 0, 1, 1), pd.DataFrame({"x": [1, 2], "y": [1, 2]})
    assert intersect(square, corner)
    assert intersect(np.array(PAIRS), [shapely.box(7, 7, 8, 8), shapely.Point(5, 5)])
    assert contact(shapely.MultiPoint(PAIRS), [[8, 9]]).distance == 5
    assert contact(moved(square, [4, 0]), minkowski_sum(square, [[0, 0], [1, 1]])).distance == 2
    assert not intersect(np.eye(3), [[0.0, 0, 0], [-1, -1, -1]])
    assert intersect(convex_pieces(shapely.Polygon([(0, 0), (4, 2), (0, 4), (2, 2)])), [[1, 1]])


@pytest.mark.parametrize(
    ("shape", "complaint"),
    [
        (shapely.Polygon([(0, 0), (4, 2), (0, 4), (2, 2)]), "b is a Polygon that is not convex: give its convex hull"),
        (shapely.Polygon(PAIRS[:4], [[(1, 1), (2, 1), (2, 2)]]), "b is a Polygon that is not convex"),
        ([shapely.Point(1, 1), shapely.LineString(PAIRS)], "b piece 1 is a LineString that is not convex"),
        (shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 2, 3, 3)]), "b is a MultiPolygon"),
        (np.empty((0, 2)), "b has no points"),
        ([[1, float("nan")]], r"b row 0 is \(1.0, nan\)"),
    ],
    ids=str,
)
def test_no_hull_in_silence_for_what_is_not_convex(shape: object, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        intersect(shapely.Point(0, 0), shape)


def test_the_globe_is_no_plane() -> None:
    with pytest.raises(TypeError, match="a is <GeoHull of 1 points, 1 vertices>: shapes are in the plane or in space"):
        intersect(GeoHull([(1, 2)]), shapely.Point(0, 0))


@pytest.mark.parametrize("scale", [1.0, 5e-324, 2.0**1021])
@pytest.mark.parametrize("count", range(6))
def test_hulls_are_pictures(count: int, scale: float) -> None:
    hull = DynamicHull(np.array(PAIRS[:count]).reshape(-1, 2) * scale)
    picture = ElementTree.fromstring(hull._repr_svg_())
    _, _, width, height = map(float, picture.get("viewBox").split())
    title, polygon, *dots = picture
    assert title.text == repr(hull)
    assert len(dots) == len(hull) + len(hull.vertices())
    corners = [tuple(map(float, corner.split(","))) for corner in polygon.get("points").split()]
    assert len(corners) == len(hull.vertices())
    assert all(0 <= x <= width and 0 <= y <= height for x, y in corners)
    if len(corners) > 2:  # y grows upwards: counter-clockwise on paper is clockwise on the screen
        around = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in pairwise([*corners, corners[0]]))
        assert around < 0


def test_a_picture_of_many_points_is_small() -> None:
    hull = DynamicHull(np.random.default_rng(1).normal(size=(100_000, 2)))
    assert len(hull._repr_svg_()) < 10_000
