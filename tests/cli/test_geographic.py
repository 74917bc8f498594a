"""Geographic hulls from the command line."""

import csv
import json
import re
from itertools import count

import numpy as np
import pytest
from command_line import dynhull
from odd_places import NO_PLACES, TAKEN, TOO_FAR

from dynhull_client import HullClient

FIJI = "lon,lat,key\n177.4,-17.8,Nadi\n178.4,-18.1,Suva\n-179.9,-16.8,Taveuni\n179.4,-16.4,Labasa\n"


@pytest.fixture
def fiji(tmp_path):
    file = tmp_path / "fiji.csv"
    file.write_text(FIJI)
    return file


def run(*arguments, code=0):
    done = dynhull(*arguments)
    assert done.exit_code == code, done.stderr
    return done


def listed(name):
    return json.loads(run("list", name, "--json").stdout)


@pytest.mark.usefixtures("served")
def test_a_new_hull_of_lon_and_lat_is_on_the_globe_and_load_says_so(name, fiji):
    done = run("load", name, fiji)
    assert done.stderr.splitlines()[0] == (
        f"{name}: a new hull on the globe: lon and lat are degrees; --plane makes it a plane"
    )
    info = listed(name)
    assert (info["geographic"], info["points"]) == (True, 4)
    assert info["center"] == pytest.approx([178.8, -17.3], abs=0.1)
    area = json.loads(run("measure", name, "--json").stdout)["area"]
    assert area == pytest.approx(21.1e9, rel=0.01)
    assert run("query", name, "locate", "--", "179,-17", "0,-17").stdout.split()[2::3] == ["inside", "outside"]
    again = run("load", name, fiji, "--again")
    assert "new hull" not in again.stderr
    assert "plane" not in again.stderr


@pytest.mark.parametrize("columns", ["lng,lat", "Longitude,LATITUDE", "long,lat"])
@pytest.mark.usefixtures("served")
def test_other_names_of_longitude_and_latitude(name, tmp_path, columns):
    for suffix, text in (("csv", f"{columns}\n1,2\n"), ("ndjson", json.dumps(dict.fromkeys(columns.split(","), 1)))):
        file = tmp_path / f"points.{suffix}"
        file.write_text(text)
        run("load", f"{name}-{suffix}", file)
        assert listed(f"{name}-{suffix}")["geographic"]


def collection(points, **more):
    shapes = [{"type": "Point", "coordinates": each} for each in points]
    features = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in shapes]
    return json.dumps({"type": "FeatureCollection", **more, "features": features})


def crs(name):
    return {"crs": {"type": "name", "properties": {"name": name}}}


PORTS = [[179, -17], [-179, -17], [180, -16]]
WHERE = [{"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": each}} for each in PORTS]


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("a.geojson", collection(PORTS)),
        ("a.geojson", collection(PORTS, **crs("urn:ogc:def:crs:OGC:1.3:CRS84"))),
        ("a.json", collection(PORTS)),
        ("a.json", json.dumps(WHERE)),
        ("a.json", json.dumps({"type": "MultiPoint", "coordinates": PORTS}, indent=1)),
        ("a.ndjson", "\n".join(map(json.dumps, WHERE))),
    ],
)
@pytest.mark.usefixtures("served")
def test_geojson_is_on_the_globe(name, tmp_path, file, text):
    path = tmp_path / file
    path.write_text(text)
    done = run("load", name, path, "--vertices")
    assert f"{name}: a new hull on the globe: longitude and latitude are degrees; --plane" in done.stderr
    info = listed(name)
    assert (info["geographic"], info["points"]) == (True, 3)
    assert info["center"] == pytest.approx([-180, -16.7], abs=0.1)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"crs": None}, "its crs names no coordinate reference system: --geographic reads degrees"),
        (crs("urn:ogc:def:crs:EPSG::3857"), "coordinates are not degrees: its crs is WGS 84 / Pseudo-Mercator"),
    ],
    ids=["null", "3857"],
)
@pytest.mark.usefixtures("served")
def test_geojson_with_another_reference_system_is_a_plane(name, tmp_path, more, said):
    path = tmp_path / "metres.geojson"
    path.write_text(collection([[20_000_000, -1_900_000], [20_000_100, -1_900_000]], **more))
    done = run("load", name, path)
    assert said in done.stderr
    assert (listed(name)["geographic"], listed(name)["points"]) == (False, 2)


