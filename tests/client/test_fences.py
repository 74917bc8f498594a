"""Fences through both clients: settings come back as they were given, events in order, without loss or repetition."""

import json
import threading
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from geopandas import GeoSeries
from patience import wait_until
from proxy import proxy
from server_process import server_process
from shapely.geometry import MultiPolygon, box
from shapely.geometry import Polygon as Shape

from dynhull_client import (
    Circle,
    ConsumerNotFoundError,
    FenceEvent,
    FenceExistsError,
    FenceNotFoundError,
    FenceReplacedError,
    HullClient,
    HullFencedError,
    HullNotFoundError,
    Inside,
    InvalidRequestError,
    Polygon,
    Prefix,
    SequenceAheadError,
    SubjectsInside,
)

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
HOLE = [[1, 1], [2, 1], [2, 2]]
FAR = [[5, 5], [6, 5], [6, 6]]
HOLED = Shape(SQUARE, [HOLE])


@pytest.fixture
def client(address: str, connect: type[HullClient], name: str) -> Iterator[HullClient]:
    with connect(address) as client:
        client.create_hull(name, keyed="str")
        yield client


def pass_through(client: HullClient, name: str, keys: list[str]) -> None:
    """An enter and an exit of each key."""
    for key in keys:
        client.put(name, [key], [[1, 1]])
        client.put(name, [key], [[9, 9]])


def test_settings_come_back(client: HullClient, name: str) -> None:
    before = datetime.now(UTC)
    made = client.create_fence(name, area=Polygon(SQUARE, [HOLE]), subjects=name, boundary="open", max_events=100)
    assert made == client.get_fence(name)
    assert (made.area, made.subjects, made.other_hull) == ((Polygon(SQUARE, [HOLE]),), name, None)
    assert (made.boundary, made.max_events, made.margin, made.dwell) == ("open", 100, 0.0, None)
    assert (made.last_sequence, made.first_sequence, made.inside, made.consumers) == (1, 1, 0, ())
    assert made.created >= before - timedelta(seconds=5)
    assert [each for each in client.list_fences(name) if each.name == name] == [made]


AREAS = {
    "a circle": (Circle(1, 1, 3), Circle(1, 1, 3)),
    "corners": (SQUARE, [Polygon(SQUARE)]),
    "an array": (np.array(SQUARE), [Polygon(SQUARE)]),
    "a polygon": (Polygon(SQUARE, [HOLE]), (Polygon(SQUARE, [HOLE]),)),
    "several": ([HOLE, Polygon(FAR)], [Polygon(HOLE), Polygon(FAR)]),
    "shapely": (HOLED, (Polygon(SQUARE, [HOLE]),)),
    "shapely, several": (
        MultiPolygon([HOLED, box(5, 5, 6, 6)]),
        [Polygon(SQUARE, [HOLE]), Polygon([[6, 5], [6, 6], [5, 6], [5, 5]])],
    ),
    "WKT": (f" {HOLED.wkt}", (Polygon(SQUARE, [HOLE]),)),
    "several as WKT": (["polygon z((0 0 1, 4 0 2, 4 3 3, 0 0 1))"], [Polygon([[0, 0], [4, 0], [4, 3]])]),
    "geopandas": (GeoSeries([HOLED]), (Polygon(SQUARE, [HOLE]),)),
    "GeoJSON": (json.loads(json.dumps(HOLED.__geo_interface__)), (Polygon(SQUARE, [HOLE]),)),
    "GeoJSON with heights": (
        {"type": "Polygon", "coordinates": [[[*corner, 7.0] for corner in SQUARE]]},
        [Polygon(SQUARE)],
    ),
}


@pytest.mark.parametrize("form", AREAS)
def test_areas_come_in_many_forms(client: HullClient, name: str, form: str) -> None:
    given, area = AREAS[form]
    made = client.create_fence(name, area=given, subjects=name)
    assert made.area == (area if isinstance(area, Circle) else tuple(area))
    again = client.create_fence(name, area=made.area, subjects=name, exist_ok=True)
    assert again == made
    assert hash(again) == hash(made)


