"""`dynhull load` reads what people have. Every file here holds the same three points."""

import gzip
import json
import struct
import subprocess
from itertools import count

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from command_line import dynhull
from forked import COMMAND

from dynhull_client import HullClient

TRIANGLE = [[-5.0, 6.0], [1.5, 2.0], [3.0, 4.25]]
COMMA = "x,y\n1.5,2\n3,4.25\n-5,6\n"
HEADERLESS = "1.5,2\n3,4.25\n-5,6\n"
GERMAN = "Ort;lon;lat\nKöln, alt;1,5;2\nBonn;3;4,25\nJena;-5;6\n"
FEATURES = [
    {"type": "MultiPoint", "coordinates": [[1.5, 2], [3, 4.25, 7]]},
    {"type": "LineString", "coordinates": [[-5, 6], [-5, 6]]},
    {"type": "Polygon", "coordinates": [[[1.5, 2], [3, 4.25], [-5, 6], [1.5, 2]]]},
    {"type": "MultiLineString", "coordinates": [[[1.5, 2], [3, 4.25]], [[3, 4.25], [-5, 6]]]},
    {"type": "MultiPolygon", "coordinates": [[[[1.5, 2], [3, 4.25], [-5, 6], [1.5, 2]]]]},
    {"type": "GeometryCollection", "geometries": [{"type": "Point", "coordinates": [1.5, 2]}]},
]
VERTICES = 2 + 2 + 3 + 4 + 3 + 1  # the last vertex of a ring is its first
COLLECTION = {
    "type": "FeatureCollection",
    "features": [{"type": "Feature", "properties": {}, "geometry": each} for each in FEATURES],
}
RING = [[0, 0], *([1, 0.001 * i] for i in range(1000)), [0, 0]]
LONG_LINES = 2 * (json.dumps({"type": "Polygon", "coordinates": [RING]}) + "\n")
LATIN = "Länge,Breite\n1.5,2\n3,4.25\n-5,6\n".encode("latin-1")


