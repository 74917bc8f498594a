"""`dynhull load` reads columns of geometries: WKT, EWKT, WKB and EWKB, and the types of Parquet and GeoArrow."""

import json
from contextlib import suppress

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from command_line import dynhull

from dynhull_client import HullClient

pytestmark = pytest.mark.usefixtures("served")

RANDOM = np.random.default_rng(4)
BITS = RANDOM.integers(0, 2**64, 400, dtype=np.uint64).view(np.float64)
ODD = np.concatenate([BITS[np.isfinite(BITS)][:200].reshape(-1, 2), RANDOM.uniform(-90, 90, (50, 2))])
PLACES = RANDOM.uniform(-20, 20, (30, 2))
UTM = 32633


def wkt(points):
    return [f"POINT ({x!r} {y!r})" for x, y in points.tolist()]


def ewkb(points, srid):
    return list(shapely.to_wkb(shapely.set_srid(shapely.points(points), srid), include_srid=True))


def ewkb_hex(points):
    return [each.hex().upper() for each in ewkb(points, 4326)]


def wkb(points):
    return list(shapely.to_wkb(shapely.points(points)))


def typed(values, metadata=b"", name="geoarrow.wkb"):
    """An array whose type Parquet stores as one of its own."""
    stored = values if isinstance(values, pa.Array) else pa.array(values, pa.binary())

    class Geometries(pa.ExtensionType):
        def __init__(self, metadata=metadata):
            self.metadata = metadata
            super().__init__(stored.type, name)

        def __arrow_ext_serialize__(self):
            return self.metadata

        @classmethod
        def __arrow_ext_deserialize__(cls, _, metadata):
            return cls(metadata)

    pa.register_extension_type(Geometries())
    return pa.ExtensionArray.from_storage(Geometries(), stored)


@pytest.fixture(autouse=True)
def no_types():
    yield
    for name in "geoarrow.wkb", "geoarrow.point":
        with suppress(pa.ArrowKeyError):
            pa.unregister_extension_type(name)


def loaded(address, name, file, *options):
    """The points of a new hull, sorted, whether it is on the globe, and what the command said."""
    done = dynhull("load", name, file, *options)
    assert done.exit_code == 0, done.stderr
    with HullClient(address) as client:
        parts = list(client.read_points(name))
        points = [each for part in parts for each in part.points.tolist()]
        return sorted(points), client.get_hull(name).info.geographic, done.stderr


def test_numbers_of_texts_bit_for_bit(tmp_path, served, name):
    file = tmp_path / "odd.parquet"
    pq.write_table(pa.table({"id": range(len(ODD)), "geometry": wkt(ODD)}), file)
    points, geographic, said = loaded(served, name, file)
    assert (points, geographic) == (sorted(ODD.tolist()), False)
    assert f"{file}: the column geometry names no coordinate reference system: --geographic reads degrees\n" in said


@pytest.mark.parametrize(
    ("column", "values", "geographic"),
    [
        ("wkt", [f"SRID=4326;{text}" for text in wkt(PLACES)], True),
        ("GEOM", [f"srid={UTM}; {text.lower()}" for text in wkt(PLACES)], False),
        ("the_geom", ewkb(PLACES, 4326), True),
        ("wkb_geometry", [each.hex().upper() for each in ewkb(PLACES, UTM)], False),
        ("wkb", [each.hex() for each in wkb(PLACES)], False),
        ("geog", pa.array(wkt(PLACES)).dictionary_encode(), False),
        ("any", lambda: typed(wkb(PLACES)), True),
        ("any", lambda: typed(wkb(PLACES), b'{"crs": "EPSG:32633", "crs_type": "authority_code"}'), False),
        ("any", lambda: typed(wkb(PLACES), b'{"edges": "spherical"}'), True),
        (
            "any",
            lambda: typed(
                pa.FixedSizeListArray.from_arrays(PLACES.ravel(), 2), b'{"crs": "OGC:CRS84"}', "geoarrow.point"
            ),
            True,
        ),
    ],
    ids=["ewkt", "ewkt-utm", "ewkb", "hex-ewkb", "hex-wkb", "dictionary", "native", "native-utm", "geography", "arrow"],
)
def test_which_world_the_geometries_are_in(tmp_path, served, name, column, values, geographic):
    file = tmp_path / "places.parquet"
    array = values() if callable(values) else values
    pq.write_table(pa.table({"x1": PLACES[:, 0], column: array}), file)
    points, on_globe, said = loaded(served, name, file)
    assert (points, on_globe) == (sorted(PLACES.tolist()), geographic)
    assert f"points from the geometry column {column}" in said


