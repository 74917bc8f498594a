"""Fences are compared with positions, areas and events: right ones are equal, and one wrong bit is found."""

import asyncio
import shutil
from dataclasses import replace
from pathlib import Path

import grpc
import numpy as np
import pytest
from grpc_health.v1 import health_pb2, health_pb2_grpc
from live_engine import engine_in_memory
from patience import wait_until
from server_process import run, server_process
from wrong_fences import WRONG_FENCES

from dynhull.keys import PackedKeys, key_list
from dynhull_client import Circle, HullClient, Polygon, Prefix, Verification
from dynhull_server.engine import fence_verification
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.fence_verification import verify_events
from dynhull_server.engine.fences import LiveFence
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.fences.events.block import AppendEvents, block_of
from dynhull_server.state.fences.events.recent import RecentEvents
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.fences.model.faults import FenceFault
from dynhull_server.state.fences.model.records import Cause, EventType, FenceEvent
from dynhull_server.state.records import NO_TIME, HullSettings
from dynhull_server.storage.sqlite.origin import NOTE
from dynhull_server.storage.sqlite.storage import SQLiteStorage

SQUARE = [[0, 0], [6, 0], [6, 6], [0, 6]]
HOLE = [[2, 2], [4, 2], [4, 4], [2, 4]]
KEYS = [f"k{i}" for i in range(12)]
HOUR = 3600.0


def every_kind(client: HullClient) -> None:
    """Fences of every kind, around subjects that have moved for a while."""
    for name in ("fleet/a", "fleet/b"):
        client.create_hull(name, keyed="str")
    client.create_hull("numbered", keyed="int")
    for name in ("area", "other"):
        client.create_hull(name)
    client.create_hull("ships", keyed="str", geographic=True, center=(180, -17))
    client.create_hull("waters", geographic=True, center=(180, -17))
    holed = Polygon(SQUARE, [HOLE])
    rules = {"crosses": True, "confirmations": 2, "min_dwell": HOUR}
    client.create_fence("holed", area=[holed, Polygon([[7, 0], [9, 0], [8, 3]])], subjects="fleet/a")
    client.create_fence("open", area=holed, subjects="fleet/a", boundary="open", initial="events", dwell=HOUR)
    client.create_fence("trembling", area=holed, subjects="fleet/a", margin=1.0, initial="none")
    client.create_fence("waiting", area=Circle(3, 3, 3), subjects="fleet/a", **rules)
    client.create_fence("twice", area=Circle(3, 3, 2), subjects=Prefix("fleet/"), confirmations=2, margin=0.5)
    client.create_fence("around", area="area", subjects=Prefix("fleet/"), margin=0.25)
    client.create_fence("pack", area="fleet/b", subjects="fleet/b", without_self=True, margin=1.0)
    client.create_fence("numbers", area="area", subjects="numbered", boundary="open")
    client.create_fence("inner", area="area", subjects=Prefix("fleet/"), layer=2)
    client.create_fence("meeting", area="area", other_hull="other")
    client.create_fence("near", area="area", other_hull="other", near=2.0)
    client.create_fence("zone", area=[[179.5, -17.5], [-179.5, -17.5], [-179.5, -16.5]], subjects="ships")
    client.create_fence("harbour", area=Circle(180, -17, 50_000), subjects="ships")
    client.create_fence("fishing", area="waters", subjects="ships")
    random = np.random.default_rng(4)
    for step in range(16):
        keys = random.choice(KEYS, 6, replace=False).tolist()
        places = random.integers(-1, 10, (6, 2))
        client.put("fleet/a", keys, places)
        client.put("fleet/b", keys[:4], random.integers(-1, 10, (4, 2)))
        client.put("numbered", random.choice(99, 6, replace=False), places)
        client.apply("area", insert=random.integers(0, 9, (2, 2)))
        client.apply("other", insert=[[9 + step % 5, 9]])
        sampled = client.sample_points("area", 100).points
        if len(sampled) > 6:
            client.apply("area", delete=sampled[:3])
        if step % 4 == 3:
            client.apply("other", delete=client.sample_points("other", 100).points[:2])
            client.remove("fleet/a", keys[:2])
        client.put("ships", keys, random.uniform((179, -18), (181, -16), (6, 2)))
        client.apply("waters", insert=random.uniform((179.5, -17.5), (180.5, -16.5), (1, 2)))
    client.replace_fence("holed", area=[SQUARE], subjects="fleet/a")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Verification]]:
    data = tmp_path_factory.mktemp("verified") / "data"
    with (
        server_process("--data", str(data), "--durability", "none", killed=True) as server,
        HullClient(server.address) as client,
    ):
        every_kind(client)
        found = {info.name: client.verify(info.name) for info in client.list_hulls()}
        assert sum(client.get_fence(each.name).inside for each in client.list_fences()) > 20
        server.process.kill()
    return data, found