@pytest.mark.usefixtures("served")
def test_a_plane_that_gets_geojson_is_warned_about_once(name, tmp_path):
    path = tmp_path / "ports.geojson"
    path.write_text(collection(PORTS))
    run("create", name)
    done = run("load", name, path)
    assert done.stderr.count(f"{name} is a plane: it takes longitude and latitude for x and y") == 1


@pytest.mark.usefixtures("served")
def test_a_plane_on_request_and_for_other_columns(name, fiji, tmp_path):
    done = run("load", f"{name}-a", fiji, "--plane")
    assert (
        f"{name}-a: a new hull in the plane, in square degrees; --geographic makes it one on the globe" in done.stderr
    )
    assert listed(f"{name}-a")["geographic"] is False
    file = tmp_path / "points.csv"
    file.write_text("x,y\n1,2\n")
    silent = run("load", f"{name}-b", file)
    assert "globe" not in silent.stderr
    assert listed(f"{name}-b")["geographic"] is False
    run("load", f"{name}-c", file, "--geographic")
    assert listed(f"{name}-c")["geographic"]


@pytest.mark.usefixtures("served")
def test_a_plane_that_gets_longitudes_and_latitudes_is_warned_about_once(name, fiji):
    run("create", name)
    done = run("load", name, fiji)
    assert done.stderr.count("is a plane: it takes lon and lat for x and y") == 1
    refused = run("load", name, fiji, "--again", "--geographic", code=2)
    assert f"the hull '{name}' is a plane: leave out --geographic" in refused.stderr


@pytest.mark.usefixtures("served")
def test_places_all_over_the_globe_are_bad_rows_with_advice(name, tmp_path):
    file = tmp_path / "world.csv"
    file.write_text("lon,lat\n" + "".join(f"{lon},0\n" for lon in range(-180, 180, 10)))
    for options, code in ((["--max-bad", "3"], 2), (["--resume"], 0)):
        done = run("load", name, file, *options, code=code)
        assert "degrees from the centre" in done.stderr
        assert "--replace --plane loads degrees as points of a plane" in done.stderr
    run("load", name, file, "--replace", "--plane")


@pytest.mark.usefixtures("served")
def test_create_and_recenter(name):
    run("create", name, "--geographic", "--center", "190,-17.5")
    info = listed(name)
    assert (info["geographic"], info["center"]) == (True, [-170, -17.5])
    assert run("list", name).stdout.split("\t")[-1] == "globe -170,-17.5\n"
    assert run("recenter", name, "--", "180,-20").stdout == f"{name}: about -180,-20, revision 1\n"
    moved = json.loads(run("recenter", name, "--json", "--", "-175,5").stdout)
    assert moved == {"name": name, "revision": 2, "center": [-175, 5]}
    assert "only a geographic" not in run("create", name, "--geographic", "--exist-ok").stderr
    for options, words in (
        (["--center", "1,2"], "--center is given with --geographic"),
        (["--geographic", "--center", "1"], "give LON,LAT"),
        (["--geographic", "--center", "1,95"], "from -90 to 90"),
    ):
        assert words in run("create", f"{name}-x", *options, code=2).stderr
    assert "no points to choose a centre from" in run("recenter", name, code=1).stderr


