"""Geographic hulls from outside: degrees in and out, metres, refusals with row and reason, restarts."""

import json

import grpc
import numpy as np
import pytest
from cases import RESTARTS
from command_line import dynhull as command
from odd_places import NO_PLACES, TAKEN, TOO_FAR
from patience import PATIENCE
from refusal import refusal
from server_process import server_process

import dynhull
from dynhull_client import HullClient, HullCopy, HullExistsError, HullUnsuitableError, InvalidRequestError
from dynhull_proto.v1 import batch_pb2, hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

FIJI = [(177.4, -17.8), (178.4, -18.1), (-179.9, -16.8), (179.4, -16.4), (179.0, -17.2)]
POLE = [(lon, -75.0 - lon % 7) for lon in range(0, 360, 20)]
AFRICA = (20.0, 0.0)


@pytest.fixture
def fiji(client, name):
    client.create_hull(name, geographic=True)
    client.apply(name, insert=FIJI)
    return name


def test_a_hull_across_180_degrees_answers_as_the_library(client, fiji):
    hull = dynhull.GeoHull(FIJI)
    found = client.get_hull(fiji)
    np.testing.assert_array_equal(found.vertices, hull.vertices())
    assert (found.info.geographic, found.info.center) == (True, hull.center)
    assert (found.measures.area, found.measures.perimeter) == (hull.area, hull.perimeter)
    assert np.isnan(found.measures.centroid).all()
    assert found.measures.bounds == hull.bounds == (177.4, -18.1, -179.9, -16.4)
    places = np.array([(179, -17), (0, -17), AFRICA, (-179.9, -16.8), (180.1, -16.8), (181, -17)])
    np.testing.assert_array_equal(client.locate(fiji, places).sides, hull.locate(places))
    np.testing.assert_array_equal(client.distance(fiji, places).distances, hull.distance(places))
    np.testing.assert_array_equal(client.tangents(fiji, places[[0, 3, 5]]).tangents, hull.tangents(places[[0, 3, 5]]))
    assert client.count(fiji, [FIJI[2], (180.1, -16.8)]).counts.tolist() == [1, 0]  # one place, written in two ways
    measured = client.get_measures(fiji)
    assert measured.diameter == hull.diameter()
    assert (measured.geographic, measured.bounds, measured.label_point) == (True, hull.bounds, hull.label_point())
    assert np.isnan([measured.width, measured.min_circle[1]]).all()
    assert len(measured.min_box) == len(measured.min_perimeter_box) == 0


def test_the_extreme_vertex_in_a_direction_is_the_last_that_a_great_circle_across_touches(client, name):
    client.create_hull(name, geographic=True, center=(0, 60))
    client.apply(name, insert=[(0, 88), (-70, 60), (80, 55), (0, 20), (5, 61)])
    north_east_south_west = [(0, 1), (1, 0), (0, -1), (-2, 0)]
    found = client.support(name, north_east_south_west).vertices.tolist()
    assert found == [[0, 88], [80, 55], [0, 20], [-70, 60]]


def test_great_circles_enter_and_leave(client, name):
    client.create_hull(name, geographic=True, center=(0, 0))
    client.apply(name, insert=[(-10, -10), (10, -10), (10, 10), (-10, 10)])
    equator, meridian, past = ((-20, 0), (20, 0)), ((0, -20), (0, 20)), ((-20, 40), (20, 40))
    origins, targets = zip(equator, meridian, past, strict=True)
    crossings = client.intersect_lines(name, origins, targets).crossings
    np.testing.assert_allclose(crossings[0], [(-10, 0), (10, 0)], rtol=0, atol=1e-13)
    # The parallel of 10 degrees is no great circle: on the meridian the edge is farther north.
    north = np.degrees(np.arctan(np.tan(np.radians(10)) / np.cos(np.radians(10))))
    np.testing.assert_allclose(crossings[1], [(0, -north), (0, north)], rtol=0, atol=1e-13)
    assert np.isnan(crossings[2]).all()