def test_rules_that_change_nothing_are_no_rules(client: HullClient, name: str) -> None:
    made = client.create_fence(name, area=SQUARE, subjects=name)
    nothing = {"confirmations": 1, "dwell": 0, "min_dwell": 0.0, "max_event_age": timedelta(0), "margin": -0.0}
    assert client.create_fence(name, area=SQUARE, subjects=name, exist_ok=True, **nothing) == made
    assert (made.confirmations, made.dwell, made.min_dwell, made.max_event_age) == (0, None, None, None)


def test_a_hull_as_area(client: HullClient, name: str) -> None:
    zone = f"{name}-zone"
    client.create_hull(zone)
    made = client.create_fence(name, area=zone, subjects=name)
    assert made.area == zone
    client.put(name, ["a"], [[1, 1]])
    client.apply(zone, insert=SQUARE)
    with client.watch_fence(name, after=0) as watch:
        event = next(event for event in watch if event.type == "enter")
    assert (event.key, event.cause, event.area_revision) == ("a", frozenset({"area_moved"}), 1)
    with pytest.raises(HullFencedError) as refused:
        client.delete_hull(zone)
    assert refused.value.fence == name


def test_all_hulls_of_a_prefix(client: HullClient, name: str) -> None:
    made = client.create_fence(name, area=SQUARE, subjects=Prefix(f"{name}/"), margin=1, initial="none")
    assert made.subjects == Prefix(f"{name}/")
    assert (
        client.create_fence(name, area=SQUARE, subjects=made.subjects, margin=1, initial="none", exist_ok=True) == made
    )
    client.create_hull(f"{name}/later", keyed="int")
    for x in (1, 5, 6):
        client.put(f"{name}/later", [7], [[x, 1]])
    with client.watch_fence(name, after=made.last_sequence) as watch:
        events = [next(watch), next(watch)]
    assert [(each.type, each.hull, each.key) for each in events] == [
        ("enter", f"{name}/later", 7),
        ("exit", f"{name}/later", 7),
    ]
    assert (events[1].position, events[1].distance) == ((6.0, 1.0), 2.0)


def test_two_hulls(client: HullClient, name: str) -> None:
    zone, other = f"{name}-zone", f"{name}-other"
    for each in (zone, other):
        client.create_hull(each)
    made = client.create_fence(name, area=zone, other_hull=other, near=1.0)
    assert (made.subjects, made.other_hull, made.near) == (None, other, 1.0)
    client.apply(zone, insert=SQUARE)
    client.apply(other, insert=[[5, 0]])
    client.apply(other, move=([[5, 0]], [[7, 0]]))
    with client.watch_fence(name, after=made.last_sequence) as watch:
        events = [next(watch), next(watch)]
    assert [(each.type, each.key, each.distance) for each in events] == [("begin", None, 1.0), ("cease", None, 3.0)]


def test_what_exists_and_what_does_not(client: HullClient, name: str) -> None:
    client.create_fence(name, area=SQUARE, subjects=name)
    with pytest.raises(FenceExistsError):
        client.create_fence(name, area=SQUARE, subjects=name)
    with pytest.raises(FenceExistsError, match="its area is"):
        client.create_fence(name, area=HOLE, subjects=name, exist_ok=True)
    with pytest.raises(HullNotFoundError):
        client.create_fence(f"{name}-2", area=SQUARE, subjects=f"{name}-nobody")
    with pytest.raises(InvalidRequestError) as refused:
        client.create_fence(f"{name}-2", area=[[0, 0], [4, 4], [4, 0], [0, 4]], subjects=name)
    assert refused.value.field == "config.polygon_area.polygons[0].exterior"
    for call in (client.get_fence, client.delete_fence, client.fence_inside):
        with pytest.raises(FenceNotFoundError):
            call("nobody")
    with pytest.raises(SequenceAheadError) as ahead:
        client.ack_fence(name, "alarm", 7)
    assert ahead.value.last == 1
    with pytest.raises(FenceReplacedError):
        client.ack_fence(name, "alarm", 0, uid="another")
    with pytest.raises(ConsumerNotFoundError):
        client.delete_consumer(name, "nobody")