@pytest.mark.usefixtures("served")
def test_keys_on_the_globe(name, fiji):
    run("load", name, fiji, "--key", "key")
    assert {line.split("\t")[2] for line in run("query", name, "--keys").stdout.splitlines()} == {
        *("Nadi", "Suva", "Taveuni", "Labasa")
    }
    run("put", name, "Suva", "178.4", "-18.2")
    refused = run("put", name, "Paris", "2.3", "48.9", code=2)
    assert "degrees from the centre" in refused.stderr
    assert "verified" in run("verify", name).stdout


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize("suffix", ["csv", "ndjson"])
def test_rows_that_are_no_places_are_left_out(name, tmp_path, suffix):
    file = tmp_path / f"points.{suffix}"
    rows = [(1, 2), (52.5, 113.4), (3, 4), (361, 0), (5, 6)]
    if suffix == "csv":
        file.write_text("lon,lat\n" + "".join(f"{lon},{lat}\n" for lon, lat in rows))
    else:
        file.write_text("\n".join(json.dumps({"lon": lon, "lat": lat}) for lon, lat in rows))
    done = run("load", name, file)
    assert "2 bad rows" in done.stderr
    first = 2 if suffix == "csv" else 1
    assert (
        f"line {first + 1}: the latitude is 113.4, not from -90 to 90 degrees; the longitude comes first" in done.stderr
    )
    assert f"line {first + 3}: the longitude is 361.0, not from -360 to 360 degrees" in done.stderr
    assert listed(name)["points"] == 3
    known = run("load", name, file, "--again", "--key", "lon", code=2) if suffix == "csv" else None
    assert known is None or "have no keys" in known.stderr
    plain = tmp_path / "plain.csv"
    plain.write_text("x,y\n7,8\n9,95\n")
    assert "line 3: the latitude is 95.0" in run("load", name, plain).stderr  # the hull is on the globe
    run("load", f"{name}-plane", plain)
    assert listed(f"{name}-plane")["points"] == 2


@pytest.mark.usefixtures("served")
def test_odd_places_are_refused_and_change_nothing(name):
    run("create", name, "--geographic", "--center", "0,0")
    run("create", f"keyed-{name}", "--keyed", "str", "--geographic", "--center", "0,0")
    far = [(place, rf"{angle} degrees from the centre \(0\.0, 0\.0\)") for place, angle in TOO_FAR[:2]]
    for (lon, lat), words in [*NO_PLACES[::3], *far]:
        pair = f"{lon},{lat}"
        for command in (
            ["insert", name, "--", "1,2", pair],
            ["put", f"keyed-{name}", "--", "a", str(lon), str(lat)],
        ):
            assert re.search(words, run(*command, code=2).stderr), command
        if "from the centre" not in words:
            for command in (
                ["query", name, "locate", "--", "1,2", pair],
                ["recenter", name, "--", pair],
                ["create", f"{name}-new", "--geographic", "--center", pair],
            ):
                assert re.search(words, run(*command, code=2).stderr), command
    assert (listed(name)["points"], listed(name)["center"]) == (0, [0, 0])
    assert listed(f"keyed-{name}")["points"] == 0
    places = [f"{lon},{lat}" for (lon, lat), _ in TAKEN]
    run("insert", name, "--", *places)
    assert listed(name)["points"] == len(TAKEN)


@pytest.mark.parametrize("keyed", [False, True])
def test_a_place_that_the_hull_does_not_reach_is_a_bad_row(served, name, tmp_path, keyed):
    """Two batches, two such rows in the first, one in the second; killed trackers send (0, 0)."""
    rng = np.random.default_rng(44)
    rows = [
        f"v{row},{lon:.5f},{lat:.5f}" for row, (lon, lat) in enumerate(rng.uniform((177, -19), (179, -16), (9000, 2)))
    ]
    bad = {5: "x,0,0", 17: "y,1,0", 8700: "z,0,0"}
    for row, text in bad.items():
        rows[row] = text
    file, kept = tmp_path / "fiji.csv", tmp_path / "bad.csv"
    file.write_text("id,lon,lat\n" + "\n".join(rows) + "\n")
    key = ["--key", "id"] if keyed else []
    dry = run("load", name, file, "--dry-run", *key)
    assert dry.stdout.startswith(f"{name}: 8,997 points would be loaded")
    refused = run("load", name, file, "--max-bad", "1", *key, code=2)
    assert "more than 1 bad row (--max-bad)" in refused.stderr
    run("delete", name, "--yes")
    done = run("load", name, file, "--bad-rows", kept, *key)
    assert done.stdout == f"{name}: 8,997 points loaded, 8,997 in the hull\n"
    for said in (dry, done):
        places = [line for line in said.stderr.splitlines() if line.startswith("  line")]
        assert [line.split(":")[0] for line in places] == ["  line 7", "  line 19", "  line 8702"]
        assert all("degrees from the centre" in line for line in places)
    written = list(csv.DictReader(kept.read_text().splitlines()))
    texts = ["0.0,0.0", "1.0,0.0", "0.0,0.0"]
    assert (
        [each["row"] for each in written] == [f"{a},{b}" for a, b in zip(texts, "xyz", strict=True)] if keyed else texts
    )
    again = run("load", name, file, "--resume", *key)
    assert again.stdout == f"{name}: 0 points loaded\n"
    with HullClient(served) as client:
        assert client.get_hull(name).revision == 2


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize(
    "columns",
    [
        "GPS_LON,GPS_LAT",
        "gpsLat,gpsLng",
        "Latitude (deg),Longitude (deg)",
        "lat_dd,lon_dd",
        "Position.Lon,Position.Lat",
    ],
)
def test_names_that_people_give_longitudes_and_latitudes(name, tmp_path, columns):
    file = tmp_path / "points.csv"
    file.write_text(f"{columns},id\n13.4,52.5,a\n13.5,52.4,b\n")
    run("load", name, file)
    assert listed(name)["geographic"]
    x, y = sorted(columns.split(","), key=lambda each: "lat" in each.lower())
    run("load", f"{name}-b", file, "--x", x, "--y", y)
    assert listed(f"{name}-b")["geographic"]