@pytest.mark.parametrize(
    ("batch", "field", "row", "words"),
    [
        ({"inserts": [(1, 1), (0, 90.5)]}, "batch.inserts", 1, "a latitude is from -90 to 90"),
        ({"inserts": [(52.5, 113.4)]}, "batch.inserts", 0, "the longitude comes first"),
        ({"inserts": [(360.5, 0)]}, "batch.inserts", 0, "a longitude is from -360 to 360"),
        ({"deletes": [(1, 1), (7, 91)]}, "batch.deletes", 1, "a latitude is from -90 to 90"),
        ({"inserts": [(3, 3), (86, 0)]}, "batch.inserts", 1, "86.000000 degrees from the centre (0.0, 0.0)"),
        ({"moves": ([(1, 1)], [(-86, 0)])}, "batch.moves.destinations", 0, "a hull reaches 85 degrees"),
    ],
)
def test_a_place_that_is_none_or_too_far_refuses_the_batch_with_its_row(stub, client, name, batch, field, row, words):
    client.create_hull(name, geographic=True, center=(0, 0))
    client.apply(name, insert=[(1, 1)])
    request = pb.ApplyRequest(name=name)
    for each, points in batch.items():
        if each == "moves":
            origins, destinations = points
            request.batch.moves.origins.coordinates.extend(np.ravel(origins))
            request.batch.moves.destinations.coordinates.extend(np.ravel(destinations))
        else:
            getattr(request.batch, each).coordinates.extend(np.ravel(points))
    code, info, details = refusal(lambda: stub.Apply(request))
    assert (code, info.reason) == (grpc.StatusCode.INVALID_ARGUMENT, "INVALID_FIELD")
    assert (info.metadata["field"], info.metadata["row"]) == (field, str(row))
    assert words in details[0].field_violations[0].description
    info = client.get_hull(name).info
    assert (info.revision, info.points) == (1, 1)


def test_first_points_too_far_apart_choose_no_centre(client, name):
    client.create_hull(name, geographic=True)
    with pytest.raises(InvalidRequestError, match="the mean direction of the first points; a hull reaches 85 degrees"):
        client.apply(name, insert=[(0, 0), (0, 1), (180, 0)])
    assert client.get_hull(name).info.center is None
    client.apply(name, delete=[(5, 5)], missing="count")  # a batch without inserts chooses none
    assert client.get_hull(name).info.center is None
    client.apply(name, insert=[(180, 0)])
    assert client.get_hull(name).info.center == (-180, 0)


def test_questions_about_places_that_are_none_are_refused_with_their_row(client, fiji):
    for question in (client.locate, client.count, client.distance, client.tangents):
        with pytest.raises(InvalidRequestError, match=r"points row 1 is \(0\.0, 91\.0\): a latitude is from -90 to 90"):
            question(fiji, [(0, 0), (0, 91)])
    with pytest.raises(InvalidRequestError, match=r"points row 0 is \(0\.0, 0\.0\): 162\.7\d+ degrees from the centre"):
        client.tangents(fiji, [(0, 0)])
    with pytest.raises(
        InvalidRequestError, match=r"targets row 0 is \(0\.0, 0\.0\): 162\.7\d+ degrees from the centre"
    ):
        client.intersect_lines(fiji, [(179, 0)], [(0, 0)])
    with pytest.raises(InvalidRequestError, match=r"targets row 0 is \(-180\.0, 0\.0\): .* no line"):
        client.intersect_lines(fiji, [(180, 0)], [(-180, 0)])


def test_questions_about_a_plane_are_refused(client, fiji):
    for question in (client.phase_diagram, client.frontier):
        with pytest.raises(HullUnsuitableError, match="is geographic"):
            question(fiji)


