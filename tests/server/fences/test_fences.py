"""Fences through a real channel: who is inside, events, watches, consumers, and what is refused."""

from collections.abc import Iterator
from pathlib import Path

import grpc
import pytest
from fence_calls import (
    create,
    delete,
    events,
    insert,
    inside,
    points,
    polygon,
    put,
    puts,
    refused_by,
    remove,
    told,
)
from metrics import measured, scrape
from patience import PATIENCE, wait_until
from server_process import server_process

from dynhull_proto.v1 import batch_pb2, fence_pb2
from dynhull_proto.v1 import fence_service_pb2 as fs
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

INVALID, FAILED, RANGE = (
    grpc.StatusCode.INVALID_ARGUMENT,
    grpc.StatusCode.FAILED_PRECONDITION,
    grpc.StatusCode.OUT_OF_RANGE,
)
SQUARE = [0.0, 0.0, 10.0, 0.0, 10.0, 10.0, 0.0, 10.0]


@pytest.fixture(scope="module", params=["memory", "durable"])
def server(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    options = [] if request.param == "memory" else ["--data", str(tmp_path_factory.mktemp("fences"))]
    with server_process(*options) as process:
        yield process.address


@pytest.fixture
def address(server: str) -> str:
    """Of a server whose commits are immediate, and of one whose commits take time."""
    return server


@pytest.fixture
def fences(channel: grpc.Channel) -> FenceServiceStub:
    return FenceServiceStub(channel)


@pytest.fixture
def fleet(stub: HullServiceStub, name: str) -> str:
    """The name of a hull with string keys."""
    stub.CreateHull(pb.CreateHullRequest(name=f"{name}/fleet", config={"identity": "IDENTITY_STRING_KEYS"}))
    return f"{name}/fleet"


@pytest.fixture
def zone(stub: HullServiceStub, name: str) -> str:
    """The name of a hull of points: the square from (0, 0) to (10, 10)."""
    stub.CreateHull(pb.CreateHullRequest(name=f"{name}/zone"))
    insert(stub, f"{name}/zone", *SQUARE)
    return f"{name}/zone"


def test_subjects_enter_and_leave_a_polygon_with_a_hole(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    put(stub, fleet, a=(1, 1), b=(20, 20), c=(5, 5))
    hole = [4.0, 4.0, 6.0, 4.0, 6.0, 6.0, 4.0, 6.0]
    made = create(fences, name, polygon_area=polygon(SQUARE, hole), subject_hull=fleet)
    assert (made.last_sequence, made.inside_count, made.subject_count) == (1, 1, 3)
    revision = put(stub, fleet, a=(5, 5), b=(10, 10), d=(2, 2))
    put(stub, fleet, c=(4, 5))  # the boundary of a hole belongs to a closed area
    remove(stub, fleet, "d")
    found = events(fences, name)
    assert [told(event) for event in found] == [
        "SNAPSHOT FENCE_CREATED",
        "EXIT a SUBJECT_MOVED",
        "ENTER b SUBJECT_MOVED",
        "ENTER d SUBJECT_APPEARED",
        "ENTER c SUBJECT_MOVED",
        "EXIT d SUBJECT_REMOVED",
    ]
    snapshot, left, entered, appeared, _, removed = found
    assert [(each.hull, each.keys.text, each.revision) for each in snapshot.inside] == [(fleet, b"a", revision - 1)]
    assert (left.position.x, left.previous_position.x, left.distance) == (5, 1, 1.0)
    assert (entered.subject_revision, entered.area_revision, entered.distance) == (revision, 0, 0.0)
    assert not appeared.HasField("previous_position")
    assert not removed.HasField("position")
    assert not removed.HasField("distance")
    assert (removed.previous_position.x, removed.subject_hull) == (2, fleet)
    assert inside(fences, name) == ["b", "c"]


def test_either_side_may_move(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str, zone: str
) -> None:
    put(stub, fleet, a=(9, 9), b=(12, 5))
    create(fences, name, hull_area={"name": zone}, subject_hull=fleet, initial="FENCE_INITIAL_EVENTS")
    area_revision = insert(stub, zone, 20, 5)
    delete(stub, zone, 10, 10)
    both = pb.ApplyTogetherRequest(
        batches=[
            pb.HullBatch(name=fleet, batch=puts(a=(0, 0))),
            pb.HullBatch(name=zone, batch=batch_pb2.Batch(inserts=points(-5, -5), deletes=points(20, 5))),
        ]
    )
    stub.ApplyTogether(both)
    found = events(fences, name)
    assert [told(event) for event in found] == [
        "ENTER a FENCE_CREATED",
        "ENTER b AREA_MOVED",
        "EXIT a AREA_MOVED",
        "ENTER a SUBJECT_MOVED AREA_MOVED",
        "EXIT b AREA_MOVED",
    ]
    assert [event.area_revision for event in found] == [1, area_revision, 3, 4, 4]
    delete(stub, zone, 0, 0, 10, 0, 0, 10, -5, -5)
    (gone,) = events(fences, name, after=5)
    assert told(gone) == "EXIT a AREA_MOVED"
    assert gone.distance == float("inf")


def test_a_margin_keeps_subjects_inside(stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str) -> None:
    create(fences, name, circle_area={"radius": 5}, subject_hull=fleet, margin=1, initial="FENCE_INITIAL_NONE")
    for x in (5.5, 5, 6, 6.25, 5.5):
        put(stub, fleet, a=(x, 0))
    assert [(told(event), event.position.x) for event in events(fences, name)] == [
        ("ENTER a SUBJECT_MOVED", 5),
        ("EXIT a SUBJECT_MOVED", 6.25),
    ]
    assert inside(fences, name) == []


def test_a_replaced_area_says_so(stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str) -> None:
    put(stub, fleet, a=(1, 1), b=(20, 20))
    create(fences, name, circle_area={"radius": 5}, subject_hull=fleet, initial="FENCE_INITIAL_NONE")
    config = {"circle_area": {"radius": 5}, "subject_hull": fleet, "initial": "FENCE_INITIAL_NONE"}
    assert fences.ReplaceFence(fs.ReplaceFenceRequest(name=name, config=config)).fence.last_sequence == 0
    config["circle_area"] = {"center_x": 20, "center_y": 20, "radius": 5}
    replaced = fences.ReplaceFence(fs.ReplaceFenceRequest(name=name, config=config)).fence
    assert (replaced.last_sequence, replaced.config.circle_area.center_x) == (2, 20)
    assert [told(event) for event in events(fences, name)] == ["EXIT a FENCE_CHANGED", "ENTER b FENCE_CHANGED"]
    put(stub, fleet, a=(20, 20))
    assert inside(fences, name) == ["a", "b"]


def test_without_self_says_who_leaves_the_pack(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    put(stub, fleet, a=(0, 0), b=(1, 0), c=(0, 1), d=(1, 1), e=(2, 2))
    area = {"name": fleet, "without_self": True}
    create(fences, name, hull_area=area, subject_hull=fleet, margin=3, initial="FENCE_INITIAL_NONE")
    assert inside(fences, name) == ["d"]  # the others are vertices
    put(stub, fleet, e=(0.5, 0.5))
    put(stub, fleet, e=(9, 9))
    assert [told(event) for event in events(fences, name)] == [
        "ENTER e SUBJECT_MOVED AREA_MOVED",
        "EXIT e SUBJECT_MOVED AREA_MOVED",
    ]


def test_a_watch_goes_on_with_new_events_and_ends_with_the_fence(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    made = create(fences, name, circle_area={"radius": 5}, subject_hull=fleet)
    watch = fences.WatchFence(fs.WatchFenceRequest(name=name, only_new=True), timeout=PATIENCE)
    first = next(watch)
    assert (first.uid, first.sequence, list(first.events)) == (made.uid, 1, [])
    put(stub, fleet, a=(1, 1))
    (entered,) = next(watch).events
    assert told(entered) == "ENTER a SUBJECT_APPEARED"
    fences.DeleteFence(fs.DeleteFenceRequest(name=name))
    (closed,) = next(watch).events
    assert told(closed) == "CLOSED "
    assert [each.keys.text for each in closed.inside] == [b"a"]
    assert list(watch) == []
    assert refused_by(fences.GetFence, fs.GetFenceRequest(name=name)).reason == "FENCE_NOT_FOUND"
    stub.DeleteHull(pb.DeleteHullRequest(name=fleet))  # nothing depends on it any more


def test_a_consumer_continues_where_it_acknowledged(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    create(fences, name, circle_area={"radius": 5}, subject_hull=fleet)
    for x in (1, 9, 2, 8):
        put(stub, fleet, a=(x, 0))
    watch = fences.WatchFence(fs.WatchFenceRequest(name=name, consumer="mail"), timeout=PATIENCE)
    assert next(watch).sequence == 0
    assert [event.sequence for event in next(watch).events] == [1, 2, 3, 4, 5]
    watch.cancel()
    consumer = fences.AckFence(fs.AckFenceRequest(name=name, consumer="mail", sequence=3)).consumer
    assert (consumer.acknowledged_sequence, consumer.backlog, consumer.lost) == (3, 2, 0)
    assert consumer.HasField("oldest_event_time")
    again = fences.WatchFence(fs.WatchFenceRequest(name=name, consumer="mail"), timeout=PATIENCE)
    assert next(again).sequence == 3
    assert [event.sequence for event in next(again).events] == [4, 5]
    again.cancel()
    assert fences.AckFence(fs.AckFenceRequest(name=name, consumer="mail", sequence=1)).consumer.backlog == 2
    ahead = refused_by(fences.AckFence, fs.AckFenceRequest(name=name, consumer="mail", sequence=6))
    assert (ahead.code, ahead.reason) == (RANGE, "SEQUENCE_AHEAD")
    (listed,) = fences.GetFence(fs.GetFenceRequest(name=name)).fence.consumers
    assert (listed.name, listed.acknowledged_sequence) == ("mail", 3)
    fences.DeleteConsumer(fs.DeleteConsumerRequest(name=name, consumer="mail"))
    missing = refused_by(fences.DeleteConsumer, fs.DeleteConsumerRequest(name=name, consumer="mail"))
    assert missing.reason == "CONSUMER_NOT_FOUND"


def test_conflated_watches_leave_out_what_cancels(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    create(fences, name, circle_area={"radius": 5}, subject_hull=fleet, initial="FENCE_INITIAL_NONE")
    for x in (1, 9, 2):
        put(stub, fleet, a=(x, 0), b=(x if x != 2 else 9, 1))
    watch = fences.WatchFence(fs.WatchFenceRequest(name=name, after_sequence=0, conflate=True), timeout=PATIENCE)
    next(watch)
    response = next(watch)
    watch.cancel()
    assert [told(event) for event in response.events] == ["ENTER a SUBJECT_MOVED"]
    assert (response.conflated, response.sequence) == (4, 5)


def test_few_events_are_sent_together_unless_they_may_cancel_each_other(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    """Whoever passes them on to a reader that does not read holds no more of a thousand."""
    create(fences, name, circle_area={"radius": 5}, subject_hull=fleet, initial="FENCE_INITIAL_NONE")
    put(stub, fleet, **{f"truck-{row}": (1.0, 1.0) for row in range(1000)})
    for conflate, together in ((False, 250), (True, 1000)):
        request = fs.WatchFenceRequest(name=name, after_sequence=0, conflate=conflate)
        watch = fences.WatchFence(request, timeout=PATIENCE)
        sizes: list[int] = []
        while sum(sizes) < 1000:
            sizes.append(len(next(watch).events))
        assert max(sizes) == together
        watch.cancel()


def test_fences_are_listed_by_name(fences: FenceServiceStub, name: str, fleet: str) -> None:
    names = [f"{name}/{letter}" for letter in "bca"]
    for each in names:
        create(fences, each, circle_area={"radius": 1}, subject_hull=fleet)
    page = fences.ListFences(fs.ListFencesRequest(prefix=f"{name}/", page_size=2))
    rest = fences.ListFences(fs.ListFencesRequest(prefix=f"{name}/", page_token=page.next_page_token))
    assert [fence.name for fence in [*page.fences, *rest.fences]] == sorted(names)
    assert rest.next_page_token == ""


def test_a_hull_that_a_fence_depends_on_stays(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str, zone: str
) -> None:
    create(fences, name, hull_area={"name": zone}, subject_hull=fleet)
    for hull in (zone, fleet):
        refused = refused_by(stub.DeleteHull, pb.DeleteHullRequest(name=hull))
        assert (refused.code, refused.reason, refused.metadata["fence"]) == (FAILED, "HULL_FENCED", name)
    exists = refused_by(
        fences.CreateFence,
        fs.CreateFenceRequest(name=name, config={"circle_area": {"radius": 1}, "subject_hull": fleet}),
    )
    assert exists.reason == "FENCE_EXISTS"


@pytest.mark.parametrize(
    ("config", "field", "value"),
    [
        ({}, "config", "no subjects"),
        ({"subject_hull": "{fleet}"}, "config", "no area"),
        ({"circle_area": {"radius": -1}}, "config.circle_area.radius", "-1.0"),
        ({"circle_area": {"center_x": float("nan")}}, "config.circle_area.center_x", "nan"),
        ({"circle_area": {}, "margin": float("inf")}, "config.margin", "inf"),
        ({"circle_area": {}, "boundary": 7}, "config.boundary", "7"),
        ({"circle_area": {}, "initial": 9}, "config.initial", "9"),
        ({"circle_area": {}, "near_distance": 1}, "config.near_distance", "1.0"),
        ({"polygon_area": {}}, "config.polygon_area.polygons", "0 polygons"),
        ({"hull_area": {"name": "a b"}}, "config.hull_area.name", "a b"),
        ({"hull_area": {"name": "{fleet}", "without_self": True}}, "config.margin", "0.0"),
        ({"hull_area": {"name": "other", "without_self": True}}, "config.hull_area.without_self", "true"),
        (
            {"polygon_area": polygon(SQUARE, [1, 1, 2, 2, 2, 1, 1, 2])},
            "config.polygon_area.polygons[0].holes[0]",
            "4 corners",
        ),
        ({"polygon_area": polygon([0, 0, 1, 1, 2, 2])}, "config.polygon_area.polygons[0].exterior", "3 corners"),
        (
            {"polygon_area": polygon([0, 0, 1, 1, 2])},
            "config.polygon_area.polygons[0].exterior.coordinates",
            "5 coordinates",
        ),
    ],
)
def test_settings_that_are_refused(
    fences: FenceServiceStub, name: str, fleet: str, config: dict[str, object], field: str, value: str
) -> None:
    if config:
        config = {"subject_hull": fleet} | config
    for area in (config.get("hull_area"),):
        if isinstance(area, dict) and area["name"] == "{fleet}":
            config["hull_area"] = {**area, "name": fleet}
    if config.get("subject_hull") == "{fleet}":
        config["subject_hull"] = fleet
    refused = refused_by(fences.CreateFence, fs.CreateFenceRequest(name=name, config=config or {"margin": 1}))
    assert (refused.code, refused.metadata["field"], refused.metadata["value"]) == (INVALID, field, value)
    assert refused_by(fences.GetFence, fs.GetFenceRequest(name=name)).reason == "FENCE_NOT_FOUND"


def test_hulls_that_are_missing_or_have_no_keys_are_refused(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, zone: str, fleet: str
) -> None:
    circle = {"radius": 1}
    missing = refused_by(
        fences.CreateFence,
        fs.CreateFenceRequest(name=name, config={"circle_area": circle, "subject_hull": f"{name}/no"}),
    )
    assert (missing.reason, missing.metadata["value"]) == ("HULL_NOT_FOUND", f"{name}/no")
    keyless = refused_by(
        fences.CreateFence, fs.CreateFenceRequest(name=name, config={"circle_area": circle, "subject_hull": zone})
    )
    assert (keyless.reason, keyless.metadata["field"]) == ("HULL_UNSUITABLE", "config.subject_hull")
    insert(stub, zone, 1, 1)  # it is as before
    put(stub, fleet, a=(1, 1))


def test_fences_survive_a_kill(tmp_path: Path, name: str) -> None:
    """Sides that depend on the way, events, consumers and their acknowledgements."""
    fence, fleet = f"{name}/fence", f"{name}/fleet"
    with server_process("--data", str(tmp_path), killed=True) as server:
        with grpc.insecure_channel(server.address) as channel:
            stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
            stub.CreateHull(pb.CreateHullRequest(name=fleet, config={"identity": "IDENTITY_STRING_KEYS"}))
            put(stub, fleet, a=(1, 0), b=(9, 0))
            made = create(fences, fence, circle_area={"radius": 5}, subject_hull=fleet, margin=1)
            put(stub, fleet, a=(5.5, 0), c=(5.5, 0))
            put(stub, fleet, b=(3, 0))
            fences.AckFence(fs.AckFenceRequest(name=fence, consumer="mail", sequence=1))
            before = events(fences, fence)
        server.process.kill()
    with server_process("--data", str(tmp_path)) as server, grpc.insecure_channel(server.address) as channel:
        stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
        again = fences.GetFence(fs.GetFenceRequest(name=fence)).fence
        assert (again.uid, again.config, again.create_time) == (made.uid, made.config, made.create_time)
        assert (again.last_sequence, again.inside_count, again.consumers[0].acknowledged_sequence) == (2, 2, 1)
        assert events(fences, fence) == before
        assert inside(fences, fence) == ["a", "b"]  # c is as far, but never entered
        put(stub, fleet, a=(5.75, 0), c=(5.75, 0), b=(6.5, 0))
        (left,) = events(fences, fence, after=2)
        assert told(left) == "EXIT b SUBJECT_MOVED"
        assert left.time.ToMicroseconds() >= before[-1].time.ToMicroseconds()


def test_a_prefix_takes_in_hulls_that_come_and_go(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    put(stub, fleet, a=(1, 1), b=(9, 9))
    made = create(fences, name, circle_area={"radius": 5}, subject_prefix=f"{name}/", margin=1)
    assert (made.subject_count, made.inside_count) == (2, 1)
    other = f"{name}/other"
    stub.CreateHull(pb.CreateHullRequest(name=other, config={"identity": "IDENTITY_STRING_KEYS"}))
    stub.CreateHull(pb.CreateHullRequest(name=f"{name}/points"))  # has no keys
    put(stub, other, a=(2, 2), c=(8, 8))
    put(stub, fleet, b=(0, 0))
    stub.DeleteHull(pb.DeleteHullRequest(name=other))
    found = events(fences, name, after=1)
    assert [(told(event), event.subject_hull) for event in found] == [
        ("ENTER a SUBJECT_APPEARED", other),
        ("ENTER b SUBJECT_MOVED", fleet),
        ("EXIT a SUBJECT_REMOVED", other),
    ]
    assert not found[2].HasField("position")
    assert found[2].previous_position.x == 2
    assert fences.GetFence(fs.GetFenceRequest(name=name)).fence.subject_count == 2
    missing = refused_by(stub.GetHull, pb.GetHullRequest(name=f"{name}/nobody"))
    assert missing.reason == "HULL_NOT_FOUND"


def test_hulls_as_wholes_begin_and_cease_to_be_near(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, zone: str, fleet: str
) -> None:
    for fence, near in ((f"{name}/meet", 0), (f"{name}/near", 2)):
        create(fences, fence, hull_area={"name": zone}, other_hull=fleet, near_distance=near)
    put(stub, fleet, a=(13, 5))
    put(stub, fleet, a=(12, 5))
    insert(stub, zone, 12, 5)
    delete(stub, zone, 12, 5)
    remove(stub, fleet, "a")
    met, near = (events(fences, f"{name}/{each}", after=1) for each in ("meet", "near"))
    assert [told(event) for event in met] == ["BEGIN AREA_MOVED", "CEASE AREA_MOVED"]
    assert [told(event) for event in near] == ["BEGIN SUBJECT_MOVED", "CEASE SUBJECT_MOVED"]
    assert [event.distance for event in (*met, *near)] == [0.0, 2.0, 2.0, float("inf")]
    assert {event.subject_hull for event in met} == {fleet}
    keys = (
        fences.CreateFence,
        fs.CreateFenceRequest(
            name=f"{name}/bad", config={"hull_area": {"name": zone}, "other_hull": fleet, "margin": 1}
        ),
    )
    assert refused_by(*keys).metadata["field"] == "config.margin"


def test_old_events_are_dropped_and_consumers_hear_of_it(tmp_path: Path, name: str) -> None:
    """What had to go is counted for each consumer, and a watch says which events it lacks."""
    fence, fleet = f"{name}/fence", f"{name}/fleet"
    with server_process("--data", str(tmp_path)) as server, grpc.insecure_channel(server.address) as channel:
        stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name=fleet, config={"identity": "IDENTITY_STRING_KEYS"}))
        create(fences, fence, circle_area={"radius": 5}, subject_hull=fleet, max_events=3)
        put(stub, fleet, a=(1, 0))
        fences.AckFence(fs.AckFenceRequest(name=fence, consumer="mail", sequence=2))
        for x in (9, 2, 8, 3, 7):
            put(stub, fleet, a=(x, 0))
        wait_until(lambda: fences.GetFence(fs.GetFenceRequest(name=fence)).fence.first_sequence == 5)
    with server_process("--data", str(tmp_path)) as server, grpc.insecure_channel(server.address) as channel:
        fences = FenceServiceStub(channel)
        found = fences.GetFence(fs.GetFenceRequest(name=fence)).fence
        assert (found.first_sequence, found.last_sequence) == (5, 7)
        assert [(each.lost, each.backlog) for each in found.consumers] == [(2, 3)]
        watch = fences.WatchFence(fs.WatchFenceRequest(name=fence, consumer="mail"), timeout=PATIENCE)
        assert next(watch).sequence == 2
        response = next(watch)
        watch.cancel()
        assert (response.lost.first_sequence, response.lost.last_sequence) == (3, 4)
        assert [event.sequence for event in response.events] == [5, 6, 7]
        assert inside(fences, fence) == []


def test_a_watch_says_that_all_events_were_dropped(name: str) -> None:
    with server_process() as server, grpc.insecure_channel(server.address) as channel:
        stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name=name, config={"identity": "IDENTITY_STRING_KEYS"}))
        create(fences, name, circle_area={"radius": 5}, subject_hull=name, max_event_age={"nanos": 1000})
        put(stub, name, a=(1, 0))
        wait_until(lambda: fences.GetFence(fs.GetFenceRequest(name=name)).fence.first_sequence == 3)
        watch = fences.WatchFence(fs.WatchFenceRequest(name=name, after_sequence=0), timeout=PATIENCE)
        assert next(watch).sequence == 0
        response = next(watch)
        watch.cancel()
    assert (response.sequence, response.lost.first_sequence, response.lost.last_sequence) == (2, 1, 2)


def test_batches_to_fenced_hulls_use_up_no_hulls(name: str) -> None:
    with server_process("--max-hulls", "2") as server, grpc.insecure_channel(server.address) as channel:
        stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name=name, config={"identity": "IDENTITY_STRING_KEYS"}))
        create(fences, name, circle_area={"radius": 5}, subject_hull=name)
        put(stub, name, a=(1, 0))
        stub.CreateHull(pb.CreateHullRequest(name=f"{name}/second"))
        assert refused_by(stub.CreateHull, pb.CreateHullRequest(name=f"{name}/third")).metadata["limit"] == "max_hulls"


def test_events_that_have_become_too_old_are_dropped_without_a_new_one(name: str) -> None:
    with server_process() as server, grpc.insecure_channel(server.address) as channel:
        stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name=name, config={"identity": "IDENTITY_STRING_KEYS"}))
        settings = {"circle_area": {"radius": 5}, "subject_hull": name, "initial": fence_pb2.FENCE_INITIAL_NONE}
        create(fences, name, **settings)
        put(stub, name, a=(1, 0))
        replaced = fence_pb2.FenceConfig(**settings, max_event_age={"seconds": 1})
        fences.ReplaceFence(fs.ReplaceFenceRequest(name=name, config=replaced))
        wait_until(lambda: fences.GetFence(fs.GetFenceRequest(name=name)).fence.first_sequence == 2)
        put(stub, name, b=(1, 0))
        wait_until(lambda: fences.GetFence(fs.GetFenceRequest(name=name)).fence.first_sequence == 3)


def test_metrics_of_fences(name: str) -> None:
    with (
        measured() as (server, metrics),
        grpc.insecure_channel(server.address) as channel,
    ):
        stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name=name, config={"identity": "IDENTITY_STRING_KEYS"}))
        create(fences, name, circle_area={"radius": 5}, subject_hull=name)
        fences.AckFence(fs.AckFenceRequest(name=name, consumer="mail", sequence=1))
        for x in (1, 9, 2):
            put(stub, name, a=(x, 0))
        found = scrape(metrics)
    assert found['dynhull_fence_events_total{type="enter"}'] == 2
    assert found['dynhull_fence_events_total{type="exit"}'] == 1
    assert (found["dynhull_fences"], found["dynhull_fence_inside"]) == (1, 1)
    assert found[f'dynhull_fence_backlog{{fence="{name}"}}'] == 3
    assert found[f'dynhull_fence_backlog_oldest_seconds{{fence="{name}"}}'] >= 0
    assert found[f'dynhull_fence_lost_events{{fence="{name}"}}'] == 0
