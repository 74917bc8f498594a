"""Fences that wait, over kills and restarts: `dwell`, and events delayed by `confirmations` and `min_dwell`."""

from collections.abc import Iterator
from pathlib import Path

import grpc
import pytest
from fence_calls import create, delete, events, insert, inside, polygon, put, refused_by, remove, told
from patience import PATIENCE, wait_until
from server_process import server_process
from set_time import SetTime

from dynhull_proto.v1 import batch_pb2, fence_pb2, points_pb2
from dynhull_proto.v1 import fence_service_pb2 as fs
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

CIRCLE = {"radius": 5}
SECOND = 1_000_000
MANY = 5000  # more than make an event in one commit
# Seconds that a subject stays, and longer than any test takes: they pass when a test says so.
STAY, LONG, WHILE = 3600, 3000, 300


@pytest.fixture(scope="module", params=["memory", "durable"])
def timed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, SetTime]]:
    """The address of a server, and its time."""
    folder = tmp_path_factory.mktemp("rules")
    clock = SetTime(folder)
    options = [] if request.param == "memory" else ["--data", str(folder / "data")]
    with server_process(*options, wrap=clock.wrap) as process:
        yield process.address, clock


@pytest.fixture
def address(timed: tuple[str, SetTime]) -> str:
    return timed[0]


@pytest.fixture
def clock(timed: tuple[str, SetTime]) -> SetTime:
    return timed[1]


@pytest.fixture
def fences(channel: grpc.Channel) -> FenceServiceStub:
    return FenceServiceStub(channel)


@pytest.fixture
def fleet(stub: HullServiceStub, name: str) -> str:
    return keyed(stub, f"{name}/fleet")


def keyed(stub: HullServiceStub, hull: str) -> str:
    stub.CreateHull(pb.CreateHullRequest(name=hull, config={"identity": "IDENTITY_STRING_KEYS"}))
    return hull


def span(seconds: float) -> dict[str, int]:
    return {"seconds": int(seconds), "nanos": round(seconds % 1 * 1e9)}


def waited(fences: FenceServiceStub, fence: str, last: int, after: int = 0) -> list[fence_pb2.FenceEvent]:
    """The events of a fence after a sequence, once it has this many."""
    wait_until(lambda: fences.GetFence(fs.GetFenceRequest(name=fence)).fence.last_sequence >= last)
    return events(fences, fence, after)


def dwells(found: list[fence_pb2.FenceEvent]) -> list[str]:
    return [event.string_key for event in found if event.type == fence_pb2.FENCE_EVENT_TYPE_DWELL]


def stayed(event: fence_pb2.FenceEvent) -> int:
    """The time from entering to the dwell event, in microseconds."""
    return event.time.ToMicroseconds() - event.first_time.ToMicroseconds()


def test_who_stays_inside_makes_one_event(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str
) -> None:
    create(fences, name, circle_area=CIRCLE, subject_hull=fleet, initial="FENCE_INITIAL_NONE", dwell=span(STAY))
    put(stub, fleet, a=(1, 0), b=(9, 0))
    revision = put(stub, fleet, a=(2, 0))  # it stays inside
    clock.passes(STAY)
    entered, dwelt = waited(fences, name, 2)
    assert [told(each) for each in (entered, dwelt)] == ["ENTER a SUBJECT_APPEARED", "DWELL a TIME_PASSED"]
    assert dwelt.first_time == entered.time
    assert stayed(dwelt) >= STAY * SECOND
    assert (dwelt.subject_hull, dwelt.subject_revision, dwelt.position.x, dwelt.distance) == (fleet, revision, 2, 0)
    assert not entered.HasField("first_time")
    put(stub, fleet, c=(1, 1))
    clock.passes(STAY)
    assert words(waited(fences, name, 4, after=2)) == ["ENTER c SUBJECT_APPEARED", "DWELL c TIME_PASSED"]
    put(stub, fleet, a=(9, 0))
    put(stub, fleet, a=(3, 0))
    clock.passes(STAY)
    found = waited(fences, name, 7, after=4)
    assert [told(each) for each in found] == [
        "EXIT a SUBJECT_MOVED",
        "ENTER a SUBJECT_MOVED",
        "DWELL a TIME_PASSED",
    ]
    assert found[2].first_time == found[1].time


