"""Restarts of a killed server after its machine's clock was set back or forward."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import grpc
import wall_clock
from cases import slow
from entity_messages import SECOND, STRINGS, duration, keys, points, puts, times, window
from patience import wait_until
from server_process import server_process

from dynhull_proto.v1 import batch_pb2, hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

BRIEF = 0.3  # seconds
HALF_AN_HOUR, THREE_HOURS = 1800, 10800  # seconds: less and more than the clock is set by
# Batches read the server's clock in these steps.
TICK = SECOND // 10
T = 1_700_000_000 * SECOND
# One first part: the time of a worker does not go back, but two workers read it at different moments.
CONFIGS = {
    "t/brief": hull_pb2.HullConfig(identity=STRINGS, window=window(BRIEF)),
    "t/points": hull_pb2.HullConfig(window=window(BRIEF)),
    "t/half-an-hour": hull_pb2.HullConfig(identity=STRINGS, window=window(HALF_AN_HOUR)),
    "t/data": hull_pb2.HullConfig(identity=STRINGS, window=window(HALF_AN_HOUR, clock=hull_pb2.CLOCK_DATA)),
    "t/deadlines": hull_pb2.HullConfig(identity=STRINGS),
}


@contextmanager
def life(data: Path, offset: str) -> Iterator[HullServiceStub]:
    """A server whose wall clock is off by `offset`, killed at the end."""
    with (
        server_process("--data", str(data), wrap=wall_clock.at(offset), killed=True, torn=True) as server,
        grpc.insecure_channel(server.address) as channel,
    ):
        try:
            yield HullServiceStub(channel)
        finally:
            server.process.kill()


def put(stub: HullServiceStub, name: str, batch: batch_pb2.Batch) -> int:
    """Apply a batch. Returns the clock of the hull."""
    return stub.Apply(pb.ApplyRequest(name=name, batch=batch)).result.clock_time.ToMicroseconds()


def hulls(stub: HullServiceStub) -> dict[str, hull_pb2.Hull]:
    return {hull.name: hull for hull in stub.ListHulls(pb.ListHullsRequest()).hulls}


def clocks(stub: HullServiceStub) -> dict[str, int]:
    return {name: hull.clock_time.ToMicroseconds() for name, hull in hulls(stub).items()}


def time_of(stub: HullServiceStub, name: str, key: str) -> int:
    found = stub.GetPositions(pb.GetPositionsRequest(name=name, keys=keys(key)))
    return int.from_bytes(found.times.packed, "little", signed=True)


def wait_for(stub: HullServiceStub, name: str, revision: int, count: int) -> int:
    """Wait until a hull has that number of points, which it then has at that revision. Returns its clock."""
    wait_until(lambda: hulls(stub)[name].point_count == count)
    hull = hulls(stub)[name]
    assert (hull.revision, hull.point_count) == (revision, count)
    return hull.clock_time.ToMicroseconds()


@slow
def test_points_leave_once_and_in_time_whatever_the_wall_clock_says(tmp_path: Path) -> None:
    brief = round(BRIEF * SECOND)
    with life(tmp_path / "data", "-0") as stub:
        for name, config in CONFIGS.items():
            stub.CreateHull(pb.CreateHullRequest(name=name, config=config))
        put(stub, "t/data", puts({"a": (0, 0)}, at=[T]))
        put(stub, "t/half-an-hour", puts({"a": (0, 0)}))
        start = put(stub, "t/deadlines", puts({"half an hour": (0, 0)}, ttl=duration(HALF_AN_HOUR)))
        put(stub, "t/deadlines", puts({"three hours": (1, 1)}, expire_times=times(start + THREE_HOURS * SECOND)))
        put(stub, "t/deadlines", puts({"a": (2, 2)}, ttl=duration(BRIEF)))
        put(stub, "t/brief", puts({"a": (0, 0)}))
        wait_for(stub, "t/brief", revision=2, count=0)
        wait_for(stub, "t/deadlines", revision=4, count=2)
        put(stub, "t/points", batch_pb2.Batch(inserts=points(0, 0, 1, 1)))
        deadline = put(stub, "t/deadlines", puts({"b": (2, 2)}, ttl=duration(BRIEF))) + brief
        end = put(stub, "t/brief", puts({"b": (0, 0)})) + brief
        before = clocks(stub)
    with life(tmp_path / "data", "-1h") as stub:
        after = clocks(stub)
        assert all(after[name] >= before[name] for name in CONFIGS)
        assert end <= wait_for(stub, "t/brief", revision=4, count=0) < end + HALF_AN_HOUR * SECOND
        assert deadline <= wait_for(stub, "t/deadlines", revision=6, count=2)
        wait_for(stub, "t/points", revision=2, count=0)
        clock = put(stub, "t/brief", puts({"c": (0, 0)}))
        assert clock >= end
        assert put(stub, "t/half-an-hour", puts({"b": (1, 1)})) > end - TICK
        assert time_of(stub, "t/half-an-hour", "b") >= end
        assert clock + brief <= wait_for(stub, "t/brief", revision=6, count=0) < end + HALF_AN_HOUR * SECOND
        before = clocks(stub)
    with life(tmp_path / "data", "+1h") as stub:
        end = wait_for(stub, "t/half-an-hour", revision=3, count=0)
        assert end >= before["t/half-an-hour"] + HALF_AN_HOUR * SECOND
        wait_for(stub, "t/deadlines", revision=7, count=1)
        assert hulls(stub)["t/data"].clock_time.ToMicroseconds() == T
        quiet = hulls(stub)
    with life(tmp_path / "data", "-0") as stub:
        assert hulls(stub) == quiet
        clock = put(stub, "t/brief", puts({"d": (0, 0)}))
        assert clock > end - TICK
        assert clock + brief <= wait_for(stub, "t/brief", revision=8, count=0) < end + HALF_AN_HOUR * SECOND
        assert {name: hull for name, hull in hulls(stub).items() if name != "t/brief"} == {
            name: hull for name, hull in quiet.items() if name != "t/brief"
        }
