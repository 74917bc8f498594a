"""What dynhull writes of a hull around a pole, every way reads as the area of a fence."""

import json

import numpy as np
import pytest
from command_line import dynhull as command
from gateway_process import Gateway

import dynhull
from dynhull_client import HullClient, InvalidRequestError, Polygon

# Counter-clockwise around the south pole; a corner of the first is on the antimeridian.
RINGS = [
    [(0.0, -70.0), (-90.0, -69.0), (180.0, -71.0), (90.0, -72.0)],
    [(0.0, -70.0), (-90.0, -69.0), (170.0, -71.0), (90.0, -72.0)],
]
PLACES = np.random.default_rng(6).uniform([-180, -90], [180, -60], (400, 2))
ON_SEAM = [(180.0, -80.0), (-180.0, -75.0), (0.0, -90.0), (180.0, -71.0)]


@pytest.fixture
def fleet(address: str, name: str):
    with HullClient(address) as client:
        client.create_hull(name, keyed="str", geographic=True, center=(0, -90))
        keys = [f"k{number}" for number in range(len(PLACES))] + list("abcd")
        client.put(name, keys, [*PLACES.tolist(), *ON_SEAM])
        yield client


@pytest.mark.parametrize("ring", RINGS, ids=["corner", "crossing"])
@pytest.mark.parametrize("north", [False, True], ids=["south", "north"])
def test_an_area_around_a_pole(fleet: HullClient, name: str, ring, north: bool) -> None:
    sign = [1, -1] if north else [1, 1]
    arctic = f"{name}/other"
    found = fleet.entities(name)
    fleet.create_hull(arctic, keyed="str", geographic=True, center=(0, 90 if north else -90))
    fleet.put(arctic, found.keys, found.points * sign)
    hull = dynhull.GeoHull(np.array(ring) * sign)
    for boundary in "closed", "open":
        for area, word in (hull.geojson(), "own"), (Polygon(hull.vertices()), "plain"):
            fence = fleet.create_fence(f"{name}/{word}/{boundary}", area=area, subjects=arctic, boundary=boundary)
            assert fence.inside > 50
        own, plain = (
            {key for hull in fleet.fence_inside(f"{name}/{word}/{boundary}").subjects for key in hull.keys}
            for word in ("own", "plain")
        )
        assert own == plain
        assert {"a", "b", "c"} <= own
        assert ("d" in own) == (boundary == "closed" and ring is RINGS[0])
    assert fleet.verify(arctic).whole


def test_every_way_takes_it(fleet: HullClient, gateway: Gateway, name: str, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("DYNHULL_ADDRESS", fleet.address)
    area = dynhull.GeoHull(RINGS[1]).geojson()
    fleet.create_fence(f"{name}/sdk", area=area, subjects=name)
    file = tmp_path / "ice.geojson"
    file.write_text(json.dumps(area))
    done = command("fences", "create", f"{name}/command", "--polygon", file, "--subjects", name)
    assert done.exit_code == 0, done.stderr
    answer = gateway.post("/fences", {"name": f"{name}/http", "area": {**area, "bbox": [0]}, "subjects": name})
    assert answer.status == 201, answer.json
    inside = {way: fleet.get_fence(f"{name}/{way}").inside for way in ("sdk", "command", "http")}
    assert set(inside.values()) == {inside["sdk"]}
    corners = area["coordinates"][0]
    far, flat = [[0, 1], [1, 1], [1, 0]], [[0, -80], [9, -80], [0, -85], [9, -85]]
    for kind, coordinates, pointers in (
        ("Polygon", [flat], ["/area/coordinates/0"]),
        ("MultiPolygon", [[corners], [corners, far]], ["/area/coordinates/1/1"]),
        ("MultiPolygon", [[[*corners, [1, "a"]]]], []),
        ("Polygon", [[1]], []),
        ("MultiPolygon", [1], []),
        ("Polygon", [], ["/area"]),
        ("Polygon", {}, ["/area/coordinates"]),
        ("Point", [1, 2], ["/area/type"]),
    ):
        given = {"type": kind, "coordinates": coordinates}
        answer = gateway.post("/fences", {"name": f"{name}/wrong", "area": given, "subjects": name})
        found = [each["pointer"] for each in answer.json.get("errors", [])]
        assert (answer.status, found) == (400, pointers), answer.json


def test_it_is_what_it_says_in_the_plane_and_elsewhere(fleet: HullClient, name: str) -> None:
    area = dynhull.GeoHull(RINGS[0]).geojson()
    fleet.create_hull(f"{name}/plane", keyed="str")
    fence = fleet.create_fence(f"{name}/flat", area=area, subjects=f"{name}/plane")
    fleet.put(f"{name}/plane", ["a", "b"], [(180, -80), (0, -69)])
    assert fleet.get_fence(fence.name).inside == 1  # the way along the border is boundary
    spike = [(0, -70), (-90, -69), (170, -71), (170, -90), (170, -71), (90, -72)]
    with pytest.raises(InvalidRequestError, match="overlap"):
        fleet.create_fence(f"{name}/spike", area=spike, subjects=name)