@pytest.mark.one_process("the fences combine hulls of many names, and the folder is read as one")
def test_fences_of_every_kind_are_whole(folder: tuple[Path, dict[str, Verification]]) -> None:
    data, found = folder
    assert {name: each.fence_differences for name, each in found.items() if not each.whole} == {}
    assert {name: each.fences for name, each in found.items() if each.fences} == {
        "fleet/a": 7,
        "fleet/b": 4,
        "numbered": 1,
        "other": 2,
        "ships": 3,
    }
    checked = run("check", data)
    assert (checked.returncode, checked.stderr) == (0, "")
    assert checked.stdout.count("fence ") == 14
    assert "WRONG" not in checked.stdout


# One wrong bit of a live fence

CIRCLE = FenceConfig(CircleArea(0.0, 0.0, 5.0), "hull", "fleet", margin=2.0, initial="none")


async def put(engine: Engine, **places: float) -> None:
    points = np.array([[x, 0.0] for x in places.values()])
    batch = KeyedBatch("str", PackedKeys.pack(places), points, PackedKeys.pack([]))
    await engine.hulls.apply(Write("fleet", batch, engine.driver.time()), create=False)


async def life(engine: Engine) -> LiveFence:
    """A fence with keys inside, outside, and on both sides of the margin."""
    await engine.hulls.create("fleet", HullSettings("str"))
    fence = await engine.fences.create("fence", CIRCLE)
    await put(engine, inner=1.0, outer=9.0, late=1.0, early=6.0)
    await put(engine, late=6.0)
    return fence


@pytest.mark.parametrize(
    ("key", "expected"),
    [("inner", "inside"), ("outer", "outside"), ("late", "inside, as the events say"), ("early", None)],
)
def test_a_flipped_side_is_found(key: str, expected: str | None) -> None:
    async def found() -> tuple[FenceFault, ...]:
        async with engine_in_memory() as engine:
            fence = await life(engine)
            hull = engine.hulls.get("fleet")
            assert (await hull.verify())[1].equal
            index, number = fence.fence.subjects["fleet"].index, fence.fence.number
            inside = set(key_list(index.inside(number))) ^ {key}
            index.set_circle(number, 0.0, 0.0, 5.0, margin=2.0, inside=PackedKeys.pack(sorted(inside)))
            fence.fence.inside = len(inside)
            return (await hull.verify())[1].fence_faults

    faults = asyncio.run(found())
    if expected is None:  # without an event, within the margin: both sides are allowed
        assert faults == ()
    else:
        sides = {"inside": "outside", "outside": "inside", "inside, as the events say": "outside"}
        assert faults[0] == FenceFault("fence", "fleet", key, 0, expected, sides[expected])


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"type": EventType.EXIT}, "key 'late' of hull 'fleet': expected outside, as the events say, found inside"),
        ({"sequence": 1}, "expected 2 as the last event, found event 1"),
        ({"key": "inner"}, "key 'inner' of hull 'fleet', event 2: expected a subject that is outside, found enter"),
        ({"key": "nobody"}, "key 'nobody' of hull 'fleet': expected inside, as the events say, found outside"),
        ({"time": 0}, "event 2: expected a time of"),
    ],
)
def test_a_flipped_event_is_found(monkeypatch: pytest.MonkeyPatch, change: dict[str, object], complaint: str) -> None:
    monkeypatch.setattr(fence_verification, "PUBLISHED_AFTER", 0.1)  # seconds in which it may turn out to be dropped

    async def found() -> str:
        async with engine_in_memory() as engine:
            fence = await life(engine)
            assert (await verify_events(fence, engine.driver.aside)).equal
            events, recent = await fence.events(0, 100), RecentEvents(10**6)
            events[1] = events[1]._replace(**change)
            for event in events:
                recent.add(block_of({fence.fence.number: [event]}), 1)
            monkeypatch.setattr(fence.fence, "_recent", recent)
            return "\n".join(map(str, (await engine.hulls.get("fleet").verify())[1].fence_faults))

    assert complaint in asyncio.run(found()) + "\n"