def test_an_empty_geographic_hull_answers(client, name):
    client.create_hull(name, geographic=True)
    assert client.locate(name, [(0, 0)]).sides.tolist() == [-1]
    assert client.distance(name, [(0, 0)]).distances.tolist() == [np.inf]
    assert np.isnan(client.tangents(name, [(0, 0)]).tangents).all()
    assert np.isnan(client.intersect_lines(name, [(0, 0)], [(1, 1)]).crossings).all()
    assert client.count(name, [(0, 0)]).counts.tolist() == [0]
    assert client.sample_points(name).points.shape == (0, 2)
    assert client.verify(name).equal
    measured = client.get_measures(name)
    assert (measured.area, measured.perimeter, measured.diameter) == (0, 0, 0)


def test_large_questions_have_the_same_answers(client, name):
    rng = np.random.default_rng(5)
    points = rng.uniform([-60, 30], [60, 80], (3000, 2))
    client.create_hull(name, geographic=True)
    client.apply(name, insert=points)
    hull = dynhull.GeoHull(points)
    places = rng.uniform([-180, -90], [180, 90], (20_000, 2))
    np.testing.assert_array_equal(client.locate(name, places).sides, hull.locate(places))
    near = places[np.abs(places - hull.center).max(axis=1) < 40]
    np.testing.assert_array_equal(client.tangents(name, near).tangents, hull.tangents(near))
    counts = client.count(name, np.concatenate([points[:9000], places])).counts
    assert (counts.sum(), len(client.sample_points(name, size=100).points)) == (3000, 100)
    assert client.verify(name).equal


def test_watchers_see_degrees_and_every_move_of_the_centre(client, name):
    client.create_hull(name, geographic=True)
    copy = HullCopy()
    with client.watch(name, copy=copy) as watch:
        assert next(watch).center is None
        client.apply(name, insert=POLE)
        assert next(watch).center == copy.center == client.get_hull(name).info.center
        before = copy.vertices
        moved = client.recenter(name, (0, -89))
        event = next(watch)
        assert (event.revision, event.cause, event.center) == (moved.revision, "recenter", (0, -89))
        assert moved.revision == 2
        np.testing.assert_array_equal(copy.vertices, client.get_hull(name).vertices)
        np.testing.assert_array_equal(copy.vertices, before)
        client.apply(name, delete=POLE[:3])
        next(watch)
        expected = dynhull.GeoHull(POLE[3:], center=(0, -89))
        np.testing.assert_array_equal(copy.vertices, expected.vertices())
        assert copy.__geo_interface__ == expected.geojson()


def test_a_centre_that_cannot_be_is_refused_and_nothing_changes(client, stub, fiji, name):
    before = client.get_hull(fiji).info
    with pytest.raises(
        HullUnsuitableError, match=r"has the point \(-?17\d\.\d+, -1\d\.\d+\), 1[67]\d\.\d+ degrees from"
    ):
        client.recenter(fiji, (0, 0))
    assert client.get_hull(fiji).info == before
    _, info, _ = refusal(lambda: stub.Recenter(pb.RecenterRequest(name=fiji, center=hull_pb2.LonLat(latitude=91))))
    assert (info.reason, info.metadata["field"]) == ("INVALID_FIELD", "center")
    other = f"{name}-other"
    client.create_hull(other, geographic=True)
    with pytest.raises(HullUnsuitableError, match="has no points to choose a centre from"):
        client.recenter(other)
    assert client.recenter(other, (190, 5)).center == (-170, 5)
    plane = f"{name}-plane"
    client.create_hull(plane)
    with pytest.raises(HullUnsuitableError, match="is a plane"):
        client.recenter(plane, (0, 0))