def test_a_stay_that_breaks_off_begins_anew(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str
) -> None:
    create(fences, name, circle_area=CIRCLE, subject_hull=fleet, initial="FENCE_INITIAL_NONE", dwell=span(STAY))
    put(stub, fleet, a=(1, 0), b=(1, 1), c=(2, 2))
    clock.passes(LONG)
    put(stub, fleet, a=(9, 0))
    remove(stub, fleet, "b")
    put(stub, fleet, a=(1, 0))
    clock.passes(LONG)
    assert dwells(waited(fences, name, 7)) == ["c"]
    clock.passes(LONG)
    found = waited(fences, name, 8)
    assert dwells(found) == ["c", "a"]
    again = next(each for each in found[4:] if each.type == fence_pb2.FENCE_EVENT_TYPE_ENTER)
    assert found[-1].first_time == again.time
    assert stayed(found[-1]) >= STAY * SECOND


def test_conflated_watches_leave_out_stays_that_have_ended(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str
) -> None:
    create(fences, name, circle_area=CIRCLE, subject_hull=fleet, initial="FENCE_INITIAL_NONE", dwell=span(STAY))
    put(stub, fleet, a=(1, 0), b=(2, 0))
    clock.passes(STAY)
    waited(fences, name, 4)
    put(stub, fleet, a=(9, 0))
    watch = fences.WatchFence(fs.WatchFenceRequest(name=name, after_sequence=0, conflate=True), timeout=PATIENCE)
    next(watch)
    response = next(watch)
    watch.cancel()
    assert [told(event) for event in response.events] == ["ENTER b SUBJECT_APPEARED", "DWELL b TIME_PASSED"]
    assert (response.conflated, response.sequence) == (3, 5)


@pytest.mark.parametrize("initial", ["SNAPSHOT", "EVENTS", "NONE"])
def test_who_is_inside_at_first_counts_from_the_creation(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str, initial: str
) -> None:
    put(stub, fleet, a=(1, 0), b=(9, 0), c=(0, 1))
    before = clock.now()
    create(fences, name, circle_area=CIRCLE, subject_hull=fleet, initial=f"FENCE_INITIAL_{initial}", dwell=span(STAY))
    clock.passes(STAY)
    first = {"SNAPSHOT": 1, "EVENTS": 2, "NONE": 0}[initial]
    found = waited(fences, name, first + 2, after=first)
    assert dwells(found) == ["a", "c"]
    assert min(stayed(each) for each in found) >= STAY * SECOND
    assert all(each.first_time.ToMicroseconds() > before - SECOND for each in found)


def test_areas_that_move_end_and_begin_a_stay(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str
) -> None:
    zone = f"{name}/zone"
    stub.CreateHull(pb.CreateHullRequest(name=zone))
    insert(stub, zone, 0, 0, 10, 0, 10, 10, 0, 10)
    put(stub, fleet, a=(1, 1), b=(12, 5))
    create(fences, name, hull_area={"name": zone}, subject_prefix=f"{name}/", dwell=span(STAY))
    revision = insert(stub, zone, 15, 5)
    delete(stub, zone, 0, 0)
    clock.passes(STAY)
    found = waited(fences, name, 4, after=1)
    assert [told(each) for each in found] == ["ENTER b AREA_MOVED", "EXIT a AREA_MOVED", "DWELL b TIME_PASSED"]
    assert found[2].area_revision == revision + 1