LINES = [f'"{text}",a' for text in wkt(PLACES)]


@pytest.mark.parametrize(
    ("text", "geographic"),
    [
        ("\n".join(["geometry,id", *LINES]), False),
        ("\r\n".join([" WKT ;id", *(f"SRID=4326;{text}".join('""') + ";b" for text in wkt(PLACES))]), True),
        ("\n".join(["the_geom", *ewkb_hex(PLACES)]), True),
        ("\n".join(["wkt", *wkt(PLACES)]), False),
        ("\n".join(["id\tGEOM", *(f"a\t{text}" for text in wkt(PLACES))]), False),
    ],
    ids=["geopandas", "ewkt", "postgis", "alone", "tabs"],
)
def test_geometries_of_csv(tmp_path, served, name, text, geographic):
    file = tmp_path / "places.csv"
    file.write_text(text, newline="")
    points, on_globe, said = loaded(served, name, file)
    assert (points, on_globe) == (sorted(PLACES.tolist()), geographic)
    assert "bad row" not in said
    assert ("--geographic reads degrees" in said) != geographic


@pytest.mark.parametrize(
    ("geometries", "geographic"),
    [
        (wkt(PLACES), False),
        ([f"SRID=4326;{text}" for text in wkt(PLACES)], True),
        ([{"type": "Point", "coordinates": each} for each in PLACES.tolist()], True),
    ],
    ids=["wkt", "ewkt", "geojson"],
)
def test_geometries_of_json(tmp_path, served, name, geometries, geographic):
    file = tmp_path / "places.ndjson"
    file.write_text("".join(json.dumps({"id": "a", "geog": each}) + "\n" for each in geometries))
    points, on_globe, _ = loaded(served, name, file)
    assert (points, on_globe) == (sorted(PLACES.tolist()), geographic)


def test_lines_and_columns_of_csv(tmp_path, name):
    file = tmp_path / "places.csv"
    file.write_text('id,lon,lat,way\n1,8,9,"LINESTRING (0 0, 1 1, 2 3)"\n2,8,9,"POINT (4\n5)"\n3,8,9\n4,8,9,POINT,,7\n')
    assert "from 8.0 to 8.0" in dynhull("load", name, file, "--dry-run").stdout  # longitude and latitude are there
    done = dynhull("load", name, file, "--geometry", "way", "--key", "id", "--dry-run")
    assert "x from 4.0 to 4.0, y from 5.0 to 5.0" in done.stdout
    for words in "line 2: its geometry is LineString, not a", "line 5: its geometry is missing", "line 6: 6 fields":
        assert f"  {words}" in done.stderr
    assert (
        "4 points would be loaded" in dynhull("load", name, file, "--geometry", "way", "--vertices", "--dry-run").stdout
    )
    assert "has no column 'wey' (--geometry)" in dynhull("load", name, file, "--geometry", "wey", "--dry-run").stderr


def test_rows_without_a_point(tmp_path, name):
    rows = ["SRID=4326;POINT (1 2)", None, "", "POINT (1,2)", "POINT EMPTY", "SRID=3857;POINT (1 2)", "POINT Z (3 4 5)"]
    rows += ["LINESTRING (0 0, 1 1)", "CIRCULARSTRING (0 0, 1 1, 2 0)", "0101", "POINT (NaN 1)"]
    file = tmp_path / "rows.parquet"
    pq.write_table(pa.table({"place": rows}), file)
    bad = tmp_path / "bad.csv"
    done = dynhull("load", name, file, "--geometry", "place", "--dry-run", "--json", "--bad-rows", bad)
    assert (done.exit_code, json.loads(done.stdout)["points"]) == (0, 2), done.stderr
    said = bad.read_text()
    for reason in (
        "row 2,its geometry is missing",
        "row 3,its geometry is missing",
        "row 4,\"its geometry is not well-known text: Expected number but encountered ','\"",
        '"its SRID is 3857, and that of the first geometry 4326"',
        'row 8,"its geometry is LineString, not a Point (--vertices',
        "row 9,its geometry is not well-known text: Nonlinear",
        "row 10,its geometry is not well-known text",
        'row 11,"x is nan, not finite',
    ):
        assert reason in said
    assert said.count("\n") == 10
