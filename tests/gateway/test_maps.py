"""OGC API Features: what the standard demands, and what GDAL reads."""

import json
import subprocess
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from pathlib import Path
from urllib.parse import quote, urlsplit

import pytest
from gateway_process import Gateway, gateway_process
from pacing import pause
from peers import program
from server_process import server_process

from dynhull_client import HullClient

KEYS = [f"v{number:03}" for number in range(250)]
PLACES = [[5 + number % 25, 45 + number // 25] for number in range(250)]
DAYS = [f"2026-01-{1 + number % 28:02}T00:00:00Z" for number in range(250)]


@pytest.fixture(scope="module")
def fleet(gateway: Gateway) -> str:
    gateway.post("/hulls", {"name": "maps/fleet", "keyed": "str", "geographic": True, "ordering": "event_time"})
    put = {"keys": KEYS, "points": PLACES, "times": DAYS}
    assert gateway.post("/hulls/maps%2Ffleet/points", put).status == 200
    return "maps/fleet"


def items(gateway: Gateway, collection: str, query: str = "") -> dict:
    return gateway.get(f"/collections/{quote(collection, safe='')}/items{query}").json


def link(document: dict, rel: str) -> str | None:
    return next((each["href"] for each in document["links"] if each["rel"] == rel), None)


def test_from_the_landing_page_to_the_features(gateway: Gateway, fleet: str) -> None:
    landing = gateway.get("/").json
    assert {"self", "service-desc", "conformance", "data"} <= {each["rel"] for each in landing["links"]}
    conformance = gateway.get(urlsplit(link(landing, "conformance")).path).json
    assert "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/core" in conformance["conformsTo"]
    collections = gateway.get(urlsplit(link(landing, "data")).path).json["collections"]
    found = {each["id"]: each for each in collections}
    path = urlsplit(link(found[f"entities:{fleet}"], "items")).path
    answer = gateway.get(path)
    assert answer.headers["Content-Type"] == "application/geo+json"
    assert answer.json["numberMatched"] == 250
    described = gateway.get(path.removesuffix("/items")).json
    ((west, south, east, north),) = described["extent"]["spatial"]["bbox"]
    assert (west, south, east, north) == (
        5,
        45,
        29,
        pytest.approx(54.6, abs=0.1),
    )  # the great circle between two corners
    one = gateway.get(f"{path}/v001").json
    assert (one["geometry"]["coordinates"], one["properties"]["time"]) == ([6, 45], "2026-01-02T00:00:00.000000Z")
    assert gateway.get(f"{path}/v999").status == 404


def test_pages_have_every_feature_once(gateway: Gateway, fleet: str) -> None:
    page = items(gateway, f"entities:{fleet}", "?limit=100")
    gateway.post("/hulls/maps%2Ffleet/points", {"keys": ["v0000"], "points": [[6, 46]], "times": DAYS[:1]})
    found = [each["id"] for each in page["features"]]
    while (following := link(page, "next")) is not None:
        parts = urlsplit(following)
        page = gateway.get(f"{parts.path}?{parts.query}").json
        found += [each["id"] for each in page["features"]]
    assert found == KEYS
    gateway.post("/hulls/maps%2Ffleet/points", {"remove": ["v0000"]})


def test_times_reach_the_past_of_a_hull_that_keeps_it(tmp_path: Path) -> None:
    """In pages of one revision; with tokens it needs the right to read the past."""
    tokens = tmp_path / "tokens.toml"
    tokens.write_text(
        "".join(
            f'[[token]]\nsha256 = "{sha256(name.encode()).hexdigest()}"\nread = [""]\nwrite = [""]\n{more}\n'
            for name, more in (("all", 'past = [""]'), ("now", ""))
        )
    )
    options = "--data", str(tmp_path / "data"), "--tokens", str(tokens)
    bearer = {"Authorization": "Bearer all"}
    with server_process(*options, complaints=None) as server, HullClient(server.address, token="all") as client:
        client.create_hull("kept", keyed="str", geographic=True, history="1d")
        client.create_hull("brief", keyed="str", geographic=True)
        moments = []
        for number in range(3):
            for name in ("kept", "brief"):
                client.put(name, KEYS[:20], [(number, 50)] * 20)
            info = client.get_hull("kept").info
            moments.append(info.changed.isoformat().replace("+00:00", "Z"))
        early = (info.created - timedelta(days=1)).isoformat().replace("+00:00", "Z")
        with gateway_process(server.address) as gateway:

            def places(name: str, when: str) -> set[float]:
                found, path = [], f"/collections/entities:{name}/items?limit=8&datetime={when}"
                while path is not None:
                    page = gateway.get(path, **bearer).json
                    found += page["features"]
                    following = link(page, "next")
                    path = None if following is None else following.removeprefix(gateway.url)
                assert len(found) in (0, 20)
                return {each["geometry"]["coordinates"][0] for each in found}

            assert [places("kept", each) for each in moments] == [{0}, {1}, {2}]
            assert [places("kept", f"{early}/{each}") for each in moments] == [{0}, {1}, {2}]
            assert (places("kept", f"{early}/.."), places("kept", early)) == ({2}, set())
            assert places("kept", f"{moments[0]}/2999-01-01T00:00:00Z") == {2}
            assert places("brief", moments[0]) == {2}
            extent = gateway.get("/collections/entities:kept", **bearer).json["extent"]["temporal"]
            assert extent["interval"] == [[client.history("kept").first_time.isoformat().replace("+00:00", "Z"), None]]
            assert "temporal" not in gateway.get("/collections/entities:brief", **bearer).json["extent"]
            pause(1.001 - datetime.now(UTC).microsecond / 1e6)  # GDAL asks for the whole second before a time
            between = datetime.now(UTC).isoformat(timespec="milliseconds")
            client.put("kept", KEYS[:20], [(3, 50)] * 20)
            read = [
                program("ogrinfo"),
                "-al",
                f"OAPIF:{gateway.url}",
                "entities:kept",
                "-where",
                f"time <= '{between}'",
            ]
            known = ["--config", "GDAL_HTTP_HEADERS", "Authorization: Bearer all"]
            shown = subprocess.run([*read, *known], capture_output=True, text=True, check=True, timeout=60).stdout
            assert shown.count("POINT (2 50)") == 20
            for when, status in ((moments[0], 403), (f"{moments[0]}/..", 200)):
                path = f"/collections/entities:kept/items?datetime={when}"
                assert gateway.get(path, Authorization="Bearer now").status == status


def test_boxes_and_times(gateway: Gateway, fleet: str) -> None:
    boxed = items(gateway, f"entities:{fleet}", "?bbox=5,45,7,46&limit=99")["features"]
    expected = {key for key, (lon, lat) in zip(KEYS, PLACES, strict=True) if lon <= 7 and lat <= 46}
    assert {each["id"] for each in boxed} == expected
    assert items(gateway, f"entities:{fleet}", "?bbox=40,45,0,41,50,9")["numberMatched"] == 0
    assert items(gateway, f"entities:{fleet}", "?bbox=25,45,10,54")["numberMatched"] == 110
    for interval, days in (
        ("2026-01-03T00:00:00Z", {3}),
        ("../2026-01-02T12:00:00Z", {1, 2}),
        (f"{DAYS[26]}/", {27, 28}),
    ):
        found = items(gateway, f"entities:{fleet}", f"?datetime={interval}&limit=999")["features"]
        assert {int(each["properties"]["time"][8:10]) for each in found} == days
    assert fleet in [each["id"] for each in items(gateway, "hulls", "?bbox=0,40,40,60&limit=1000")["features"]]
    assert fleet not in [each["id"] for each in items(gateway, "hulls", "?bbox=-40,40,-20,60&limit=1000")["features"]]


@pytest.fixture(scope="module")
def ships(gateway: Gateway) -> str:
    """Keys on both sides of the antimeridian and upon it, in all ways to write them, and a hull without any."""
    gateway.post("/hulls", {"name": "maps/ships", "keyed": "str", "geographic": True})
    gateway.post("/hulls", {"name": "maps/none", "keyed": "str", "geographic": True})
    keys, longitudes = ["180", "-180", "190", "-170", "-190", "170"], [180, -180, 190, -170, -190, 170]
    points = [(lon, -10 - row) for row, lon in enumerate(longitudes)]
    gateway.post("/hulls/maps%2Fships/points", {"keys": keys, "points": points})
    return "maps/ships"


@pytest.mark.parametrize(
    ("box", "inside"),
    [
        ("165,-20,180,0", {"180", "-180", "-190", "170"}),
        ("-180,-20,-165,0", {"180", "-180", "190", "-170"}),
        ("165,-20,-165,0", {"180", "-180", "190", "-170", "-190", "170"}),
        ("165,-20,195,0", {"180", "-180", "190", "-170", "-190", "170"}),
        ("-195,-20,-175,0", {"180", "-180", "-190", "170"}),
        ("175,-20,185,0", {"180", "-180"}),
        ("185,-20,195,0", {"190", "-170"}),
        ("-175,-20,-165,0", {"190", "-170"}),
        ("-360,-90,0,90", {"180", "-180", "190", "-170", "-190", "170"}),
        ("0,-20,10,0", set()),
    ],
)
def test_boxes_about_the_antimeridian(gateway: Gateway, ships: str, box: str, inside: set[str]) -> None:
    assert {each["id"] for each in items(gateway, f"entities:{ships}", f"?bbox={box}")["features"]} == inside
    hulls = {each["id"] for each in items(gateway, "hulls", f"?bbox={box}&limit=1000")["features"]}
    assert (ships in hulls) == bool(inside)
    assert "maps/none" in hulls  # what is nowhere is on all pages


def test_places_are_within_the_range_of_crs84(gateway: Gateway, ships: str) -> None:
    found = items(gateway, f"entities:{ships}")["features"]
    longitudes = {each["id"]: each["geometry"]["coordinates"][0] for each in found}
    assert longitudes == {"180": 180, "-180": -180, "190": -170, "-170": -170, "-190": 170, "170": 170}
    one = gateway.get(f"/collections/{quote(f'entities:{ships}', safe='')}/items/190").json
    assert one["geometry"]["coordinates"][0] == -170


def test_a_leap_second_is_a_time(gateway: Gateway, fleet: str) -> None:
    found = items(gateway, f"entities:{fleet}", "?datetime=2016-12-31T23:59:60Z/2026-01-02T12:00:00Z&limit=999")
    assert {each["properties"]["time"][8:10] for each in found["features"]} == {"01", "02"}


def test_a_page_of_a_revision_that_is_gone_is_refused(gateway: Gateway, address: str, name: str) -> None:
    """Pages of several revisions could have a key at two places, or one that left and another that came."""
    collection = f"entities:{name}"
    gateway.post("/hulls", {"name": name, "keyed": "str", "geographic": True})
    gateway.post(f"/hulls/{name}/points", {"keys": ["a", "b", "c"], "points": [[0, 0], [1, 0], [1, 1]]})
    page = items(gateway, collection, "?limit=1&bbox=-1,-1,2,2")
    assert link(page, "self").endswith("/items?bbox=-1%2C-1%2C2%2C2&limit=1")
    following = urlsplit(link(page, "next"))
    again = f"{following.path}?{following.query}"
    gateway.post(f"/hulls/{name}/points", {"remove": ["b"]})
    assert [each["id"] for each in gateway.get(again).json["features"]] == ["b"]
    with gateway_process(address) as other:  # which has not read that revision
        gone = other.get(again)
        assert (gone.status, gone.json["field"]) == (410, "revision")
        first = urlsplit(link(items(other, collection, "?limit=1"), "next"))
        assert gateway.get(f"{first.path}?{first.query}").json["features"][0]["id"] == "c"  # of the present revision
    gateway.call("DELETE", f"/hulls/{name}")
    gateway.post("/hulls", {"name": name, "keyed": "str", "geographic": True})
    for _ in range(2):
        gateway.post(f"/hulls/{name}/points", {"keys": ["x", "y"], "points": [[0, 0], [1, 0]]})
    assert gateway.get(f"{first.path}?{first.query}").status == 410  # the same number, of another hull


@pytest.mark.parametrize(
    "query",
    [
        "bbox=1,2,3",
        "bbox=1,9,2,3",
        "bbox=a,b,c,d",
        "bbox=500,-20,600,0",
        "bbox=0,-100,10,95",
        "datetime=2016-12-31T23:61:60Z",
        "datetime=now",
        "datetime=../..",
        "limit=0",
        "unknown=1",
        "revision=aa:1",
    ],
)
def test_bad_parameters(gateway: Gateway, fleet: str, query: str) -> None:
    refused = gateway.get(f"/collections/hulls/items?{query}")
    assert (refused.status, refused.json["field"]) == (400, query.partition("=")[0]), fleet
    assert "^" not in refused.json["detail"]  # words, no regular expression


def test_hulls_of_a_plane_are_no_collections(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    refused = gateway.get(f"/collections/{quote(f'entities:{name}', safe='')}/items").json
    assert (refused["status"], refused["reason"]) == (404, "NOT_GEOGRAPHIC")
    assert f"/hulls/{name}" in refused["detail"]
    assert name not in [each["id"] for each in items(gateway, "hulls")["features"]]


def test_hulls_without_keys_have_no_entities(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "geographic": True})
    collection = f"/collections/{quote(f'entities:{name}', safe='')}"
    for path in ("", "/items", "/items/a", "/schema"):
        refused = gateway.get(collection + path).json
        assert (refused["status"], refused["reason"]) == (404, "NOT_KEYED")
    assert f"entities:{name}" not in [each["id"] for each in gateway.get("/collections").json["collections"]]


def test_gdal_knows_times_that_the_first_features_lack(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str", "geographic": True})
    gateway.post(f"/hulls/{name}/points", {"keys": ["a"], "points": [[1, 1]]})
    gateway.post(f"/hulls/{name}/points", {"keys": ["b"], "points": [[1, 2]], "times": DAYS[:1]})
    # It reads types from its first page, unless there is a schema.
    read = [program("ogrinfo"), "-al", "-oo", "PAGE_SIZE=1", f"OAPIF:{gateway.url}", f"entities:{name}"]
    shown = subprocess.run(read, capture_output=True, text=True, check=True, timeout=60).stdout
    assert "time (DateTime) = 2026/01/01 00:00:00+00" in shown
    described = gateway.get(f"/collections/{quote(f'entities:{name}', safe='')}").json
    schema = gateway.get(urlsplit(link(described, "describedby")).path)
    assert schema.headers["Content-Type"] == "application/schema+json"
    assert schema.json["properties"]["properties"]["properties"]["time"]["format"] == "date-time"
    assert "time" not in items(gateway, f"entities:{name}")["features"][0]["properties"]


def test_gdal_reads_a_live_hull(gateway: Gateway, address: str, fleet: str, tmp_path: Path) -> None:
    source = f"OAPIF:{gateway.url}"
    layer = f"entities:{fleet}"
    shown = subprocess.run(
        [program("ogrinfo"), "-so", source, layer], capture_output=True, text=True, check=True, timeout=60
    ).stdout
    for each in ("Geometry: Point", "Feature Count: 250", "Extent: (5.000000, 45.000000) - (29.000000, 54.000000)"):
        assert each in shown
    found = {}
    for name in (layer, "hulls"):
        out = tmp_path / f"{name[:5]}.geojson"
        read = [program("ogr2ogr"), "-f", "GeoJSON", out, source, name, "--config", "OGR_OAPIF_PAGE_SIZE", "100"]
        subprocess.run(read, check=True, timeout=60, capture_output=True)
        found[name] = json.loads(out.read_text())["features"]
    assert len(found[layer]) == 250
    (hull,) = [each for each in found["hulls"] if each["properties"]["name"] == fleet]
    with HullClient(address) as client:
        expected = client.get_hull(fleet).__geo_interface__["geometry"]["coordinates"]
    assert [list(map(tuple, ring)) for ring in hull["geometry"]["coordinates"]] == [
        [tuple(each) for each in ring] for ring in expected
    ]
