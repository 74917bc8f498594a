"""Keyed hulls and windows through both clients and a real server."""

from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from patience import wait_until
from proxy import proxy
from server_process import server_process

from dynhull import DynamicHull
from dynhull_client import (
    Batch,
    DuplicateKeyError,
    HullClient,
    HullCopy,
    HullExistsError,
    HullNotFoundError,
    HullUnsuitableError,
    InvalidRequestError,
    KeyMissingError,
    Window,
)

FLEET = ["LH400", "UA17", "AF84", "BA2"]
PLACES = [[0.0, 0.0], [4.0, 0.0], [2.0, 3.0], [2.0, 1.0]]
NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


@pytest.fixture
def client(address: str, connect: type[HullClient]) -> Iterator[HullClient]:
    with connect(address) as client:
        yield client


def test_keys_are_put_moved_named_and_removed(client: HullClient, name: str) -> None:
    assert client.create_hull(name, keyed="str").keyed == "str"
    put = client.put(name, FLEET, PLACES)
    assert (put.inserted, put.moved, put.points, put.hull_changed) == (4, 0, 4, True)
    hull = client.get_hull(name)
    assert hull.vertex_keys == ("LH400", "UA17", "AF84")
    assert hull == client.get_hull(name)
    assert len({hull, client.get_hull(name)}) == 1

    moved = client.put(name, ["BA2", "new"], [[9, 9], [8, 8]], only="present", remove=["UA17"])
    assert (moved.inserted, moved.moved, moved.skipped, moved.deleted) == (0, 1, 1, 1)
    assert client.remove(name, ["UA17", "AF84"]).missing == 1
    there = client.entities(name)
    assert (there.revision, list(there.keys), there.points.tolist()) == (3, ["BA2", "LH400"], [[9, 9], [0, 0]])
    assert there.times is None
    assert len({there, client.entities(name)}) == 1

    found = client.positions(name, ["LH400", "nobody"])
    assert found.present.tolist() == [True, False]
    assert found.positions.tolist()[0] == [0, 0]
    assert np.isnan(found.positions[1]).all()
    assert client.locate(name, keys=["LH400", "nobody"]).sides.tolist() == [0, -128]
    assert client.support(name, [[1, 0]], keys=True).keys == ("BA2",)
    assert client.sample_points(name, keys=True).keys == ("LH400", "BA2")
    assert client.verify(name).keys_equal


def test_integer_keys_and_keys_of_another_hull(client: HullClient, name: str) -> None:
    fleet, depot = f"{name}/fleet", f"{name}/depot"
    client.create_hull(fleet, keyed="int")
    client.create_hull(depot)
    client.put(fleet, np.array([7, 2**64 - 1], np.uint64), [[1, 1], [9, 0]])
    client.apply(depot, insert=[[0, 0], [2, 0], [2, 2], [0, 2]])
    assert client.get_hull(fleet).vertex_keys == (7, 2**64 - 1)
    assert client.get_hull(depot).vertex_keys is None
    asked: Any = {"keys": [7, 2**64 - 1, 5], "keys_of": fleet, "keys_min_revision": 1}
    located = client.locate(depot, **asked)
    assert (located.sides.tolist(), located.keys_revision) == ([1, -1, -128], 1)
    assert np.array_equal(client.distance(depot, **asked).distances, [0, 7, np.nan], equal_nan=True)
    assert client.entities(fleet).keys.tolist() == [7, 2**64 - 1]
    client.create_hull(f"{name}/empty", keyed="str")
    assert list(client.entities(f"{name}/empty").keys) == []