@pytest.mark.parametrize(
    ("file", "content", "options"),
    [
        ("points.csv.gz", gzip.compress(COMMA.encode()), []),
        ("points.CSV", COMMA, []),
        ("points.txt", COMMA.replace(",", " "), []),
        ("points.txt", " x  y \n 1.5   2\n3 4.25 \n -5  6\n", []),
        ("points.tsv", COMMA.replace(",", "\t"), []),
        ("points.csv", COMMA.replace(",", "\t"), []),
        ("points.csv", COMMA.replace(",", "|"), []),
        ("points.csv", COMMA.replace(",", ":"), ["--delimiter", ":"]),
        ("points.csv", COMMA.replace(",", "\t"), ["--delimiter", "tab"]),
        ("points.csv", GERMAN, []),
        ("points.csv", "lat,lon,name (short; long)\n2,1.5,a\n4.25,3,b\n6,-5,c\n", []),
        ("points.csv", 'lat,lon,"name; long"\n2,1.5,a\n4.25,3,b\n6,-5,"c;d"\n', []),
        ("points.csv", "x,y,a|b\n1.5,2,a\n3,4.25,b|c\n-5,6,c\n", []),
        ("points.csv", "x, y, a\tb\n1.5, 2, a\n3, 4.25, b\n-5, 6, c\n", []),
        ("points.txt", "x|y|name, first\n1.5|2|a\n3|4.25|b, c\n-5|6|c\n", []),
        ("points.csv", 'x,y,note\n1.5,2,"a\nb"\n3,4.25,"c;\n;d"\n-5,6,\n', []),
        ("points.csv", "2020,x,y\n7,1.5,2\n8,3,4.25\n9,-5,6\n", []),
        ("points.tsv", GERMAN.replace(";", "\t"), []),
        ("points.csv", '"x","y"\n"1,5","2"\n"3","4,25"\n"-5","6"\n', ["--decimal", ","]),
        ("points.csv", "\n\n" + COMMA, []),
        ("points.csv", HEADERLESS, []),
        ("points.csv", HEADERLESS, ["--x", "1", "--y", "2"]),
        ("points.csv", "1,5;2\n3;4,25\n-5;6\n", []),
        ("points.csv", "a,1.5,2\nb,3,4.25\nc,-5,6\n", ["--x", "2", "--y", "3"]),
        ("points.csv", "n/a,n/a\n" + HEADERLESS, ["--no-header"]),
        ("points.csv", "7,8\n" + HEADERLESS, ["--header", "--x", "7", "--y", "8"]),
        ("points.csv", COMMA.replace("x,y", " LNG , Lat "), []),
        ("points.csv", COMMA.replace("x,y", "long,lat"), []),
        ("points.csv", COMMA.replace("x,y", "Easting,Northing"), []),
        ("points.csv", COMMA.encode("utf-16"), []),
        ("points.csv", COMMA.encode("utf-16-be"), ["--encoding", "utf-16-be"]),
        ("points.csv", COMMA.encode("utf-8-sig"), []),
        ("points.csv", LATIN, ["--encoding", "latin-1", "--x", "Länge", "--y", "Breite"]),
        ("points.csv", LATIN, ["--encoding", "latin-1", "--x", "1", "--y", "2"]),
        ("points.json", json.dumps(TRIANGLE), []),
        ("points.json", json.dumps([{"lng": x, "lat": y} for x, y in TRIANGLE], indent=1), []),
        ("points.json", "\n".join(json.dumps({"lng": x, "lat": y}) for x, y in TRIANGLE), []),
        ("points.json.gz", gzip.compress(json.dumps(TRIANGLE).encode()), []),
        ("points.json", json.dumps(COLLECTION, indent=1).encode("utf-8-sig"), ["--vertices"]),
        ("points.json", json.dumps(COLLECTION) + "\n", ["--vertices"]),
        ("points.geojson", json.dumps(COLLECTION), ["--vertices"]),
        ("points.ndjson", "\n".join(map(json.dumps, FEATURES)), ["--vertices"]),
        ("points.ndjson", "\n".join(map(json.dumps, COLLECTION["features"])).encode("utf-8-sig"), ["--vertices"]),
    ],
    ids=count(),
)
def test_the_same_triangle(tmp_path, served, name, file, content, options):
    path = tmp_path / file
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    done = dynhull("load", name, path, *options)
    assert done.exit_code == 0, done.stderr
    with HullClient(served) as client:
        hull = client.get_hull(name)
        assert hull.vertices.tolist() == TRIANGLE
        assert hull.info.points == (VERTICES if "--vertices" in options else 3)