def test_events_are_values(client: HullClient, name: str) -> None:
    fence = client.create_fence(name, area=SQUARE, subjects=name, initial="none")
    revision = client.put(name, ["a"], [[1, 1]], times=None).revision
    client.put(name, ["a"], [[4, 7]])
    with client.watch_fence(name, after=0) as watch:
        enter, leave = next(watch), next(watch)
    assert enter.time is not None
    assert enter == FenceEvent(
        type="enter",
        sequence=1,
        fence=name,
        uid=fence.uid,
        cause=frozenset({"subject_appeared"}),
        hull=name,
        key="a",
        revision=revision,
        position=(1.0, 1.0),
        distance=0.0,
        time=enter.time,
        after=1,
    )
    assert (leave.type, leave.sequence, leave.cause) == ("exit", 2, frozenset({"subject_moved"}))
    assert (leave.position, leave.previous_position, leave.distance) == ((4.0, 7.0), (1.0, 1.0), 3.0)
    assert hash(enter) != hash(leave)
    assert "type='enter', sequence=1" in repr(enter)


def test_who_is_inside(client: HullClient, name: str) -> None:
    revision = client.put(name, ["b", "a", "c"], [[1, 1], [4, 4], [5, 5]]).revision
    client.create_fence(name, area=SQUARE, subjects=name)
    inside = client.fence_inside(name)
    assert inside == Inside(1, (SubjectsInside(name, ("a", "b"), revision),))
    assert len(inside) == 2
    with client.watch_fence(name, after=0) as watch:
        snapshot = next(watch)
    assert (snapshot.type, snapshot.inside) == ("snapshot", inside.subjects)
    client.remove(name, ["a", "b"])
    assert len(client.fence_inside(name)) == 0


def test_a_consumer_continues_where_it_acknowledged(client: HullClient, name: str) -> None:
    client.create_fence(name, area=SQUARE, subjects=name, initial="none")
    pass_through(client, name, ["a", "b"])
    with client.watch_fence(name, "alarm") as watch:
        first = [next(watch).sequence for _ in range(3)]
    consumer = client.ack_fence(name, "alarm", 2)
    assert (first, consumer.acknowledged, consumer.backlog) == ([1, 2, 3], 2, 2)
    assert consumer.oldest is not None
    with client.watch_fence(name, "alarm") as watch:
        assert [next(watch).sequence for _ in range(2)] == [3, 4]
    assert client.ack_fence(name, "alarm", 1).acknowledged == 2
    assert client.get_fence(name).consumers == (consumer,)
    client.delete_consumer(name, "alarm")
    assert client.get_fence(name).consumers == ()


def test_a_watch_begins_with_the_next_event(client: HullClient, name: str) -> None:
    client.create_fence(name, area=SQUARE, subjects=name)
    pass_through(client, name, ["a"])
    with client.watch_fence(name, progress_interval=0.01) as watch:
        progress = next(watch)
        pass_through(client, name, ["b"])
        event = next(event for event in watch if event.type != "progress")
    assert (progress.type, progress.sequence) == ("progress", 3)
    assert event.key == "b"


def test_a_deleted_fence_ends_its_watches(client: HullClient, name: str) -> None:
    revision = client.put(name, ["a"], [[1, 1]]).revision
    client.create_fence(name, area=SQUARE, subjects=name)
    with client.watch_fence(name, after=0) as watch:
        assert next(watch).type == "snapshot"
        client.delete_fence(name)
        (closed,) = watch
    assert (closed.type, closed.inside) == ("closed", (SubjectsInside(name, ("a",), revision),))


