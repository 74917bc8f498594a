"""Keys that one batch moves between hulls of a prefix are subjects that move."""

from itertools import count

import grpc
import pytest
from fence_calls import create, events, polygon, put, puts
from patience import wait_until
from server_process import server_process
from set_time import SetTime

from dynhull_proto.v1 import batch_pb2, fence_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

SQUARE = (0, 0, 4, 0, 4, 4, 0, 4)
NUMBERS = count()
HOUR, SECOND = 3600, 1_000_000


@pytest.fixture(scope="module")
def clock(tmp_path_factory):
    return SetTime(tmp_path_factory.mktemp("transfers"))


@pytest.fixture(scope="module")
def address(clock):
    with server_process(wrap=clock.wrap) as server:
        yield server.address


@pytest.fixture
def stub(channel):
    return HullServiceStub(channel)


@pytest.fixture
def fences(channel):
    return FenceServiceStub(channel)


@pytest.fixture
def at(stub):
    """The common beginning of the names of two hulls with keys, yard and road."""
    prefix = f"transfers{next(NUMBERS)}/"
    for name in ("yard", "road"):
        stub.CreateHull(pb.CreateHullRequest(name=prefix + name, config={"identity": "IDENTITY_STRING_KEYS"}))
    return prefix


def removes(*keys):
    return batch_pb2.Batch(removes=points_pb2.Keys(strings=keys))


def together(stub, **batches):
    batches = [pb.HullBatch(name=name, batch=batch) for name, batch in batches.items()]
    return [result.revision for result in stub.ApplyTogether(pb.ApplyTogetherRequest(batches=batches)).results]


def transfer(stub, at, source, target, **positions):
    """The revisions of both hulls."""
    return together(stub, **{at + source: removes(*positions), at + target: puts(**positions)})


def lines(fences, fence, at, after=0):
    """Type, hulls, key, causes, positions and revisions."""
    return [
        (
            fence_pb2.FenceEventType.Name(event.type).removeprefix("FENCE_EVENT_TYPE_").lower(),
            event.previous_hull.removeprefix(at),
            event.subject_hull.removeprefix(at),
            event.string_key,
            [fence_pb2.FenceCause.Name(cause).removeprefix("FENCE_CAUSE_").lower() for cause in event.causes],
            (event.previous_position.x, event.previous_position.y) if event.HasField("previous_position") else None,
            (event.position.x, event.position.y) if event.HasField("position") else None,
        )
        for event in events(fences, fence, after)
    ]


def test_a_key_that_changes_hulls_is_one_subject(stub, fences, at):
    fence = at + "gate"
    put(stub, at + "yard", van=(1, 1))
    create(
        fences,
        fence,
        polygon_area=polygon(SQUARE),
        subject_prefix=at,
        report_crosses=True,
        initial="FENCE_INITIAL_NONE",
    )
    from_yard, to_road = transfer(stub, at, "yard", "road", van=(2, 2))
    transfer(stub, at, "road", "yard", van=(9, 9))
    transfer(stub, at, "yard", "road", van=(3, 3))
    transfer(stub, at, "road", "yard", van=(-5, 2))
    transfer(stub, at, "yard", "road", van=(9, 2))
    moved = ["subject_moved"]
    assert lines(fences, fence, at) == [
        ("transfer", "yard", "road", "van", moved, (1, 1), (2, 2)),
        ("exit", "road", "yard", "van", moved, (2, 2), (9, 9)),
        ("enter", "yard", "road", "van", moved, (9, 9), (3, 3)),
        ("exit", "road", "yard", "van", moved, (3, 3), (-5, 2)),
        ("cross", "yard", "road", "van", moved, (-5, 2), (9, 2)),
    ]
    first, second, *_ = events(fences, fence)
    assert (first.previous_hull_revision, first.subject_revision) == (from_yard, to_road)
    assert first.distance == 0
    assert second.distance == pytest.approx(50**0.5)


def test_the_state_goes_over_with_the_margin(stub, fences, at):
    fence = at + "gate"
    put(stub, at + "yard", inner=(1, 1), outer=(5, 1))
    config = {"polygon_area": polygon(SQUARE), "subject_prefix": at, "margin": 2, "initial": "FENCE_INITIAL_NONE"}
    create(fences, fence, **config)
    transfer(stub, at, "yard", "road", inner=(5, 1), outer=(5, 1))
    put(stub, at + "road", inner=(5, 2), outer=(5, 2))
    put(stub, at + "road", inner=(6.5, 2))
    assert [line[:4] for line in lines(fences, fence, at)] == [
        ("transfer", "yard", "road", "inner"),
        ("exit", "", "road", "inner"),
    ]
    assert events(fences, fence)[0].distance == 1