@pytest.mark.parametrize("area", ["circle", "polygon", "hull"])
def test_with_a_margin_the_distance_is_that_to_the_area(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str, area: str
) -> None:
    zone = f"{name}/zone"
    square = [-5.0, -5.0, 5.0, -5.0, 5.0, 5.0, -5.0, 5.0]
    stub.CreateHull(pb.CreateHullRequest(name=zone))
    insert(stub, zone, *square)
    config = {
        "circle": {"circle_area": CIRCLE},
        "polygon": {"polygon_area": polygon(square)},
        "hull": {"hull_area": {"name": zone}},
    }[area]
    put(stub, fleet, a=(5, 0), b=(4, 0), c=(6.5, 0))
    create(fences, name, **config, subject_hull=fleet, margin=2, dwell=span(STAY), report_crosses=True)
    put(stub, fleet, a=(6.5, 0))
    clock.passes(STAY)
    found = waited(fences, name, 3, after=1)
    assert dwells(found) == ["a", "b"]
    assert [(each.position.x, each.distance) for each in found] == [(6.5, 1.5), (4, 0)]


def test_another_dwell_begins_anew_and_another_area_does_not(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str
) -> None:
    def replace(radius: float, dwell: float) -> None:
        config = {"circle_area": {"radius": radius}, "subject_hull": fleet, "dwell": span(dwell)}
        fences.ReplaceFence(fs.ReplaceFenceRequest(name=name, config=config))

    put(stub, fleet, a=(1, 0), b=(6, 0))
    create(fences, name, circle_area=CIRCLE, subject_hull=fleet)
    replace(5, STAY)
    clock.passes(STAY)
    (first,) = waited(fences, name, 2, after=1)
    assert told(first) == "DWELL a TIME_PASSED"
    replace(7, STAY)
    clock.passes(STAY)
    found = waited(fences, name, 4, after=2)
    assert [told(each) for each in found] == ["ENTER b FENCE_CHANGED", "DWELL b TIME_PASSED"]
    replace(7, LONG)
    clock.passes(LONG)
    again = waited(fences, name, 6, after=4)
    assert dwells(again) == ["a", "b"]
    assert again[0].first_time == again[1].first_time
    assert again[0].first_time.ToMicroseconds() >= found[1].time.ToMicroseconds()
    replace(7, 0)
    other = create(fences, f"{name}/dwells", circle_area=CIRCLE, subject_hull=fleet, dwell=span(LONG)).name
    put(stub, fleet, c=(0, 0))
    clock.passes(LONG)
    assert dwells(waited(fences, other, 4)) == ["a", "c"]
    assert [told(each) for each in events(fences, name, after=6)] == ["ENTER c SUBJECT_APPEARED"]