def test_refusals_name_the_rows_and_change_nothing(client: HullClient, name: str) -> None:
    plain = f"{name}/plain"
    client.create_hull(name, keyed="str")
    client.create_hull(plain)
    with pytest.raises(DuplicateKeyError) as twice:
        client.put(name, ["a", "b", "a"], PLACES[:3])
    assert (twice.value.first_row, twice.value.row, twice.value.value) == (0, 2, "a")
    client.put(name, ["a"], [[1, 1]])
    with pytest.raises(KeyMissingError, match="nobody") as missing:
        client.remove(name, ["a", "nobody"], missing="raise")
    assert (missing.value.row, missing.value.value) == (1, "nobody")
    for wrong in (
        lambda: client.put(name, [1], [[0, 0]]),
        lambda: client.apply(name, insert=[[0, 0]]),
        lambda: client.put(plain, ["a"], [[0, 0]]),
        lambda: client.positions(plain, ["a"]),
        lambda: client.entities(plain),
        lambda: client.locate(plain, keys=["a"]),
    ):
        with pytest.raises(HullUnsuitableError, match=name):
            wrong()
    with pytest.raises(HullNotFoundError):
        client.entities(f"{name}/nowhere")
    for bad in ({}, {"xy": [[0, 0]], "keys": ["a"]}, {"xy": [[0, 0]], "keys_of": name}):
        with pytest.raises(ValueError, match="keys"):
            client.locate(name, **bad)
    assert (client.get_hull(name).revision, client.get_hull(plain).revision) == (1, 0)


def test_settings_are_kept_and_compared(client: HullClient, name: str) -> None:
    hour = timedelta(hours=1)
    settings: Any = {"keyed": "str", "max_age": hour, "max_points": 9, "clock": "data", "max_skew": 10}
    settings |= {"ahead": "clamp", "ordering": "event_time", "point_limit": 1000}
    info = client.create_hull(name, **settings)
    assert (info.keyed, info.ordering, info.point_limit, info.clock) == ("str", "event_time", 1000, None)
    window = info.window
    assert window is not None
    assert (window.max_age, window.max_points, window.clock) == (hour, 9, "data")
    assert (window.max_skew, window.ahead) == (timedelta(seconds=10), "clamp")
    assert client.create_hull(name, **settings, exist_ok=True) == info
    with pytest.raises(HullExistsError, match=r"exists with other settings: its keyed is 'str', not 'int'"):
        client.create_hull(name, **settings | {"keyed": "int"}, exist_ok=True)
    for bad, words in (
        ({"keyed": "float"}, "keyed must be one of None, 'str', 'int', got 'float'"),
        ({"max_points": 0}, "max_points must be at least 1, got 0"),
        ({"clock": "data"}, "give max_age or max_points, too"),
        ({"ahead": "clamp"}, "ahead is given alone: give max_age or max_points or max_skew, too"),
        ({"max_skew": 1}, "max_skew is given alone: give max_age or max_points or ordering, too"),
        (
            {"max_skew": 1, "keyed": "str", "ordering": "event_time", "clock": "data"},
            "clock is given alone: give max_age or max_points, too",
        ),
        (
            {"max_age": "30 min"},
            (
                "max_age is '30 min': must be a finite number of seconds, "
                "a timedelta, or text such as 500ms, 90s, 30m, 2h or 7d"
            ),
        ),
    ):
        with pytest.raises(ValueError, match=words):
            client.create_hull(f"{name}/bad", **bad)
    with pytest.raises(InvalidRequestError, match="max_age"):
        client.create_hull(f"{name}/bad", max_age=-1)


def test_a_time_of_the_distant_future_is_refused_without_a_window(client: HullClient, name: str) -> None:
    info = client.create_hull(name, keyed="str", ordering="event_time", max_skew=60)
    assert info.window == Window(max_skew=timedelta(minutes=1))
    client.create_hull(name, keyed="str", ordering="event_time", max_skew=60, exist_ok=True)
    client.put(name, ["a", "b"], [[0, 0], [1, 1]], [NOON, NOON])
    with pytest.raises(InvalidRequestError, match="further ahead of the server's clock") as refused:
        client.put(name, ["b", "a"], [[3, 3], [2, 2]], [NOON, datetime(2099, 1, 1, tzinfo=UTC)])
    assert refused.value.row == 1
    assert client.put(name, ["a"], [[2, 2]], [NOON + timedelta(hours=1)]).moved == 1