def test_the_frame_is_part_of_the_settings(client, stub, name):
    client.create_hull(name, geographic=True, center=(540 - 360, 10))
    config = stub.GetHull(pb.GetHullRequest(name=name)).hull.config
    assert (config.frame, config.center.longitude) == (hull_pb2.FRAME_GEOGRAPHIC, -180)
    assert client.create_hull(name, geographic=True, exist_ok=True).center == (-180, 10)
    with pytest.raises(HullExistsError, match="its geographic is True, not False"):
        client.create_hull(name, exist_ok=True)
    for config, field in (
        (hull_pb2.HullConfig(frame=9), "config.frame"),
        (hull_pb2.HullConfig(center=hull_pb2.LonLat()), "config.center"),
        (hull_pb2.HullConfig(frame=2, center=hull_pb2.LonLat(longitude=np.nan)), "config.center"),
        (hull_pb2.HullConfig(frame=2, center=hull_pb2.LonLat(latitude=-91)), "config.center"),
    ):
        _, info, _ = refusal(lambda config=config: stub.CreateHull(pb.CreateHullRequest(name="x", config=config)))
        assert (info.reason, info.metadata["field"]) == ("INVALID_FIELD", field)


def test_two_hulls_about_different_centres_are_compared(client, name):
    places = {"a": [(-20, -5), (-10, 0), (-20, 5)], "b": [(60, -5), (50, 0), (60, 5)], "c": [(-15, -9), (-15, 9)]}
    for short, points in places.items():
        client.create_hull(f"{name}-{short}", geographic=True)
        client.apply(f"{name}-{short}", insert=points)
    apart = client.separate(f"{name}-a", f"{name}-b")
    assert not apart.intersect
    assert apart.distance == client.distance(f"{name}-a", [(50, 0)]).distances[0]
    assert apart.distance == pytest.approx(6378137 * np.radians(60), abs=1e-3)  # along the equator
    assert np.isnan([apart.depth, apart.offset, *apart.normal]).all()
    together = client.separate(f"{name}-a", f"{name}-c")
    assert (together.intersect, together.distance) == (True, 0)
    client.create_hull(f"{name}-far", geographic=True)
    client.apply(f"{name}-far", insert=[(165, 0), (165, 5)])
    with pytest.raises(InvalidRequestError, match="too far apart to compare"):
        client.separate(f"{name}-a", f"{name}-far")
    client.create_hull(f"{name}-plane")
    client.apply(f"{name}-plane", insert=[(0, 0)])
    with pytest.raises(HullUnsuitableError, match=r"is a plane, and .* is geographic"):
        client.separate(f"{name}-a", f"{name}-plane")


@pytest.mark.parametrize(("snapshot_points", "sudden"), RESTARTS)
def test_a_restart_gives_the_very_doubles_and_the_centre(tmp_path, sudden, snapshot_points):
    rng = np.random.default_rng(3)
    fleet = rng.uniform([170, -40], [200, 10], (400, 2))
    options = ["--data", str(tmp_path / "data"), "--snapshot-points", str(snapshot_points)]
    with server_process(*options, killed=sudden) as server, HullClient(server.address) as client:
        client.create_hull("fleet", geographic=True)
        client.create_hull("given", geographic=True, center=(10, 10))
        for part in np.split(fleet, 20):
            client.apply("fleet", insert=part)
        client.apply("fleet", delete=fleet[:30], move=(fleet[30:40], fleet[30:40] - 0.25))
        client.apply("given", insert=[(0.1, 0.2)])
        client.recenter("fleet", (179, -20))
        client.apply("fleet", delete=[(1, 1)], missing="count")
        before = [client.get_hull(each) for each in ("fleet", "given")]
        sample = client.sample_points("fleet", size=10_000).points
        with client.watch("fleet") as watch:
            held = next(watch)
        assert before[0].info.center == (179, -20)
        if sudden:
            server.process.kill()
            server.process.wait(PATIENCE)
    with server_process(*options) as server, HullClient(server.address) as client:
        after = [client.get_hull(each) for each in ("fleet", "given")]
        assert [each.info for each in after] == [each.info for each in before]
        for one, other in zip(after, before, strict=True):
            np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(client.sample_points("fleet", size=10_000).points, sample)
        expected = np.concatenate([fleet[40:], fleet[30:40] - 0.25])
        np.testing.assert_array_equal(sample, expected[np.lexsort(expected.T[::-1])])
        assert client.verify("fleet").equal
        client.apply("fleet", insert=[(185, 20)])
        copy = HullCopy()
        copy.update(held)
        with client.watch("fleet", copy=copy) as watch:
            next(watch)
        np.testing.assert_array_equal(copy.vertices, client.get_hull("fleet").vertices)
    assert "all whole" in command("check", tmp_path / "data").stdout
    exported = tmp_path / "fleet.geojson"
    command("export", "fleet", exported, "--data", tmp_path / "data")
    positions = [each["geometry"]["coordinates"] for each in json.loads(exported.read_text())["features"]]
    assert len(positions) == 371
    assert max(abs(lon) for lon, _ in positions) <= 180  # RFC 7946
    table = tmp_path / "fleet.csv"
    command("export", "fleet", table, "--data", tmp_path / "data")
    assert table.read_text().splitlines()[0] == "lon,lat"
    given = np.loadtxt(table, delimiter=",", skiprows=1)
    assert sorted(given.tolist()) == sorted([*sample.tolist(), [185, 20]])


