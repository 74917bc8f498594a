"""Event times, windows and deadlines through a real server: what leaves, when, and after a restart."""

import asyncio
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import grpc
import pytest
from adjustable_clock import AdjustableClock
from entity_messages import COORDINATES, SECOND, STRINGS, duration, keys, points, puts, times, window
from google.protobuf.duration_pb2 import Duration
from live_engine import LIMITS
from patience import PATIENCE, wait_until
from refusal import refusal
from server_process import server_process

from dynhull_proto.v1 import batch_pb2, hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.rpc.decode_batch import decode_batch
from dynhull_server.state.batch import Write
from dynhull_server.state.records import HullSettings, Window
from dynhull_server.storage.memory import MemoryStorage

INVALID, FAILED = grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.FAILED_PRECONDITION
COUNTS = ("inserted", "moved", "deleted", "missing", "stale", "late", "skipped", "clamped", "evicted")
DATA, SERVER = hull_pb2.CLOCK_DATA, hull_pb2.CLOCK_SERVER
T = 1_700_000_000 * SECOND


@pytest.fixture(scope="module", params=["memory", "durable"])
def stub(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[HullServiceStub]:
    options = [] if request.param == "memory" else ["--data", str(tmp_path_factory.mktemp("windows"))]
    with server_process(*options) as server, grpc.insecure_channel(server.address) as channel:
        yield HullServiceStub(channel)


def create(
    stub: HullServiceStub, name: str, window: hull_pb2.Window | None = None, identity: int = STRINGS, ordering: int = 0
) -> None:
    config = hull_pb2.HullConfig(identity=identity, window=window, ordering=ordering)
    stub.CreateHull(pb.CreateHullRequest(name=name, config=config))


def apply(stub: HullServiceStub, name: str, batch: batch_pb2.Batch) -> batch_pb2.BatchResult:
    return stub.Apply(pb.ApplyRequest(name=name, batch=batch)).result


def counts(result: batch_pb2.BatchResult) -> dict[str, int]:
    return {each: getattr(result, each) for each in COUNTS if getattr(result, each)}


def insert(*xy: float, at: tuple[int, ...] = ()) -> batch_pb2.Batch:
    return batch_pb2.Batch(inserts=points(*xy), insert_times=times(*at) if at else None)


def hull_of(stub: HullServiceStub, name: str) -> hull_pb2.Hull:
    return stub.GetHull(pb.GetHullRequest(name=name, view=pb.HULL_VIEW_BASIC)).hull


def everyone(stub: HullServiceStub, name: str) -> dict[str, tuple[float, float]]:
    (part,) = stub.ReadEntities(pb.ReadEntitiesRequest(name=name, encoding=COORDINATES))
    xy = part.positions.coordinates
    return dict(zip(part.keys.strings, zip(xy[::2], xy[1::2], strict=True), strict=True))


def everything(stub: HullServiceStub, name: str) -> list[float]:
    return list(stub.SamplePoints(pb.SamplePointsRequest(name=name, encoding=COORDINATES)).points.coordinates)


def test_old_points_leave_by_the_servers_clock(stub: HullServiceStub, name: str) -> None:
    create(stub, f"{name}-keys", window(0.4))
    create(stub, f"{name}-points", window(0.4), identity=0)
    begun = time.time()
    assert apply(stub, f"{name}-keys", puts({"a": (0, 0), "b": (1, 0)})).point_count == 2
    assert apply(stub, f"{name}-points", insert(0, 0, 0, 0, 1, 1)).point_count == 3
    for each in (f"{name}-keys", f"{name}-points"):
        stub.GetHull(pb.GetHullRequest(name=each, min_revision=2), timeout=PATIENCE)
        after = hull_of(stub, each)
        assert (after.revision, after.point_count) == (2, 0)
        assert after.clock_time.ToMicroseconds() >= (begun + 0.4) * SECOND
        assert stub.Verify(pb.VerifyRequest(name=each)).keys_equal


def test_late_points_are_not_inserted_and_early_ones_are_refused_or_clamped(stub: HullServiceStub, name: str) -> None:
    now = int(time.time() * SECOND)
    strict, lenient = f"{name}-strict", f"{name}-lenient"
    create(stub, strict, window(60, max_skew=duration(30)))
    create(stub, lenient, window(60, max_skew=Duration(), ahead=hull_pb2.AHEAD_POLICY_CLAMP), identity=0)
    batch = puts({"a": (0, 0), "b": (1, 0), "c": (2, 0)}, at=[now - 3600 * SECOND, now - 2 * SECOND, now + 5 * SECOND])
    assert counts(apply(stub, strict, batch)) == {"inserted": 2, "late": 1}
    far = puts({"a": (0, 0), "b": (3, 0)}, at=[now, now + 3600 * SECOND])
    code, info, _ = refusal(lambda: apply(stub, strict, far))
    assert (code, info.metadata["field"], info.metadata["row"]) == (INVALID, "batch.puts.times", "1")
    assert everyone(stub, strict) == {"b": (1, 0), "c": (2, 0)}
    batch = insert(0, 0, 1, 0, 2, 0, at=(now - 3600 * SECOND, now - SECOND, now + 3600 * SECOND))
    assert counts(apply(stub, lenient, batch)) == {"inserted": 2, "late": 1, "clamped": 1}
    assert everything(stub, lenient) == [1, 0, 2, 0]


def test_a_time_ahead_does_not_keep_a_key_without_a_window(stub: HullServiceStub, name: str) -> None:
    """Nobody leaves a hull that has only a limit on times, however old."""
    now, order = int(time.time() * SECOND), hull_pb2.ORDERING_EVENT_TIME
    strict, lenient, limit = f"{name}-strict", f"{name}-lenient", Duration(seconds=30)
    create(stub, strict, window(max_skew=limit), ordering=order)
    create(stub, lenient, window(max_skew=limit, ahead=hull_pb2.AHEAD_POLICY_CLAMP), ordering=order)
    for each in (strict, lenient):
        assert counts(apply(stub, each, puts({"a": (0, 0), "b": (9, 0)}, at=[T, T]))) == {"inserted": 2}
    far = puts({"b": (1, 0), "a": (5, 5)}, at=[now, now + 3600 * SECOND])
    code, info, _ = refusal(lambda: apply(stub, strict, far))
    assert (code, info.metadata["field"], info.metadata["row"]) == (INVALID, "batch.puts.times", "1")
    assert everyone(stub, strict) == {"a": (0, 0), "b": (9, 0)}
    assert counts(apply(stub, lenient, far)) == {"moved": 2, "clamped": 1}
    for each in (strict, lenient):
        assert counts(apply(stub, each, puts({"a": (2, 0)}, at=[now + 3600 * SECOND] if each == lenient else [now])))
        assert everyone(stub, each)["a"] == (2, 0)
        assert stub.Verify(pb.VerifyRequest(name=each)).keys_equal
    assert counts(apply(stub, strict, puts({"a": (3, 0)}, at=[now - SECOND]))) == {"stale": 1}


def test_a_clock_of_event_times(stub: HullServiceStub, name: str) -> None:
    """What is too old leaves as a revision before the batch, unless the batch is refused."""
    create(stub, name, window(10, clock=DATA))
    code, info, _ = refusal(lambda: apply(stub, name, puts({"a": (0, 0)})))
    assert (code, dict(info.metadata)) == (INVALID, {"field": "batch.puts.times", "value": "empty"})
    assert not hull_of(stub, name).HasField("clock_time")
    assert counts(apply(stub, name, puts({"a": (0, 0), "b": (1, 0)}, at=[T, T + 4 * SECOND]))) == {"inserted": 2}
    refused = puts({"c": (5, 5)}, at=[T + 3600 * SECOND])
    refused.removes.CopyFrom(keys("b"))  # which would be too old by then
    refused.missing_keys = batch_pb2.MISSING_KEY_POLICY_REFUSE
    code, info, _ = refusal(lambda: apply(stub, name, refused))
    assert (code, info.reason) == (FAILED, "KEY_MISSING")
    assert (hull_of(stub, name).revision, len(everyone(stub, name))) == (1, 2)
    result = apply(stub, name, puts({"c": (5, 5), "d": (6, 6)}, at=[T + 12 * SECOND, T + 2 * SECOND]))
    assert counts(result) == {"inserted": 1, "late": 1}
    assert (result.revision, result.clock_time.ToMicroseconds()) == (3, T + 12 * SECOND)
    assert everyone(stub, name) == {"b": (1, 0), "c": (5, 5)}
    exchange = puts({"b": (2, 0)}, at=[T + 14 * SECOND])
    exchange.removes.CopyFrom(keys("c"))
    exchange.missing_keys = batch_pb2.MISSING_KEY_POLICY_REFUSE
    assert counts(apply(stub, name, exchange)) == {"inserted": 1, "deleted": 1}  # b was exactly 10 s old
    assert (hull_of(stub, name).revision, everyone(stub, name)) == (5, {"b": (2, 0)})


def test_points_of_a_clock_of_event_times(stub: HullServiceStub, name: str) -> None:
    create(stub, name, window(10, clock=DATA), identity=0)
    apply(stub, name, insert(0, 0, 1, 1, 0, 0, 2, 0, at=(T, T + 5 * SECOND, T + 6 * SECOND, T + SECOND)))
    move = batch_pb2.Batch(moves=batch_pb2.Moves(origins=points(1, 1), destinations=points(2, 2)))
    code, info, _ = refusal(lambda: apply(stub, name, move))
    assert (code, dict(info.metadata)) == (INVALID, {"field": "batch.moves", "value": "1 moves"})
    gone = insert(7, 7, at=(T + 11 * SECOND,))
    gone.deletes.CopyFrom(points(1, 1, 2, 0))  # the second is too old by then
    code, info, _ = refusal(lambda: apply(stub, name, gone))
    assert (code, info.reason, info.metadata["row"]) == (FAILED, "POINT_MISSING", "1")
    assert (hull_of(stub, name).revision, hull_of(stub, name).point_count) == (1, 4)
    both = insert(7, 7, 3, 3, at=(T + 10 * SECOND, T + 10 * SECOND))
    both.deletes.CopyFrom(points(7, 7, 0, 0))  # of two copies of the other the older one has left
    result = apply(stub, name, both)
    assert (counts(result), result.revision) == ({"inserted": 2, "deleted": 2}, 3)
    assert everything(stub, name) == [1, 1, 2, 0, 3, 3]
    deleted = apply(stub, name, batch_pb2.Batch(deletes=points(9, 9, 1, 1), missing_points=2))
    assert counts(deleted) == {"deleted": 1, "missing": 1}


def test_times_need_a_window(stub: HullServiceStub, name: str) -> None:
    create(stub, name, identity=0)
    code, info, _ = refusal(lambda: apply(stub, name, insert(0, 0, at=(T,))))
    assert (code, info.reason, hull_of(stub, name).revision) == (FAILED, "HULL_UNSUITABLE", 0)


def test_a_window_of_a_number_of_points(stub: HullServiceStub, name: str) -> None:
    create(stub, f"{name}-keys", window(max_points=3, clock=DATA))
    result = apply(stub, f"{name}-keys", puts({key: (0, i) for i, key in enumerate("abcd")}, at=[T + 9, T, T, T + 5]))
    assert (counts(result), result.point_count) == ({"inserted": 4, "evicted": 1}, 3)
    assert sorted(everyone(stub, f"{name}-keys")) == ["a", "c", "d"]
    result = apply(stub, f"{name}-keys", puts({"c": (1, 1), "e": (2, 2)}, at=[T + 20, T + 6]))
    assert counts(result) == {"inserted": 1, "moved": 1, "evicted": 1}
    assert sorted(everyone(stub, f"{name}-keys")) == ["a", "c", "e"]
    create(stub, f"{name}-points", window(max_points=3), identity=0)
    assert counts(apply(stub, f"{name}-points", insert(0, 0, 1, 1, 0, 0, 2, 2))) == {"inserted": 4, "evicted": 1}
    assert everything(stub, f"{name}-points") == [0, 0, 1, 1, 2, 2]


def test_keys_leave_at_their_deadline(stub: HullServiceStub, name: str) -> None:
    """Also in a hull without a window, unless a later put has none."""
    create(stub, name)
    assert counts(apply(stub, name, puts({"a": (0, 0), "b": (1, 0)}, expire_times=times(T, T)))) == {"late": 2}
    apply(stub, name, puts({"a": (0, 0), "b": (1, 0)}, ttl=duration(0.3)))
    apply(stub, name, puts({"d": (3, 0), "e": (4, 0)}, ttl=duration(3600)))
    wait_until(lambda: hull_of(stub, name).point_count == 2)
    assert (hull_of(stub, name).revision, everyone(stub, name)) == (4, {"d": (3, 0), "e": (4, 0)})


def test_a_put_gives_a_new_deadline_or_none(stub: HullServiceStub, name: str) -> None:
    """Of two keys with one deadline, and with a clock of event times."""
    create(stub, name, window(3600, clock=DATA))
    three = {"a": (0, 0), "b": (1, 0), "c": (2, 0)}
    apply(stub, name, puts(three, at=[T] * 3, ttl=duration(5)))
    apply(stub, name, puts({"b": (1, 1)}, at=[T]))
    skipped = puts({"c": (2, 5)}, at=[T], ttl=duration(3600), condition=batch_pb2.PUT_CONDITION_IF_ABSENT)
    assert counts(apply(stub, name, skipped)) == {"skipped": 1}
    apply(stub, name, puts({"d": (3, 0)}, at=[T + 5 * SECOND - 1]))
    assert sorted(everyone(stub, name)) == ["a", "b", "c", "d"]
    result = apply(stub, name, puts({"e": (4, 0), "f": (5, 0)}, at=[T + 5 * SECOND] * 2, expire_times=times(T, 2 * T)))
    assert (counts(result), result.revision) == ({"inserted": 1, "late": 1}, 6)
    assert sorted(everyone(stub, name)) == ["b", "d", "f"]


def test_a_kill_loses_no_key_no_time_and_no_clock(tmp_path: Path) -> None:
    options = ["--data", str(tmp_path / "data"), "--snapshot-points", "30"]
    with server_process(*options, killed=True) as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        create(stub, "data", window(10, clock=DATA))
        create(stub, "deadlines")
        create(stub, "plain")
        create(stub, "evicting", window(max_points=5), identity=0)
        create(stub, "points", window(3600, max_points=20), identity=0)
        for i in range(60):
            request = pb.ApplyRequest(name="data", producer="p", sequence=i + 1)
            request.batch.CopyFrom(puts({f"k{i % 7}": (i, i * i), f"l{i}": (-i, i)}, at=[T + i * SECOND] * 2))
            stub.Apply(request)
            apply(stub, "deadlines", puts({f"k{i % 9}": (i, -i)}, ttl=duration(0.3 if i % 2 else 3600)))
            plain = puts({f"k{i % 5}": (i, i), f"m{i % 11}": (0, i)}, at=[T, i] if i % 20 < 15 else [])
            plain.removes.CopyFrom(keys(f"k{(i + 2) % 5}", f"m{(3 * i + 1) % 11 if i % 11 != 5 else 0}"))
            apply(stub, "plain", plain)
            apply(stub, "evicting", insert(i, i % 3, -i, i))
            apply(stub, "points", insert(i % 4, i % 5, i % 4, i % 5))
        apply(stub, "points", batch_pb2.Batch(deletes=points(3, 4, 50, 50), missing_points=2))
        before = {each: hull_of(stub, each) for each in ("data", "evicting", "plain", "points")}
        entities = {each: everyone(stub, each) for each in ("data", "deadlines", "plain")}
        samples = {each: everything(stub, each) for each in ("evicting", "points")}
        server.process.kill()
    with server_process(*options) as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        assert {each: hull_of(stub, each) for each in before} == before
        for each in ("data", "plain"):
            assert everyone(stub, each) == entities[each]
        assert {each: everything(stub, each) for each in samples} == samples
        staying = {key: place for key, place in entities["deadlines"].items() if place[0] % 2 == 0}
        wait_until(lambda: everyone(stub, "deadlines") == staying)
        assert stub.Verify(pb.VerifyRequest(name="deadlines")).keys_equal
        again = pb.ApplyRequest(name="data", producer="p", sequence=60, batch=puts({"z": (0, 0)}, at=[T]))
        assert stub.Apply(again).result.duplicate
        assert counts(apply(stub, "evicting", insert(0, 0))) == {"inserted": 1, "evicted": 1}
        assert everything(stub, "evicting") == [-59, 59, -58, 58, 0, 0, 58, 1, 59, 2]


def test_a_wall_clock_that_is_set_back_makes_nothing_young_again() -> None:
    """Over a restart: an hour ago by the wall clock, points are as old as they were, and leave when they would have."""
    storage = MemoryStorage()
    settings = HullSettings("str", window=Window(max_age=SECOND // 2))

    async def life(ahead: float, batch: batch_pb2.Batch) -> tuple[int, int, int]:
        """The clock before and after a life in which one batch is applied, and the points after it."""
        machine = Machine(AdjustableClock(ahead))
        supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
        engine = Engine(replace(LIMITS), storage, supervisor, machine)
        await engine.start(lambda *_: None)
        hull = engine.hulls.get("a") if engine.hulls.has("a") else await engine.hulls.create("a", settings)
        before = hull.counts.clock or 0
        await engine.hulls.apply(Write("a", decode_batch(batch), engine.driver.time()), create=False)
        await hull.reached(hull.counts.revision + 1)  # the expiry
        await supervisor.stop()
        await engine.close()
        return before, hull.counts.clock or 0, hull.counts.points

    _, first, left = asyncio.run(life(7200.0, puts({"a": (0, 0)})))
    assert left == 0
    before, second, left = asyncio.run(life(-7200.0, puts({"b": (0, 0)})))
    assert (before, left) == (first, 0)
    assert first + SECOND // 2 <= second < first + 3600 * SECOND