def test_later_rounds_read_new_events_and_notice_what_is_missing_between() -> None:
    async def found() -> list[str]:
        async with engine_in_memory() as engine:
            fence = await life(engine)
            first = await verify_events(fence, engine.driver.aside)
            await put(engine, inner=9.0, outer=1.0)
            second = await verify_events(fence, engine.driver.aside, first)
            assert second.equal
            assert (second.last, second.inside) == (first.last + 2, first.inside)
            wrong = replace(first, inside=first.inside + 1)
            return list(map(str, (await verify_events(fence, engine.driver.aside, wrong)).faults))

    assert asyncio.run(found()) == ["fence 'fence': expected 3 inside after event 2, and +0 since, found 2 inside"]


def test_a_wrong_count_is_found() -> None:
    async def found() -> tuple[FenceFault, ...]:
        async with engine_in_memory() as engine:
            fence = await life(engine)
            fence.fence.inside += 1
            return (await engine.hulls.get("fleet").verify())[1].fence_faults

    assert [str(each) for each in asyncio.run(found())] == [
        "fence 'fence': expected 2 subjects inside, found a count of 3"
    ]


@pytest.mark.one_process("faults are put into the process that is started")
def test_health_logs_and_the_command_tell_of_a_wrong_fence() -> None:
    complaint = "a fence differs from its recomputation"
    with (
        server_process("--scrub-pause", "0.1", wrap=WRONG_FENCES, complaints=complaint) as server,
        grpc.insecure_channel(server.address) as channel,
        HullClient(server.address) as client,
    ):
        check = health_pb2_grpc.HealthStub(channel).Check
        client.create_hull("fleet", keyed="str")
        client.create_fence("depot", area=Circle(0, 0, 5), subjects="fleet")
        client.put("fleet", ["a", "b"], [[0, 0], [1, 1]])
        request = health_pb2.HealthCheckRequest(service="dynhull.v1.scrub")
        wait_until(lambda: check(request).status == health_pb2.HealthCheckResponse.NOT_SERVING)
        everything = check(health_pb2.HealthCheckRequest(service="dynhull.v1.FenceService"))
        assert everything.status == health_pb2.HealthCheckResponse.SERVING
        done = run("verify", "fleet", "--address", server.address)
        assert done.returncode == 1
        assert "fence depot: key a of fleet, expected inside, found outside" in done.stdout


# Rows that are whole, and say what cannot be


def event(kind: EventType, hull: str, key: str, sequence: int) -> FenceEvent:
    return FenceEvent(sequence, kind, int(Cause.MOVED), hull, key, 1, 0, (1.0, 1.0), None, 1.0, NO_TIME, 2**51)


@pytest.fixture(scope="module")
def depot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two keys inside of a fence."""
    data = tmp_path_factory.mktemp("depot") / "data"
    with server_process("--data", str(data)) as server, HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str")
        client.create_fence("depot", area=Circle(0, 0, 5), subjects="fleet", initial="events")
        client.put("fleet", ["a", "b", "far"], [[0, 0], [1, 1], [9, 9]])
    return data


@pytest.mark.one_process("the test writes into the database of a folder")
@pytest.mark.parametrize(
    ("made", "complaint"),
    [
        ((EventType.EXIT, "fleet", "a"), "fence 'depot', key 'a' of hull 'fleet': expected inside, found outside"),
        ((EventType.EXIT, "fleet", "far"), "event 3: expected a subject that is inside, found exit of one that is not"),
        ((EventType.ENTER, "fleet", "c"), "fence 'depot', key 'c' of hull 'fleet': expected no such key, found inside"),
        ((EventType.ENTER, "gone", "a"), "fence 'depot', hull 'gone': expected nobody of this hull, found 1 inside"),
    ],
)
def test_check_compares_stored_fences(
    depot: Path, tmp_path: Path, made: tuple[EventType, str, str], complaint: str
) -> None:
    data = shutil.copytree(depot, tmp_path / "data", ignore=shutil.ignore_patterns(NOTE))  # not known for a copy
    storage = SQLiteStorage(data)
    (fence,) = storage.open(lambda *_: None).fences
    storage.commit([AppendEvents(block_of({fence.number: [event(*made, 3)]}))])
    storage.close()
    done = run("check", data)
    assert done.returncode == 1
    assert complaint in done.stderr
    assert "fence depot: 3 events" in done.stdout