def test_a_cause_that_older_clients_do_not_know_is_named(stub, client, fiji):
    client.recenter(fiji)
    events = stub.Watch(pb.WatchRequest(name=fiji))
    first = next(events)
    events.cancel()
    assert first.cause == batch_pb2.CAUSE_RECENTER
    assert first.HasField("center")


def at_row(place):
    return [(1.0, 2.0), place]


# The entries to a geographic hull through the SDK, with the place in row 1 of many, or alone.
ENTRIES = {
    "insert": lambda client, name, place: client.apply(name, insert=at_row(place)),
    "delete": lambda client, name, place: client.apply(name, delete=at_row(place), missing="count"),
    "move": lambda client, name, place: client.apply(name, move=([(1, 2)], [place])),
    "put": lambda client, name, place: client.put(f"{name}-keyed", ["a", "b"], at_row(place)),
    "locate": lambda client, name, place: client.locate(name, at_row(place)),
    "count": lambda client, name, place: client.count(name, at_row(place)),
    "distance": lambda client, name, place: client.distance(name, at_row(place)),
    "tangents": lambda client, name, place: client.tangents(name, at_row(place)),
    "lines": lambda client, name, place: client.intersect_lines(name, [(7, 8), (3, 4)], at_row(place)),
    "recenter": lambda client, name, place: client.recenter(name, place),
    "create": lambda client, name, place: client.create_hull(f"{name}-new", geographic=True, center=place),
}
ALONE = {"move", "recenter", "create"}
REACH = {"insert", "move", "put", "tangents", "lines"}


def test_odd_places_are_refused_by_every_entry_and_change_nothing(client, name):
    client.create_hull(name, geographic=True, center=(0, 0))
    client.create_hull(f"{name}-keyed", keyed="str", geographic=True, center=(0, 0))
    client.apply(name, insert=[(1, 2), (3, 4), (-5, 6)])
    far = [(place, rf"{angle} degrees from the centre \(0\.0, 0\.0\)", REACH) for place, angle in TOO_FAR]
    for place, words, entries in [*((place, words, ENTRIES) for place, words in NO_PLACES), *far]:
        for entry in entries:
            with pytest.raises((InvalidRequestError, ValueError), match=words) as caught:
                ENTRIES[entry](client, name, place)
            assert entry in ALONE or "[1]" in str(caught.value) or "row 1" in str(caught.value), (entry, caught.value)
    for place, _ in TOO_FAR:
        assert client.locate(name, at_row(place)).sides.tolist() == [0, -1]
        assert client.count(name, at_row(place)).counts.tolist() == [1, 0]
    assert (client.get_hull(name).revision, client.get_hull(f"{name}-keyed").revision) == (1, 0)
    assert not [each for each in client.list_hulls(name) if each.name == f"{name}-new"]
    for place, back in TAKEN:
        client.apply(name, insert=[place])
        assert client.count(name, [back]).counts.tolist() == [1]
    assert client.verify(name).equal