LIKE_DEGREES = "is a plane, and its points look like longitudes and latitudes"


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("a,b\n13.4,52.5\n", ["--x", "a", "--y", "b"], LIKE_DEGREES),
        ("13.4,52.5\n13.5,52.4\n", [], LIKE_DEGREES),
        ("E,N\n13.4,52.5\n", [], LIKE_DEGREES),
        (
            "lat,lon\n52.5,13.4\n",
            ["--x", "lat", "--y", "lon"],
            "takes lat for x and lon for y: the longitude comes first",
        ),
        ("x,y\n13.4,52.5\n", [], None),
        ("a,b\n13.4,52.5\n", ["--x", "a", "--y", "b", "--plane"], None),
        ("a,b\n13.4,52.5\n", ["--x", "a", "--y", "b", "--geographic"], None),
        ("E,N\n392000.5,5820000.25\n", [], None),
        ("0.25,0.5\n0.75,0.5\n", [], None),
        ("13,52\n14,53\n", [], None),
        ("a,b\n52.5,113.4\n", ["--x", "a", "--y", "b"], None),
    ],
    ids=count(),
)
def test_points_of_a_plane_that_look_like_degrees_are_remarked_on(name, tmp_path, text, options, said):
    file = tmp_path / "points.csv"
    file.write_text(text)
    done = run("load", name, file, *options, "--json")
    assert json.loads(done.stdout)["name"] == name
    found = [line for line in done.stderr.splitlines() if LIKE_DEGREES in line or "comes first" in line]
    assert len(found) == (said is not None), done.stderr
    assert said is None or f"{name} {said}" in found[0]


@pytest.mark.usefixtures("served")
def test_put_and_circles_remark_on_degrees_in_a_plane(name):
    run("create", name, "--keyed", "str")
    first = run("put", name, "a", "13.4", "52.5", "--json")
    assert f"{name} {LIKE_DEGREES}" in first.stderr
    assert json.loads(first.stdout)["points"] == 1
    assert run("put", name, "b", "13.5", "52.5").stderr == ""  # it has been said
    circle = run("fences", "create", name, "--circle", "13.4", "52.5", "20000", "--subjects", name, "--json")
    assert "is in the plane, where 20000 is in the units of x and y" in circle.stderr
    json.loads(circle.stdout)
    assert run("fences", "create", f"{name}/a", "--circle", "13", "52", "2", "--subjects", name).stderr == ""
    run("create", f"{name}-globe", "--keyed", "str", "--geographic")
    assert run("put", f"{name}-globe", "a", "13.4", "52.5").stderr == ""
    globe = "fences", "create", f"{name}/b", "--circle", "13.4", "52.5", "20000", "--subjects", f"{name}-globe"
    assert run(*globe).stderr == ""
    run("create", f"{name}-floor", "--keyed", "str")
    assert run("put", f"{name}-floor", "a", "1340.5", "52.5").stderr == ""