def test_spaces_after_delimiters_are_no_part_of_keys(tmp_path, served, name):
    path = tmp_path / "keys.csv"
    path.write_text('lat, lon, id\n0, 0, A\n4, 0, B\n4, 4, "C, D"\n0, 4," E"\n')
    assert dynhull("load", name, path, "--key", "id").exit_code == 0
    with HullClient(served) as client:
        assert sorted(client.entities(name).keys) == [" E", "A", "B", "C, D"]


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize(
    ("content", "options", "points", "said"),
    [
        ("1.5,2\n3,4.25\n", [], 2, "has no header: x is column 1, y is column 2"),
        (COMMA.encode("utf-16"), [], 3, "is UTF-16"),
        ("x,y\n1_000,2\n3,4\n", [], 1, "line 2: x is '1_000', not a number"),
        ("x;y\n1,5;2\n1.5;2\n", [], 1, "line 2: x is '1,5', not a number with the decimal mark '.'"),
        ("x;y\n1,5;2\n1.5;2\n", ["--decimal", ","], 1, "line 3: x is '1.5', not a number"),
        ("x;y\n1.234,5;2\n7;2\n", [], 1, "line 2: x is '1.234,5', not a number"),
        ('x,y\n"1\n",2\n' + "1,2\n" * 9000 + "1,two\n", [], 9001, "line 9004: y is 'two', not a number"),
        ("1,2\n" * 9000 + "1,two\n", [], 9000, "line 9001: column 2 is 'two', not a number"),
        ('\n\nx,y\n"1\n",2\n\n3,four\n', [], 1, "line 7: y is 'four', not a number"),
    ],
    ids=count(),
)
def test_what_may_surprise_is_said(tmp_path, name, content, options, points, said):
    path = tmp_path / "points.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    done = dynhull("load", name, path, *options, "--json")
    assert (done.exit_code, json.loads(done.stdout)["loaded"]) == (0, points), done.stderr
    assert said in done.stderr


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize(
    ("file", "content", "options", "message"),
    [
        ("a.csv", "\n\n", [], "a.csv is empty"),
        ("a.geojson", "", [], "a.geojson is empty"),
        ("a.parquet", "", [], "a.parquet is empty"),
        ("a.json.gz", gzip.compress(b""), [], "a.json.gz is empty"),
        ("a.json", '{"x": [1, 2],\n"y": [3, 4]}', [], "a.json has no points: it is a JSON object without features"),
        ("a.geojson", '{"features": [], "type": "FeatureCollection"}', [], "a.geojson has no points"),
        ("a.geojson", LONG_LINES, ["--vertices"], "if each line is a row or a feature, add --format ndjson"),
        ("a.csv", COMMA, ["--delimiter", "ab"], "--delimiter 'ab' is not one character"),
        ("a.csv", COMMA, ["--decimal", ";"], "--decimal ';' is neither"),
        ("a.csv", COMMA, ["--encoding", "klingon"], "there is no encoding 'klingon'"),
        ("a.nmea", COMMA, ["--vertices"], "--vertices is for csv, tsv, parquet, json, geojson, ndjson, gpkg,"),
        ("a.geojson", "{}", ["--x", "a"], "--x is for csv, tsv, parquet, json, ndjson, gpkg,"),
        ("a.csv.gz", gzip.compress(COMMA.encode())[:-9], [], "the compressed data is damaged"),
        ("a.csv.gz", gzip.compress(b"x,y\n" + bytes(99))[:20] + bytes(99), [], "the compressed data is damaged"),
        ("a.csv", "x,y\n1,2\n", ["--x", "3", "--y", "1"], "has no column '3' (--x); it has x, y"),
        ("a.csv", f"x,y\n1,2\n{'3' * 200_000},4\n", [], "a.csv, line 3: field larger than field limit"),
        ("a.csv", 'x,y\n1,2\n"3,4\n5,6\n7,8', [], "a.csv, line 3: a quote is opened and not closed before the end"),
        ("a.csv", '"x,y\n1,2\n', [], "a.csv, line 1: a quote is opened and not closed before the end"),
    ],
    ids=count(),
)
def test_what_cannot_be_read_says_why(tmp_path, monkeypatch, name, file, content, options, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / file).write_bytes(content.encode() if isinstance(content, str) else content)
    done = dynhull("load", name, file, *options)
    assert done.exit_code == 2
    assert message in done.stderr


def wkb(shape, **options):
    return shapely.to_wkb(shapely.geometry.shape(shape), **options)


def write_geoparquet(path, geometries, encoding="WKB", **crs):
    geo = {"version": "1.1.0", "primary_column": "place", "columns": {"place": {"encoding": encoding, **crs}}}
    table = pa.table({"x": [0.0] * len(geometries), "y": [0.0] * len(geometries), "place": geometries})
    pq.write_table(table.replace_schema_metadata({"geo": json.dumps(geo)}), path)


POINT = {"type": "Point", "coordinates": [-5, 6]}
SHAPES = [FEATURES[0], {**FEATURES[1], "coordinates": [[-5, 6, 1], [-5, 6, 2]]}, *FEATURES[2:]]