def test_a_window_by_event_time(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str", max_age=600, clock="data", ordering="event_time")
    minutes = [NOON + timedelta(minutes=minute) for minute in range(4)]
    first = client.put(name, FLEET, PLACES, minutes)
    assert first.clock == minutes[3]
    stale = client.put(name, ["BA2"], [[7, 7]], [NOON])
    assert (stale.stale, stale.moved) == (1, 0)
    later = client.put(name, ["LH400"], [[1, 1]], [NOON + timedelta(minutes=11)])
    assert (later.clock, client.get_hull(name).info.clock) == (minutes[0] + timedelta(minutes=11),) * 2
    there = client.entities(name)
    assert list(there.keys) == ["AF84", "BA2", "LH400"]  # UA17 is ten minutes old
    assert there.times.tolist() == [each.replace(tzinfo=None) for each in (minutes[2], minutes[3], later.clock)]
    found = client.positions(name, ["nobody", "BA2"])
    assert found.times is not None
    assert (found.times[1].item(), np.isnat(found.times[0])) == (minutes[3].replace(tzinfo=None), True)
    assert client.put(name, ["late"], [[9, 9]], [NOON]).late == 1


def test_points_without_keys_leave_a_window(client: HullClient, name: str) -> None:
    client.create_hull(name, max_points=3)
    assert client.apply(name, insert=[[0, 0], [1, 0], [0, 1]]).evicted == 0
    assert client.apply(name, insert=[[5, 5]], times=[datetime.now(UTC)]).evicted == 1
    with client.ingest(name) as stream:
        stream.apply(insert=[[6, 6], [7, 7]])
    assert (stream.summary.evicted, stream.summary.points) == (2, 3)


def test_a_key_moves_from_hull_to_hull(client: HullClient, name: str) -> None:
    north, south = f"{name}/north", f"{name}/south"
    for each in (north, south):
        client.create_hull(each, keyed="str")
    client.put(north, FLEET, PLACES)
    batches = {north: Batch(remove=["LH400"], missing="raise"), south: Batch(keys=["LH400"], points=[[5, 5]])}
    done = client.transfer(batches, producer="p", sequence=1)
    assert (done[north].deleted, done[south].inserted) == (1, 1)
    assert [each.duplicate for each in client.transfer(batches, producer="p", sequence=1).values()] == [True, True]
    with pytest.raises(KeyMissingError):
        client.transfer(batches, producer="p", sequence=2)
    assert (client.get_hull(north).revision, client.get_hull(south).revision) == (2, 1)


def test_a_watch_names_the_corners(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str", max_age=600, clock="data")
    client.put(name, FLEET, PLACES, [NOON] * 4)
    copy, plain = HullCopy(), HullCopy()
    with client.watch(name, keys=True, copy=copy) as watch, client.watch(name, copy=plain) as unnamed:
        first = next(watch)
        assert (first.vertex_keys, first.cause) == (("LH400", "UA17", "AF84"), "batch")
        assert (first.clock, next(unnamed).vertex_keys) == (NOON, None)
        rng = np.random.default_rng(2)
        for step in range(30):
            client.put(name, FLEET, rng.integers(0, 4, (4, 2)), [NOON + timedelta(seconds=step)] * 4)
            hull = client.get_hull(name)
            while copy.revision < hull.revision:
                next(watch)
            assert copy.vertex_keys == hull.vertex_keys
            assert copy.vertices.tolist() == hull.vertices.tolist()
        client.put(name, ["new"], [[1, 1]], [NOON + timedelta(hours=1)])
        while copy.vertex_keys != ("new",):
            last = next(watch)
        assert last.clock == NOON + timedelta(hours=1)
    resumed = HullCopy()
    resumed.update(client_snapshot(client, name))
    client.put(name, ["newer"], [[2, 2]], [NOON + timedelta(hours=1)])
    with client.watch(name, keys=True, copy=resumed) as watch:
        while resumed.vertex_keys != ("new", "newer"):
            next(watch)


def client_snapshot(client: HullClient, name: str) -> Any:
    """The first event of a watch that does not name vertices."""
    with client.watch(name) as watch:
        return next(watch)


def test_a_writer_loses_no_position(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str")
    with client.writer(name, linger=60) as writer:
        first = writer.put(keys=["a", "b"], points=[[0, 0], [1, 1]])
        same = writer.put(keys=["c"], points=[[2, 2]])
        again = writer.put(keys=["a", "d", "d"], points=[[3, 3], [4, 4], [5, 5]])
        gone = writer.remove(["d", "b"])
        timed = writer.put(keys=["e"], points=[[6, 6]], times=[NOON])
        untimed = writer.put(keys=["f"], points=[[7, 7]])
        writer.flush()
    assert first.result() == same.result()
    assert [each.result().revision for each in (first, again, gone, timed, untimed)] == [1, 3, 4, 4, 5]
    assert gone.result().deleted == 2
    assert list(client.entities(name).keys) == ["a", "c", "e", "f"]


def test_a_writer_may_keep_the_last_position_only(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="int", ordering="event_time")
    seconds = [NOON + timedelta(seconds=second) for second in range(9)]
    with client.writer(name, linger=60, coalesce="last") as writer:
        writer.put(keys=[1, 2, 1], points=[[0, 0], [1, 1], [2, 2]], times=seconds[:3])
        writer.put(keys=[2], points=[[3, 3]], times=seconds[3:4])
        writer.flush()
        assert client.get_hull(name).revision == 1
        # Arrives later, and is older: only the server knows which of the two counts.
        writer.put(keys=[2], points=[[5, 5]], times=seconds[5:6])
        old = writer.put(keys=[2], points=[[4, 4]], times=seconds[4:5])
        writer.flush()
    assert old.result().stale == 1
    assert client.entities(name).points.tolist() == [[2, 2], [5, 5]]
    with pytest.raises(ValueError, match='coalesce must be None or "last"'):
        client.writer(name, coalesce="first")


def test_a_writer_begins_a_batch_for_keys_of_another_kind(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str")
    with client.writer(name, linger=60) as writer:
        good = [writer.put(keys=["a"], points=[[0, 0]])]
        bad = [writer.put(keys=[5], points=[[1, 1]]), writer.put(insert=[[5, 5]])]
        good.append(writer.put(keys=["b"], points=[[2, 2]]))
        with pytest.raises(HullUnsuitableError):
            writer.flush()
    assert [each.result().revision for each in good] == [1, 2]
    assert [each.exception().field for each in bad] == ["batch.puts.keys", "batch.inserts"]
    assert list(client.entities(name).keys) == ["a", "b"]


def test_a_writer_sends_the_times_at_which_keys_leave(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str", max_age=timedelta(days=1), clock="data")
    soon, late = NOON + timedelta(seconds=1), NOON + timedelta(hours=1)
    with client.writer(name, linger=60, coalesce="last") as writer:
        leaving = writer.put(
            keys=["a", "b", "a"], points=[[0, 0], [1, 1], [2, 2]], times=[NOON] * 3, expire_times=[soon, soon, late]
        )
        staying = writer.put(keys=["c"], points=[[3, 3]], times=[NOON])
        writer.put(keys=["d"], points=[[4, 4]], times=[NOON + timedelta(seconds=2)])
        writer.flush()
    assert [each.result().revision for each in (leaving, staying)] == [1, 3], "that b leaves is a revision, too"
    assert list(client.entities(name).keys) == ["a", "c", "d"]


@pytest.mark.parametrize("coalesce", [None, "last"])
def test_a_writer_puts_new_keys_only_and_keys_that_leave_again(
    client: HullClient, name: str, coalesce: Literal["last"] | None
) -> None:
    client.create_hull(name, keyed="str", max_age=timedelta(days=1), clock="data")
    with client.writer(name, linger=60, coalesce=coalesce) as writer:
        first = writer.put(keys=["a"], points=[[0, 0]], times=[NOON], only="absent")
        second = writer.put(keys=["a"], points=[[9, 9]], times=[NOON], only="absent")
        writer.put(keys=["b"], points=[[1, 1]], times=[NOON], ttl=1)
        writer.put(keys=["c"], points=[[2, 2]], times=[NOON], ttl=timedelta(seconds=1))
        known = writer.put(keys=["a", "x"], points=[[3, 3], [4, 4]], times=[NOON] * 2, only="present")
        writer.put(keys=["d"], points=[[5, 5]], times=[NOON + timedelta(seconds=2)])
        writer.flush()
        assert [first.result().inserted, second.result().skipped] == [1, 1]
        assert (known.result().moved, known.result().skipped) == (1, 1)
        with pytest.raises(ValueError, match='only must be "absent" or "present"'):
            writer.put(keys=["e"], points=[[0, 0]], only="new")
        with pytest.raises(ValueError, match="are given with keys to put"):
            writer.put(insert=[[0, 0]], ttl=1)
    assert list(client.entities(name).keys) == ["a", "d"]


def test_an_ingest_puts_new_keys_only_and_keys_that_leave_again(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str", max_age=timedelta(days=1), clock="data")
    with client.ingest(name) as stream:
        stream.apply(keys=["a", "b"], points=[[0, 0], [1, 1]], times=[NOON] * 2, ttl=1)
        stream.apply(keys=["b", "c"], points=[[2, 2], [3, 3]], times=[NOON] * 2, only="absent")
        stream.apply(keys=["e"], points=[[4, 4]], times=[NOON], expire_times=[NOON + timedelta(seconds=3)])
        stream.apply(keys=["d"], points=[[5, 5]], times=[NOON + timedelta(seconds=2)])
    assert (stream.summary.inserted, stream.summary.skipped) == (5, 1)
    assert list(client.entities(name).keys) == ["c", "d", "e"]


def test_every_position_once_though_the_server_is_killed(tmp_path: Path, connect: type[HullClient]) -> None:
    """Three servers, one after another, on the same data; the first two are killed in the middle of batches."""
    rng = np.random.default_rng(8)
    keys = rng.integers(0, 50, (1200, 3)).tolist()
    places = rng.normal(size=(1200, 3, 2))
    data = ("--data", str(tmp_path))
    with (
        server_process(*data, killed=True) as first,
        proxy(first.address) as way,
        connect(way.address) as client,
        ExitStack() as stack,
    ):
        client.create_hull("a", keyed="int")
        writer = stack.enter_context(client.writer("a", producer="p"))
        results = []
        for number, (names, points) in enumerate(zip(keys, places, strict=True)):
            results.append(writer.put(keys=names, points=points))
            if number == 400:
                wait_until(lambda: writer.sequence > 20)
                first.process.kill()
                second = stack.enter_context(server_process(*data, killed=True, torn=True))
                way.server = second.address
            if number == 800:
                wait_until(lambda: writer.sequence > 150)
                second.process.kill()
                way.server = stack.enter_context(server_process(*data, torn=True)).address
        writer.flush()
        latest = {
            name: tuple(point)
            for names, points in zip(keys, places.tolist(), strict=True)
            for name, point in zip(names, points, strict=True)
        }
        there = client.entities("a")
        assert dict(zip(there.keys.tolist(), map(tuple, there.points.tolist()), strict=True)) == latest
        assert there.revision == writer.sequence
        expected = DynamicHull(list(latest.values()))
        assert client.get_hull("a").vertices.tolist() == expected.vertices().tolist()