def test_a_replaced_fence(client: HullClient, name: str) -> None:
    client.put(name, ["a"], [[3, 3]])
    client.create_fence(name, area=SQUARE, subjects=name)
    assert client.replace_fence(name, area=SQUARE, subjects=name).last_sequence == 1
    replaced = client.replace_fence(name, area=HOLE, subjects=name)
    assert (replaced.area, replaced.last_sequence, replaced.inside) == ((Polygon(HOLE),), 2, 0)
    with client.watch_fence(name, after=1) as watch:
        event = next(watch)
    assert (event.type, event.cause) == ("exit", frozenset({"fence_changed"}))


def test_a_watch_survives_lost_connections(address: str, connect: type[HullClient], name: str) -> None:
    keys = [str(i) for i in range(100)]
    seen: list[int] = []
    with proxy(address) as way, connect(way.address) as watching, HullClient(address) as client:
        client.create_hull(name, keyed="str")
        client.create_fence(name, area=SQUARE, subjects=name, initial="none")
        watch = watching.watch_fence(name, "alarm")

        def follow() -> None:
            for event in watch:
                seen.append(event.sequence)
                if event.sequence == 2 * len(keys):
                    return

        thread = threading.Thread(target=follow)
        thread.start()
        for i, key in enumerate(keys):
            pass_through(client, name, [key])
            if i % 20 == 10:
                wait_until(lambda: seen)
                way.cut()
        thread.join()
        watch.close()
    assert seen == list(range(1, 2 * len(keys) + 1))


def test_a_watch_survives_its_server(tmp_path: Path, connect: type[HullClient]) -> None:
    data = ("--data", str(tmp_path))
    with server_process(*data, killed=True) as first, proxy(first.address) as way, connect(way.address) as client:
        client.create_hull("a", keyed="str")
        client.create_fence("a", area=SQUARE, subjects="a", initial="none")
        watch = client.watch_fence("a")
        pass_through(client, "a", ["x"])
        seen = [next(watch).sequence, next(watch).sequence]
        first.process.kill()
        first.process.wait()
        with server_process(*data) as second, HullClient(second.address) as writing:
            pass_through(writing, "a", ["y"])
            way.server = second.address
            seen += [next(watch).sequence, next(watch).sequence]
            assert watch.lost is None
            watch.close()
    assert seen == [1, 2, 3, 4]


def test_dropped_events_are_reported(client: HullClient, name: str) -> None:
    client.create_fence(name, area=SQUARE, subjects=name, initial="none", max_events=2)
    client.ack_fence(name, "alarm", 0)
    pass_through(client, name, ["a", "b", "c"])
    wait_until(lambda: client.get_fence(name).first_sequence > 1)
    with client.watch_fence(name, "alarm") as watch:
        lost = next(watch)
        event = next(watch)
    assert (lost.type, lost.first, lost.last, lost.sequence) == ("lost", 1, event.sequence - 1, event.sequence - 1)
    assert client.ack_fence(name, "alarm", 6).lost == lost.last


def test_cancelling_events_can_be_left_out(client: HullClient, name: str) -> None:
    client.create_fence(name, area=SQUARE, subjects=name, initial="none")
    pass_through(client, name, ["a", "b"])
    client.put(name, ["c"], [[1, 1]])
    with client.watch_fence(name, after=0, conflate=True) as watch:
        event = next(watch)
    assert (event.key, event.sequence, event.conflated, event.after) == ("c", 5, 4, 5)


def test_where_a_watch_continues_from_which_events_were_left_out(client: HullClient, name: str) -> None:
    """Not behind the sequences of its events: those left out lie around them."""
    client.create_fence(name, area=SQUARE, subjects=name, initial="none")
    for keys, place in (("a", 1), ("a", 9), ("b", 1), ("c", 1), ("a", 1)):
        client.put(name, [keys], [[place, place]])
    with client.watch_fence(name, after=1, conflate=True) as watch:
        assert [(event.key, event.sequence, event.after) for event in (next(watch), next(watch))] == [
            ("b", 3, None),
            ("c", 4, 5),
        ]
    client.put(name, ["a"], [[9, 9]])
    with client.watch_fence(name, after=5, conflate=True) as watch:
        event = next(watch)
    assert (event.type, event.key, event.after) == ("exit", "a", 6)