def test_many_that_stay_make_an_event_each(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    keys = [f"{number:04}" for number in range(MANY)]
    create(fences, name, circle_area=CIRCLE, subject_hull=fleet, initial="FENCE_INITIAL_NONE", dwell=span(0.2))
    batch = batch_pb2.Batch(
        puts=batch_pb2.Puts(keys=points_pb2.Keys(strings=keys), points=points_pb2.Points(coordinates=[1.0, 2.0] * MANY))
    )
    stub.Apply(pb.ApplyRequest(name=fleet, batch=batch))
    found = waited(fences, name, 2 * MANY, after=MANY)
    assert sorted(dwells(found)) == keys
    assert len(found) == MANY


def test_stays_survive_kills(tmp_path: Path, name: str) -> None:
    """Who waits, who has made the event, and since when; also where the events that said so have been dropped."""
    fleet, kept, short = f"{name}/fleet", f"{name}/kept", f"{name}/short"
    clock = SetTime(tmp_path)
    options = ("--data", str(tmp_path / "data"))
    with server_process(*options, wrap=clock.wrap, killed=True) as server:
        with grpc.insecure_channel(server.address) as channel:
            stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
            keyed(stub, fleet)
            put(stub, fleet, a=(1, 0), z=(9, 9))
            for fence, most in ((kept, 0), (short, 2)):
                create(fences, fence, circle_area=CIRCLE, subject_hull=fleet, dwell=span(STAY), max_events=most)
            clock.passes(STAY)
            for fence in (kept, short):
                assert dwells(waited(fences, fence, 2)) == ["a"]
            put(stub, fleet, b=(2, 0))
            entered = waited(fences, kept, 3)[2]
            put(stub, fleet, z=(0, 0))
            put(stub, fleet, z=(9, 9))
            wait_until(lambda: fences.GetFence(fs.GetFenceRequest(name=short)).fence.first_sequence > 3)
        server.process.kill()
    clock.passes(STAY)
    for life in range(2):
        with server_process(*options, wrap=clock.wrap, killed=True) as server:
            with grpc.insecure_channel(server.address) as channel:
                stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
                for fence in (kept, short):
                    (dwelt,) = waited(fences, fence, 6, after=5)
                    assert told(dwelt) == "DWELL b TIME_PASSED"
                    assert dwelt.first_time == entered.time
                    assert stayed(dwelt) >= STAY * SECOND
                if life:
                    put(stub, fleet, c=(0, 0))
                    clock.passes(STAY)
                    for fence in (kept, short):
                        expected = ["ENTER c SUBJECT_APPEARED", "DWELL c TIME_PASSED"]
                        assert words(waited(fences, fence, 8, after=6)) == expected
            server.process.kill()


def test_a_stay_goes_on_while_the_server_is_down(tmp_path: Path, name: str) -> None:
    """The time of the replacement is kept, too."""
    config = {"circle_area": CIRCLE, "subject_hull": name, "initial": "FENCE_INITIAL_NONE"}
    clock = SetTime(tmp_path)
    options = ("--data", str(tmp_path / "data"))
    with server_process(*options, wrap=clock.wrap, killed=True) as server:
        with grpc.insecure_channel(server.address) as channel:
            stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
            put(stub, keyed(stub, name), a=(1, 0))
            fences.CreateFence(fs.CreateFenceRequest(name=f"{name}/replaced", config=config))
            begun = clock.now() - SECOND
            fences.CreateFence(fs.CreateFenceRequest(name=f"{name}/new", config=config | {"dwell": span(STAY)}))
            fences.ReplaceFence(fs.ReplaceFenceRequest(name=f"{name}/replaced", config=config | {"dwell": span(STAY)}))
            ended = clock.now() + SECOND
        server.process.kill()
    clock.passes(STAY)
    with server_process(*options, wrap=clock.wrap) as server, grpc.insecure_channel(server.address) as channel:
        stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
        for fence in (f"{name}/new", f"{name}/replaced"):
            (dwelt,) = waited(fences, fence, 1)
            assert told(dwelt) == "DWELL a TIME_PASSED"
            assert stayed(dwelt) >= STAY * SECOND
            assert begun <= dwelt.first_time.ToMicroseconds() <= ended


@pytest.mark.one_process("faults are put into the process that is started")
@pytest.mark.parametrize("fault", ["commit", "settle"])
def test_a_commit_that_fails_makes_no_second_event(tmp_path: Path, name: str, fault: str) -> None:
    """The commit of the event is kept but reported as failed; with `settle`, nobody can say so for a while."""
    faults = tmp_path / "faults"
    faults.mkdir()
    clock = SetTime(tmp_path)
    wrap = (*clock.wrap, str(Path(__file__).parents[2] / "support/faulty_storage.py"), str(faults))
    with (
        server_process("--data", str(tmp_path / "data"), wrap=wrap, complaints="Input/output error") as server,
        grpc.insecure_channel(server.address) as channel,
    ):
        stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
        keyed(stub, name)
        create(fences, name, circle_area=CIRCLE, subject_hull=name, initial="FENCE_INITIAL_NONE", dwell=span(STAY))
        put(stub, name, a=(1, 0), b=(2, 0))
        for each in {"commit", fault}:
            (faults / each).touch()
        clock.passes(STAY)
        wait_until((faults / f"{fault} failed").exists)
        for each in {"commit", fault}:
            (faults / each).unlink()
        waited(fences, name, 4)
        put(stub, name, c=(3, 0))
        clock.passes(STAY)
        assert dwells(waited(fences, name, 6, after=2)) == ["a", "b", "c"]


def test_the_dwell_of_who_is_inside_of_the_others(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str
) -> None:
    """With `without_self` the distance is that from the hull of the others."""
    put(stub, fleet, a=(0, 0), b=(8, 0), c=(8, 8), d=(0, 8), e=(4, 4))
    area = {"name": fleet, "without_self": True}
    create(fences, name, hull_area=area, subject_hull=fleet, margin=3, dwell=span(STAY), initial="FENCE_INITIAL_NONE")
    put(stub, fleet, e=(4, -2), f=(8, 8))
    clock.passes(STAY)
    found = waited(fences, name, 5)
    assert words(found[:2]) == ["ENTER c AREA_MOVED", "ENTER f AREA_MOVED SUBJECT_APPEARED"]
    assert {each.string_key: each.distance for each in found[2:]} == {"c": 0, "e": 2, "f": 0}
    assert words(found[2:]) == [f"DWELL {each} TIME_PASSED" for each in (each.string_key for each in found[2:])]
    assert inside(fences, name) == ["c", "e", "f"]


# Events that are delayed


def delayed(found: list[fence_pb2.FenceEvent]) -> list[tuple[str, int]]:
    """Events in words, and the microseconds by which they were delayed."""
    return [(told(each), stayed(each) if each.HasField("first_time") else 0) for each in found]


def words(found: list[fence_pb2.FenceEvent]) -> list[str]:
    return [told(each) for each in found]


def test_reports_that_agree_confirm_a_change(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    put(stub, fleet, a=(9, 0), b=(1, 0))
    create(fences, name, circle_area=CIRCLE, subject_hull=fleet, initial="FENCE_INITIAL_NONE", confirmations=3)
    put(stub, fleet, a=(1, 0))
    put(stub, fleet, a=(2, 0), b=(9, 0))
    assert events(fences, name) == []
    assert inside(fences, name) == ["b"]
    revision = put(stub, fleet, a=(2, 0))  # a position that stays is a report, too
    (entered,) = events(fences, name)
    assert told(entered) == "ENTER a SUBJECT_MOVED"
    assert (entered.subject_revision, entered.position.x, entered.distance) == (revision, 2, 0)
    assert not entered.HasField("previous_position")
    assert 0 < entered.first_time.ToMicroseconds() <= entered.time.ToMicroseconds()
    put(stub, fleet, b=(9, 0))
    put(stub, fleet, b=(4, 0), c=(0, 0))
    put(stub, fleet, b=(9, 0))
    put(stub, fleet, c=(0, 0), b=(8, 0))
    assert inside(fences, name) == ["a", "b"]
    put(stub, fleet, b=(7, 0), c=(0, 1))
    assert words(events(fences, name, after=1)) == ["EXIT b SUBJECT_MOVED", "ENTER c SUBJECT_APPEARED"]
    assert events(fences, name, after=1)[0].distance == 2
    assert inside(fences, name) == ["a", "c"]


def test_an_area_that_moves_is_no_report(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    zone = f"{name}/zone"
    stub.CreateHull(pb.CreateHullRequest(name=zone))
    insert(stub, zone, 0, 0, 10, 0, 0, 10)
    put(stub, fleet, a=(6, 6))
    create(fences, name, hull_area={"name": zone}, subject_hull=fleet, initial="FENCE_INITIAL_NONE", confirmations=2)
    insert(stub, zone, 10, 10)
    put(stub, fleet, a=(6, 6))
    insert(stub, zone, 11, 11)
    assert events(fences, name) == []
    put(stub, fleet, a=(7, 6))
    assert words(events(fences, name)) == ["ENTER a AREA_MOVED"]


def test_time_confirms_a_change(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str
) -> None:
    put(stub, fleet, a=(9, 0), b=(1, 0), c=(1, 1))
    create(
        fences,
        name,
        circle_area=CIRCLE,
        subject_hull=fleet,
        initial="FENCE_INITIAL_NONE",
        min_dwell=span(STAY),
        dwell=span(WHILE),
        margin=1,
    )
    put(stub, fleet, a=(1, 0), b=(9, 0), c=(9, 9))
    put(stub, fleet, c=(5, 0))
    revision = put(stub, fleet, a=(5, 1))
    clock.passes(WHILE)
    assert sorted(words(waited(fences, name, 2))) == ["DWELL b TIME_PASSED", "DWELL c TIME_PASSED"]
    clock.passes(STAY)
    waited(fences, name, 4)
    clock.passes(WHILE)
    found = waited(fences, name, 5, after=2)
    assert sorted(words(found)) == [
        "DWELL a TIME_PASSED",
        "ENTER a SUBJECT_MOVED TIME_PASSED",
        "EXIT b SUBJECT_MOVED TIME_PASSED",
    ]
    entered = next(each for each in found if told(each).startswith("ENTER"))
    assert (entered.subject_revision, stayed(entered) >= STAY * SECOND) == (revision, True)
    assert 0 < entered.distance < 1
    assert found[-1].string_key == "a"
    assert found[-1].first_time == entered.time


def test_with_both_rules_both_must_hold(
    stub: HullServiceStub, fences: FenceServiceStub, clock: SetTime, name: str, fleet: str
) -> None:
    put(stub, fleet, z=(9, 9))
    config = {"circle_area": CIRCLE, "subject_hull": fleet, "initial": "FENCE_INITIAL_NONE"}
    create(fences, name, **config, confirmations=2, min_dwell=span(STAY))
    put(stub, fleet, a=(0, 0), b=(1, 1))
    put(stub, fleet, a=(0, 0))
    assert events(fences, name) == []
    clock.passes(STAY)
    (first,) = waited(fences, name, 1)
    assert (told(first), stayed(first) >= STAY * SECOND) == ("ENTER a SUBJECT_APPEARED TIME_PASSED", True)
    put(stub, fleet, b=(1, 1))
    (second,) = events(fences, name, after=1)
    assert told(second) == "ENTER b SUBJECT_APPEARED"
    assert stayed(second) >= STAY * SECOND


def test_who_is_gone_needs_no_confirmation(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    put(stub, fleet, a=(1, 0), b=(9, 0), c=(1, 1))
    create(fences, name, circle_area=CIRCLE, subject_hull=fleet, initial="FENCE_INITIAL_NONE", confirmations=2)
    put(stub, fleet, a=(9, 0), b=(1, 0))
    remove(stub, fleet, "a", "b", "c")
    found = events(fences, name)
    assert words(found) == ["EXIT a SUBJECT_REMOVED", "EXIT c SUBJECT_REMOVED"]
    assert [each.HasField("previous_position") for each in found] == [False, True]
    put(stub, fleet, a=(1, 0))
    assert inside(fences, name) == []


def test_a_fence_replaced_by_one_with_fewer_rules_ends_what_waits(
    stub: HullServiceStub, fences: FenceServiceStub, name: str, fleet: str
) -> None:
    put(stub, fleet, a=(1, 0), b=(9, 0), c=(6, 0), d=(1, 1))
    create(fences, name, circle_area=CIRCLE, subject_hull=fleet, initial="FENCE_INITIAL_NONE", confirmations=3)
    put(stub, fleet, a=(9, 0), b=(1, 0), d=(6, 0))
    put(stub, fleet, a=(9, 0))

    def replace(radius: float, confirmations: int) -> list[str]:
        config = {"circle_area": {"radius": radius}, "subject_hull": fleet, "confirmations": confirmations}
        last = fences.ReplaceFence(fs.ReplaceFenceRequest(name=name, config=config)).fence.last_sequence
        return words(events(fences, name)[-last:] if last else [])

    assert replace(5, 2) == ["EXIT a SUBJECT_MOVED FENCE_CHANGED"]
    assert replace(7, 0)[1:] == ["ENTER b SUBJECT_MOVED FENCE_CHANGED", "ENTER c FENCE_CHANGED"]
    assert inside(fences, name) == ["b", "c", "d"]


def test_what_waits_survives_kills(tmp_path: Path, name: str) -> None:
    """Reports are counted, and time passes, over two lives of the server and while it is down."""
    counts, times = f"{name}/counts", f"{name}/times"
    config = {"circle_area": CIRCLE, "subject_hull": name, "initial": "FENCE_INITIAL_NONE"}
    clock = SetTime(tmp_path)
    options = ("--data", str(tmp_path / "data"))
    with server_process(*options, wrap=clock.wrap, killed=True) as server:
        with grpc.insecure_channel(server.address) as channel:
            stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
            put(stub, keyed(stub, name), a=(9, 0), b=(1, 0), c=(1, 1))
            create(fences, counts, **config, confirmations=3)
            create(fences, times, **config, min_dwell=span(STAY))
            begun = clock.now() - SECOND
            put(stub, name, a=(1, 0), b=(9, 0), c=(9, 1))
            ended = clock.now() + SECOND
            put(stub, name, a=(2, 0), c=(2, 2))
            clock.passes(STAY / 3)
        server.process.kill()
    clock.passes(STAY / 3)
    with server_process(*options, wrap=clock.wrap, killed=True) as server:
        with grpc.insecure_channel(server.address) as channel:
            stub, fences = HullServiceStub(channel), FenceServiceStub(channel)
            assert inside(fences, counts) == ["b", "c"]
            put(stub, name, a=(3, 0))
            assert words(events(fences, counts)) == ["ENTER a SUBJECT_MOVED"]
            assert events(fences, times) == []
            clock.passes(STAY / 3)
            found = waited(fences, times, 2)
            expected = ["ENTER a SUBJECT_MOVED TIME_PASSED", "EXIT b SUBJECT_MOVED TIME_PASSED"]
            assert words(found) == expected
            assert all(stayed(each) >= STAY * SECOND for each in found)
            assert all(begun <= each.first_time.ToMicroseconds() <= ended for each in found)
        server.process.kill()
    with server_process(*options, wrap=clock.wrap) as server, grpc.insecure_channel(server.address) as channel:
        fences = FenceServiceStub(channel)
        assert [inside(fences, fence) for fence in (counts, times)] == [["a", "b", "c"], ["a", "c"]]
        put(HullServiceStub(channel), name, b=(9, 0))
        put(HullServiceStub(channel), name, b=(9, 0))
        assert words(events(fences, counts, after=1)) == ["EXIT b SUBJECT_MOVED"]
        assert len(events(fences, times)) == len(expected)


@pytest.mark.parametrize(
    ("config", "field", "problem"),
    [
        ({"min_dwell": {"seconds": -1}}, "config.min_dwell", "least"),
        ({"dwell": {"seconds": -1}}, "config.dwell", "least"),
    ],
)
def test_rules_that_are_refused(
    fences: FenceServiceStub, name: str, fleet: str, config: dict[str, object], field: str, problem: str
) -> None:
    config = {"circle_area": CIRCLE, "subject_hull": fleet} | config
    refused = refused_by(fences.CreateFence, fs.CreateFenceRequest(name=name, config=config))
    assert (refused.code, refused.metadata["field"]) == (grpc.StatusCode.INVALID_ARGUMENT, field)
    assert problem in refused.metadata.get("problem", problem)
    assert refused_by(fences.GetFence, fs.GetFenceRequest(name=name)).reason == "FENCE_NOT_FOUND"