@pytest.mark.parametrize(
    ("geometries", "options"),
    [
        ([wkb({"type": "Point", "coordinates": each}) for each in TRIANGLE], []),
        ([wkb({"type": "Point", "coordinates": each}, byte_order=0) for each in TRIANGLE], []),
        ([wkb({"type": "Point", "coordinates": [*each, 9]}, flavor="iso") for each in TRIANGLE], []),
        ([wkb({"type": "Point", "coordinates": [*each, 9]}, flavor="extended") for each in TRIANGLE], []),
        ([wkb(shape) for shape in FEATURES], ["--vertices"]),
        ([wkb(shape, byte_order=0, flavor="iso") for shape in SHAPES], ["--vertices"]),
        (
            [shapely.to_wkb(shapely.set_srid(shapely.geometry.shape(s), 4326), include_srid=True) for s in FEATURES],
            ["--vertices"],
        ),
        (pa.array([{"x": x, "y": y} for x, y in TRIANGLE]), []),
    ],
    ids=count(),
)
@pytest.mark.parametrize("crs", [{}, {"crs": {"type": "ProjectedCRS"}}], ids=["degrees", "metres"])
def test_geoparquet(tmp_path, served, name, geometries, options, crs):
    path = tmp_path / "points.parquet"
    write_geoparquet(path, geometries, "point" if isinstance(geometries, pa.Array) else "WKB", **crs)
    done = dynhull("load", name, path, *options)
    assert done.exit_code == 0, done.stderr
    assert "points from the geometry column place" in done.stderr
    assert "bad" not in done.stderr
    with HullClient(served) as client:
        hull = client.get_hull(name)
        assert (hull.vertices.tolist(), hull.info.geographic) == (TRIANGLE, not crs)
        # A named column is taken instead of the geometry.
        assert dynhull("load", name, path, "--x", "x", "--y", "y").exit_code == 0
        assert client.count(name, [[0, 0]]).counts.tolist() == [len(geometries)]


@pytest.mark.usefixtures("served")
def test_geometries_that_are_no_points(tmp_path, name):
    path = tmp_path / "points.parquet"
    empty = struct.pack("<BIdd", 1, 1, np.nan, np.nan)
    write_geoparquet(path, [wkb(POINT), None, b"", wkb(FEATURES[2]), empty, wkb(POINT)[:9]])
    done = dynhull("load", name, path, "--json")
    assert (done.exit_code, json.loads(done.stdout)["points"]) == (0, 1)
    for reason in (
        "row 2: its geometry is missing",
        "row 3: its geometry is not well-known binary",
        "row 4: its geometry is Polygon, not a Point (--vertices takes the vertices of every geometry)",
        "row 5: x is nan, not finite",
        "row 6: its geometry is not well-known binary",
    ):
        assert reason in done.stderr
    write_geoparquet(path, [1.0], "multipoint")
    done = dynhull("load", name, path)
    assert done.exit_code == 2
    assert "encoded as multipoint" in done.stderr


@pytest.mark.usefixtures("served")
def test_geojson_that_is_no_geometry(tmp_path, name):
    geometries = [
        {"type": "Point", "coordinates": [1, 2]},
        {"type": "Point", "coordinates": [1]},
        {"type": "Circle", "coordinates": [1, 2]},
        {"type": "Polygon", "coordinates": [7]},
        {"type": "GeometryCollection", "geometries": 7},
        {"type": "MultiPoint", "coordinates": [[1, True]]},
    ]
    path = tmp_path / "points.ndjson"
    path.write_text("\n".join(map(json.dumps, geometries)))
    done = dynhull("load", name, path, "--vertices", "--json")
    assert (done.exit_code, json.loads(done.stdout)["points"]) == (0, 1)
    for reason in (
        "line 2: not two coordinates",
        "line 3: its geometry is Circle, which GeoJSON does not have",
        "line 4: its coordinates are not a list",
        "line 5: its coordinates are not a list",
        "line 6: y is true, not a number",
    ):
        assert reason in done.stderr
    path.write_text("\n".join(map(json.dumps, geometries[1:])))
    done = dynhull("load", name, path, "--vertices", "--dry-run")
    assert done.exit_code == 2
    assert "has no points" in done.stderr


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize("indent", [None, 2])
@pytest.mark.parametrize("suffix", ["geojson", "json"])
def test_geojson_without_a_collection(tmp_path, name, suffix, indent):
    path = tmp_path / f"points.{suffix}"
    feature = {"type": "Feature", "properties": {}, "geometry": FEATURES[2]}
    for value, vertices in ((feature, 3), (FEATURES[2], 3), (FEATURES[5], 1), (FEATURES[0], 2)):
        path.write_text(json.dumps(value, indent=indent))
        done = dynhull("load", name, path, "--vertices", "--json", "--again")
        assert (done.exit_code, json.loads(done.stdout)["loaded"]) == (0, vertices), done.stderr
    done = dynhull("load", name, path, "--dry-run")
    assert done.exit_code == 2
    assert "1: its geometry is MultiPoint, not a Point (--vertices takes the vertices of every geometry)" in done.stderr


