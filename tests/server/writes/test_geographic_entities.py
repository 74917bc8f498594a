"""Keys, times and windows of geographic hulls, from outside."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow.parquet as parquet
import pytest
from cases import RESTARTS
from command_line import dynhull as command
from patience import PATIENCE
from server_process import server_process

import dynhull
from dynhull_client import Batch, HullClient, HullCopy, HullUnsuitableError, InvalidRequestError

FLEET = {"Nadi": (177.4, -17.8), "Suva": (178.4, -18.1), "Taveuni": (-179.9, -16.8), "Labasa": (179.4, -16.4)}
MOMENT = datetime(2026, 11, 1, tzinfo=UTC)
SECOND = timedelta(seconds=1)


@pytest.fixture
def fiji(client, name):
    client.create_hull(name, keyed="str", geographic=True)
    client.put(name, list(FLEET), list(FLEET.values()))
    return name


def entities_of(client, name):
    found = client.entities(name)
    return dict(zip(found.keys, map(tuple, found.points.tolist()), strict=True))


def test_keys_have_the_very_doubles_and_name_the_vertices(client, fiji):
    hull = dynhull.GeoKeyedHull()
    hull.put_many(list(FLEET), list(FLEET.values()))
    found = client.get_hull(fiji)
    assert entities_of(client, fiji) == FLEET
    assert (found.vertex_keys, found.info.center) == (tuple(hull.vertex_keys()), hull.center)
    np.testing.assert_array_equal(found.vertices, hull.vertices())
    client.put(fiji, ["Taveuni"], [(180.1, -16.8)])  # the same place, written in another way
    assert client.positions(fiji, ["Taveuni", "Apia"]).positions.tolist()[0] == [180.1, -16.8]
    assert client.locate(fiji, keys=["Suva", "Taveuni", "Apia"]).sides.tolist() == [0, 0, -128]
    assert client.distance(fiji, keys=["Suva"]).distances.tolist() == [0]
    assert client.support(fiji, [(1, 0), (0, 1)], keys=True).keys == ("Taveuni", "Labasa")
    assert client.sample_points(fiji, keys=True).keys == ("Nadi", "Suva", "Labasa", "Taveuni")
    assert client.verify(fiji).equal
    assert client.verify(fiji).keys_equal


def test_keys_of_a_hull_about_another_centre_are_located(client, fiji, name):
    other = f"{name}-other"
    client.create_hull(other, keyed="int", geographic=True)
    client.put(other, [1, 2, 3], [(178.9, -17.2), (-170, -14), (90, 5)])
    assert client.locate(fiji, keys=[1, 2, 3], keys_of=other).sides.tolist() == [1, -1, -1]
    far = client.distance(fiji, keys=[3], keys_of=other).distances
    assert far.tolist() == client.distance(fiji, [(90, 5)]).distances.tolist()
    plane = f"{name}-plane"
    client.create_hull(plane, keyed="int")
    with pytest.raises(HullUnsuitableError, match=r"is a plane, and .* is geographic"):
        client.locate(fiji, keys=[1], keys_of=plane)


def test_a_put_too_far_is_refused_with_its_row_in_any_batch(client, fiji, name):
    with pytest.raises(InvalidRequestError, match=r"points row 1 is \(5\.0, 50\.0\): 1\d\d\.\d+ degrees from"):
        client.put(fiji, ["Suva", "Paris"], [(178, -18), (5, 50)])
    with pytest.raises(InvalidRequestError, match=r"points row 0 is \(5\.0, 95\.0\): a latitude"):
        client.put(fiji, ["Paris"], [(5, 95)], only="present")
    plane = f"{name}-plane"
    client.create_hull(plane, keyed="str")
    with pytest.raises(InvalidRequestError, match=r"points row 0 is \(5\.0, 50\.0\)"):
        client.transfer({plane: Batch(keys=["a"], points=[(5, 50)]), fiji: Batch(keys=["a"], points=[(5, 50)])})
    assert (client.get_hull(plane).revision, entities_of(client, fiji)) == (0, FLEET)


def test_a_window_on_the_globe(client, name):
    client.create_hull(name, max_age=60, clock="data", geographic=True)
    places = [(179, 0), (-179, 0), (180, 2)]
    client.apply(name, insert=places, times=[MOMENT, MOMENT + 10 * SECOND, MOMENT + 20 * SECOND])
    center = client.get_hull(name).info.center
    assert center == dynhull.GeoHull(places).center
    late_and_far = client.apply(name, insert=[(0, 0), (-178, 1)], times=[MOMENT - 99 * SECOND, MOMENT + 65 * SECOND])
    assert late_and_far.late == 1
    found = client.get_hull(name)
    np.testing.assert_array_equal(found.vertices, dynhull.GeoHull([*places[1:], (-178, 1)], center).vertices())
    with pytest.raises(InvalidRequestError, match=r"insert row 1 is \(10\.0, 0\.0\)"):
        client.apply(name, insert=[(0, 0), (10, 0)], times=[MOMENT - 99 * SECOND, MOMENT + 66 * SECOND])
    assert client.verify(name).equal


def test_a_first_batch_of_a_window_that_deletes_what_it_inserts_chooses_by_the_rest_that_it_inserts(client, name):
    client.create_hull(name, max_points=5, geographic=True)
    client.apply(name, insert=[(100, 0), (100, 0), (10, 0)], delete=[(10, 0)], missing="count")
    info = client.get_hull(name).info
    assert (info.points, info.center) == (2, dynhull.GeoHull([(100, 0), (100, 0), (10, 0)]).center)
    assert client.verify(name).equal


@pytest.mark.parametrize(("snapshot_points", "sudden"), RESTARTS)
def test_a_restart_gives_keys_times_and_the_centre(tmp_path, sudden, snapshot_points):
    rng = np.random.default_rng(4)
    options = ["--data", str(tmp_path / "data"), "--snapshot-points", str(snapshot_points)]
    names = ["fleet", "tracks", "numbers"]
    held = HullCopy()
    with server_process(*options, killed=sudden) as server, HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str", ordering="event_time", geographic=True)
        client.create_hull("tracks", max_points=50, clock="data", geographic=True)
        client.create_hull("numbers", keyed="int", max_age=1000, clock="data", geographic=True, center=(0, 90))
        for second in range(20):
            around_pole = np.column_stack([rng.uniform(-360, 360, 30), rng.uniform(60, 90, 30)])
            keys, times = rng.choice(100, 30, replace=False), [MOMENT + second * SECOND] * 30
            client.put("fleet", [f"é{key}" for key in keys], around_pole, times=times, remove=["none"])
            client.apply("tracks", insert=around_pole, times=times)
            client.put("numbers", keys, around_pole, times=times)
            if second == 10:
                client.recenter("fleet", (0, 80))
                client.recenter("tracks", (90, 85))
                with client.watch("fleet", copy=held) as watch:
                    next(watch)
        before = [client.get_hull(each) for each in names]
        known = [client.entities(each) for each in ("fleet", "numbers")]
        if sudden:
            server.process.kill()
            server.process.wait(PATIENCE)
    with server_process(*options) as server, HullClient(server.address) as client:
        for each, there, center in zip(names, before, [(0, 80), (90, 85), (0, 90)], strict=True):
            after = client.get_hull(each)
            assert (after.info, after.vertex_keys) == (there.info, there.vertex_keys)
            assert after.info.center == center
            np.testing.assert_array_equal(after.vertices, there.vertices)
            assert client.verify(each).equal
        for each, there in zip(("fleet", "numbers"), known, strict=True):
            after = client.entities(each)
            assert list(after.keys) == list(there.keys)
            np.testing.assert_array_equal(after.points, there.points)
            np.testing.assert_array_equal(after.times, there.times)
        with client.watch("fleet", copy=held) as watch:
            next(watch)
        np.testing.assert_array_equal(held.vertices, before[0].vertices)
    assert "all whole" in command("check", tmp_path / "data").stdout
    command("export", "fleet", tmp_path / "fleet.parquet", "--data", tmp_path / "data")
    table = parquet.read_table(tmp_path / "fleet.parquet")
    assert table.column_names == ["key", "lon", "lat", "time"]
    np.testing.assert_array_equal(np.column_stack([table["lon"], table["lat"]]), known[0].points)