def test_both_sides_change_in_one_batch(stub, fences, at):
    fence, zone = at + "gate", at + "zone"
    stub.CreateHull(pb.CreateHullRequest(name=zone))
    stub.Apply(pb.ApplyRequest(name=zone, batch=batch_pb2.Batch(inserts=points_pb2.Points(coordinates=SQUARE))))
    put(stub, at + "yard", van=(1, 1))
    create(fences, fence, hull_area={"name": zone}, subject_prefix=at, initial="FENCE_INITIAL_NONE")
    smaller = batch_pb2.Batch(deletes=points_pb2.Points(coordinates=(0, 0)))
    together(stub, **{at + "yard": removes("van"), at + "road": puts(van=(1, 1)), zone: smaller})
    assert lines(fences, fence, at) == [
        ("exit", "yard", "road", "van", ["subject_moved", "area_moved"], (1, 1), (1, 1))
    ]


def test_what_is_no_move_is_not_reported_as_one(stub, fences, at):
    """Separate batches, a key that was there already, and a fence around one hull only."""
    both, one = at + "both", at + "one"
    put(stub, at + "yard", van=(1, 1), bus=(1, 1), car=(1, 1))
    put(stub, at + "road", bus=(9, 9))
    for fence, subjects in ((both, {"subject_prefix": at}), (one, {"subject_hull": at + "road"})):
        create(fences, fence, polygon_area=polygon(SQUARE), initial="FENCE_INITIAL_NONE", **subjects)
    stub.Apply(pb.ApplyRequest(name=at + "yard", batch=removes("van")))
    put(stub, at + "road", van=(2, 2))
    transfer(stub, at, "yard", "road", bus=(2, 2), car=(2, 2))
    new, moved, gone = ["subject_appeared"], ["subject_moved"], ["subject_removed"]
    assert lines(fences, both, at) == [
        ("exit", "", "yard", "van", gone, (1, 1), None),
        ("enter", "", "road", "van", new, None, (2, 2)),
        ("enter", "", "road", "bus", moved, (9, 9), (2, 2)),
        ("transfer", "yard", "road", "car", moved, (1, 1), (2, 2)),
        ("exit", "", "yard", "bus", gone, (1, 1), None),
    ]
    assert lines(fences, one, at) == [
        ("enter", "", "road", "van", new, None, (2, 2)),
        ("enter", "", "road", "bus", moved, (9, 9), (2, 2)),
        ("enter", "", "road", "car", new, None, (2, 2)),
    ]


def test_reports_that_confirm_go_over(stub, fences, at):
    fence = at + "gate"
    put(stub, at + "yard", van=(1, 1), bus=(1, 1))
    config = {"polygon_area": polygon(SQUARE), "subject_prefix": at, "confirmations": 3}
    create(fences, fence, initial="FENCE_INITIAL_NONE", **config)
    put(stub, at + "yard", van=(9, 1))
    transfer(stub, at, "yard", "road", van=(9, 2), bus=(9, 2))
    assert [line[:4] for line in lines(fences, fence, at)] == [
        ("transfer", "yard", "road", "bus"),
        ("transfer", "yard", "road", "van"),
    ]
    transfer(stub, at, "road", "yard", van=(9, 3), bus=(2, 2))
    assert [line[:4] for line in lines(fences, fence, at, after=2)] == [
        ("transfer", "road", "yard", "bus"),
        ("exit", "road", "yard", "van"),
    ]
    confirmed = events(fences, fence)[3]
    assert confirmed.first_time.ToMicroseconds() < confirmed.time.ToMicroseconds()


def test_time_that_confirms_goes_over(stub, fences, at, clock):
    """Who waits in one hull waits on in the other, and since the same time."""
    fence = at + "gate"
    put(stub, at + "yard", van=(9, 1), bus=(1, 1))
    config = {"polygon_area": polygon(SQUARE), "subject_prefix": at, "min_dwell": {"seconds": HOUR}}
    create(fences, fence, initial="FENCE_INITIAL_NONE", **config)
    begun = clock.now() - SECOND
    put(stub, at + "yard", van=(1, 1), bus=(9, 1))
    ended = clock.now() + SECOND
    clock.passes(HOUR / 2)
    transfer(stub, at, "yard", "road", van=(2, 1), bus=(9, 2))
    clock.passes(HOUR / 2)
    wait_until(lambda: len(events(fences, fence)) == 3)
    assert [line[:4] for line in lines(fences, fence, at)] == [
        ("transfer", "yard", "road", "bus"),
        ("exit", "", "road", "bus"),
        ("enter", "", "road", "van"),
    ]
    for event in events(fences, fence)[1:]:
        assert begun <= event.first_time.ToMicroseconds() <= ended
        assert event.time.ToMicroseconds() - event.first_time.ToMicroseconds() >= HOUR * SECOND


def test_a_batch_that_is_refused_moves_nobody(stub, fences, at):
    fence = at + "gate"
    put(stub, at + "yard", van=(1, 1))
    create(fences, fence, polygon_area=polygon(SQUARE), subject_prefix=at, initial="FENCE_INITIAL_NONE")
    with pytest.raises(grpc.RpcError):
        together(stub, **{at + "yard": removes("van"), at + "elsewhere": puts(van=(2, 2))})
    transfer(stub, at, "yard", "road", van=(2, 2))
    assert [line[:4] for line in lines(fences, fence, at)] == [("transfer", "yard", "road", "van")]