def test_geojson_a_line(tmp_path, served, name):
    path = tmp_path / "points.geojson"
    lines = [json.dumps({"type": "Point", "coordinates": each}) + "\n" for each in TRIANGLE]
    for mark in ("", "\x1e"):  # the mark of text sequences, RFC 8142
        path.write_text("".join(mark + line for line in lines))
        done = dynhull("load", name, path, "--replace")
        assert done.exit_code == 0, done.stderr
        with HullClient(served) as client:
            assert client.get_hull(name).vertices.tolist() == TRIANGLE
    path.write_text(LONG_LINES)  # the advice of the error works
    done = dynhull("load", name, path, "--vertices", "--format", "ndjson", "--replace", "--json")
    assert (done.exit_code, json.loads(done.stdout)["points"]) == (0, 2002), done.stderr


@pytest.mark.parametrize("file", ["points", "points.xlsx", "points.csv"])
def test_a_file_that_does_not_exist(tmp_path, file):
    done = dynhull("load", "a", tmp_path / file, "--dry-run")
    assert done.exit_code == 2
    assert done.stderr == f"error: {tmp_path / file}: No such file or directory\n"


def test_a_compressed_pipe(tmp_path, served, name):
    path = tmp_path / "points.csv.gz"
    path.write_bytes(gzip.compress(COMMA.encode()))
    command = f"{COMMAND} load {name} <(cat {path}) --format csv --address {served}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    done = dynhull("load", name, "-", input=path.read_bytes())
    assert done.exit_code == 0, done.stderr
    with HullClient(served) as client:
        assert client.get_hull(name).vertices.tolist() == TRIANGLE


def test_compressed_or_not_it_is_the_same_load(tmp_path, served, name):
    plain, compressed = tmp_path / "points.csv", tmp_path / "points.csv.gz"
    plain.write_text(COMMA)
    compressed.write_bytes(gzip.compress(COMMA.encode()))
    assert dynhull("load", name, plain).exit_code == 0
    done = dynhull("load", name, compressed)
    assert done.exit_code == 2
    assert "loaded before" in done.stderr
    with HullClient(served) as client:
        assert client.get_hull(name).info.points == 3


def test_dry_run_reports_and_changes_nothing(tmp_path, served, name):
    path = tmp_path / "points.csv"
    path.write_text(COMMA + "7,oops\n")
    bad = tmp_path / "bad.csv"
    done = dynhull("load", name, path, "--dry-run", "--address", "127.0.0.1:1", "--bad-rows", bad)
    where = "x from -5.0 to 3.0, y from 2.0 to 6.0"
    assert (done.exit_code, done.stdout) == (0, f"{name}: 3 points would be loaded, {where}; nothing was changed\n")
    assert "line 5: y is 'oops', not a number" in done.stderr
    assert "line 5" in bad.read_text()
    done = dynhull("load", name, "--dry-run", "--json", input=COMMA)
    assert json.loads(done.stdout) == {"name": name, "points": 3, "bad_rows": 0, "bounds": [-5, 2, 3, 6]}
    assert dynhull("load", name, path, "--dry-run", "--max-bad", 0).exit_code == 2
    with HullClient(served) as client:
        assert list(client.list_hulls(name)) == []


def test_replace(tmp_path, served, name):
    old, new, broken = (tmp_path / f"{each}.csv" for each in ("old", "new", "broken"))
    old.write_text("x,y\n100,100\n")
    new.write_text(COMMA)
    broken.write_text(COMMA + "7,oops\n")
    with HullClient(served) as client:
        assert dynhull("load", name, old).exit_code == 0
        uid = client.get_hull(name).info.uid
        for refused in ([broken, "--max-bad", 0], [tmp_path / "none.csv"], ["-"]):
            assert dynhull("load", name, *refused, "--replace", input=COMMA).exit_code == 2
            assert client.get_hull(name).info.uid == uid
        for _ in range(2):
            done = dynhull("load", name, new, "--replace")
            assert (done.exit_code, done.stdout) == (0, f"{name}: 3 points loaded, 3 in the hull\n"), done.stderr
            assert client.get_hull(name).vertices.tolist() == TRIANGLE
        assert dynhull("load", f"{name}-new", new, "--replace").exit_code == 0
