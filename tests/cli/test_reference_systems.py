"""In which coordinate reference system a file is: on the globe, in a plane, or refused."""

import gzip
import json

import pyarrow as pa
import pyarrow.parquet as pq
import pyproj
import pytest
import shapely
from command_line import dynhull

from dynhull_client import HullClient

METRES = "urn:ogc:def:crs:EPSG::32633"
UTM = "WGS 84 / UTM zone 33N"
UNKNOWN = "urn:ogc:def:crs:MINE::1"


def collection(crs=None, *, last=False, properties=None, features=4, note=""):
    """A collection of points that are longitudes and latitudes, or so small as such."""
    read = [
        {
            "type": "Feature",
            "properties": {"note": note, **(properties or {})},
            "geometry": {"type": "Point", "coordinates": [-90 + i % 7, 30 + i % 5]},
        }
        for i in range(features)
    ]
    named = {"crs": {"type": "name", "properties": {"name": crs}}} if crs else {}
    first, end = ({}, named) if last else (named, {})
    return json.dumps({"type": "FeatureCollection", **first, "features": read, **end})


def geographic(name):
    return json.loads(dynhull("list", name, "--json").stdout)["geographic"]


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize(
    ("text", "on_globe"),
    [
        (collection("urn:ogc:def:crs:EPSG::4269"), True),
        (collection("urn:ogc:def:crs:EPSG::4258", last=True), True),
        (collection(METRES), False),
        (collection(METRES, last=True), False),
        (collection(METRES, last=True, properties={"crs": {"properties": {"name": "EPSG:4326"}}}), False),
        (collection(properties={"crs": None}), True),
        (collection(properties={"crs": {"type": "name", "properties": {"name": METRES}}}), True),
        (collection(note='"crs": {"properties": {"name": "EPSG:32633"}}'), True),
        (collection(note="crs", properties={"b": [{"crs": METRES}]}), True),
        (collection().replace("{", '{"crs": null, ', 1), False),
        (json.dumps({"type": "Point", "coordinates": [1, 2], "crs": {"properties": {"name": METRES}}}), False),
        (json.dumps({"type": "Point", "coordinates": [1, 2]}), True),
    ],
)
def test_geojson(tmp_path, name, text, on_globe):
    path = tmp_path / "a.geojson"
    path.write_text(text)
    done = dynhull("load", name, path)
    assert done.exit_code == 0, done.stderr
    assert geographic(name) is on_globe
    assert on_globe or UTM in done.stderr or "names no coordinate reference system" in done.stderr


@pytest.mark.usefixtures("served")
def test_compressed_geojson_and_pipes(tmp_path, name):
    path = tmp_path / "a.geojson.gz"
    text = collection(METRES, last=True, properties={"crs": None})
    path.write_bytes(gzip.compress(text.encode()))
    assert dynhull("load", f"{name}-a", path).exit_code == 0
    assert dynhull("load", f"{name}-b", "-", "--format", "geojson", input=text).exit_code == 0
    text = collection(properties={"crs": {"properties": {"name": METRES}}})
    assert dynhull("load", f"{name}-c", "-", "--format", "geojson", input=text).exit_code == 0
    assert [geographic(name + end) for end in ("-a", "-b", "-c")] == [False, False, True]


@pytest.mark.usefixtures("served")
def test_a_system_at_the_end_of_a_long_file(tmp_path, name):
    path = tmp_path / "a.geojson"
    text = collection(METRES, last=True, features=2000, note="x" * 50)
    path.write_text(text)
    assert dynhull("load", name, path).exit_code == 0
    assert geographic(name) is False
    done = dynhull("load", f"{name}-b", "-", "--format", "geojson", input=text)  # its end is read when it is too late
    assert done.exit_code == 2
    assert f"standard input says at its end that its crs is {UTM}" in done.stderr
    assert dynhull("load", f"{name}-c", "-", "--format", "geojson", "--plane", input=text).exit_code == 0
    text = collection("urn:ogc:def:crs:EPSG::4258", last=True, features=2000, note="x" * 50)
    assert dynhull("load", f"{name}-d", "-", "--format", "geojson", input=text).exit_code == 0


@pytest.mark.usefixtures("served")
def test_an_unknown_system_is_refused_unless_the_options_say_what_it_is(tmp_path, name):
    for text, file in ((collection(UNKNOWN), "a.geojson"), (collection(UNKNOWN, last=True, features=999), "b.geojson")):
        path = tmp_path / file
        path.write_text(text)
        done = dynhull("load", name, path)
        assert done.exit_code == 2
        assert f"{file}: its crs is in {UNKNOWN}, which is not known to be degrees: --geographic takes" in done.stderr
        for option, on_globe in (("--geographic", True), ("--plane", False)):
            assert dynhull("load", name + option, path, option).exit_code == 0
            assert geographic(name + option) is on_globe
        assert dynhull("load", f"{name}--plane", path, "--again").exit_code == 0  # it is a plane already


def test_metres_do_not_land_on_the_globe(tmp_path, served, name):
    path = tmp_path / "a.geojson"
    path.write_text(collection(METRES))
    with HullClient(served) as client:
        client.create_hull(name, geographic=True)
    for options in ([], ["--geographic"], ["--dry-run"]):
        done = dynhull("load", name, path, *options)
        assert done.exit_code == 2
        assert f"a.geojson is in {UTM}, and the hull is on the globe, in degrees: convert it" in done.stderr
    with HullClient(served) as client:
        assert client.get_hull(name).info.points == 0


@pytest.mark.usefixtures("served")
def test_rows_of_geojson_have_one_system(tmp_path, name):
    path = tmp_path / "a.ndjson"
    rows = [{"type": "Point", "coordinates": [i, i], "crs": {"properties": {"name": METRES}}} for i in range(3)]
    path.write_text("\n".join(map(json.dumps, [*rows, {"type": "Point", "coordinates": [5, 5]}])))
    done = dynhull("load", name, path)
    assert "line 4: its crs is another one than that of the first row" in done.stderr
    assert geographic(name) is False


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize(
    ("crs", "on_globe"),
    [
        ({}, True),
        ({"crs": pyproj.CRS(4269).to_json_dict()}, True),
        ({"crs": pyproj.CRS(32633).to_json_dict()}, False),
        ({"crs": None}, False),
        ({"crs": pyproj.CRS(4807).to_json_dict()}, None),
    ],
)
def test_geoparquet(tmp_path, name, crs, on_globe):
    path = tmp_path / "a.parquet"
    table = pa.table({"place": [shapely.to_wkb(shapely.Point(i, i % 2)) for i in range(3)]})
    geo = {"version": "1.1.0", "primary_column": "place", "columns": {"place": {"encoding": "WKB", **crs}}}
    pq.write_table(table.replace_schema_metadata({"geo": json.dumps(geo)}), path)
    done = dynhull("load", name, path)
    if on_globe is None:
        assert done.exit_code == 2
        assert "NTF (Paris), which is not known to be degrees" in done.stderr
    else:
        assert done.exit_code == 0, done.stderr
        assert geographic(name) is on_globe
