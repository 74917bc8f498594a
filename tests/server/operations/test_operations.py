"""The server as a process: health, reflection, the command line, its end."""

import ctypes
import signal
import subprocess
import sys
import threading
from itertools import repeat
from pathlib import Path

import grpc
import numpy as np
import pytest
from cases import slow
from google.protobuf.descriptor_pool import DescriptorPool
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase
from patience import PATIENCE, wait_until
from processor import wait_for_rest
from server_process import server_process

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

SERVICE, FENCES, ALARMS = "dynhull.v1.HullService", "dynhull.v1.FenceService", "dynhull.v1.AlarmService"
SERVING = health_pb2.HealthCheckResponse.SERVING
NOT_SERVING = health_pb2.HealthCheckResponse.NOT_SERVING


@pytest.mark.parametrize("service", ["", SERVICE, FENCES, ALARMS])
def test_health(channel: grpc.Channel, service: str) -> None:
    health = health_pb2_grpc.HealthStub(channel)
    assert health.Check(health_pb2.HealthCheckRequest(service=service)).status == SERVING


def test_reflection_is_enough_to_call(channel: grpc.Channel) -> None:
    database = ProtoReflectionDescriptorDatabase(channel)
    assert set(database.get_services()) == {
        SERVICE,
        FENCES,
        ALARMS,
        "grpc.health.v1.Health",
        "grpc.reflection.v1alpha.ServerReflection",
    }
    described = DescriptorPool(database).FindServiceByName(SERVICE)
    expected = pb.DESCRIPTOR.services_by_name["HullService"]
    assert [method.name for method in described.methods] == [method.name for method in expected.methods]


def test_a_large_batch_keeps_nobody_waiting(channel: grpc.Channel, stub: HullServiceStub, hull: str) -> None:
    points = np.random.default_rng(0).normal(size=(100_000, 2))
    batch = {"inserts": {"packed": points.astype("<f8").tobytes()}}
    health = health_pb2_grpc.HealthStub(channel)

    def others_are_answered() -> bool:
        """Before a batch is: a first call may have come before it."""
        large = stub.Apply.future(pb.ApplyRequest(name=hull, batch=batch))
        applied = threading.Event()
        large.add_done_callback(lambda _: applied.set())
        answered = 0
        while not applied.is_set():
            assert health.Check(health_pb2.HealthCheckRequest()).status == SERVING
            answered += 1
        assert large.result().result.inserted == len(points)
        return answered > 1

    wait_until(others_are_answered)


def test_drain() -> None:
    """SIGTERM ends waiting calls with UNAVAILABLE; every acknowledged batch has been applied."""
    with server_process() as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name="a"))
        health = health_pb2_grpc.HealthStub(channel).Watch(health_pb2.HealthCheckRequest(service=SERVICE))
        assert next(health).status == SERVING
        watch = stub.Watch(pb.WatchRequest(name="a"))
        next(watch)
        read = stub.GetHull.future(pb.GetHullRequest(name="a", min_revision=1000))
        more = threading.Event()

        def requests():
            for _ in range(3):
                yield pb.IngestRequest(name="a", batch={"inserts": {"coordinates": [1, 2]}})
            more.wait()

        ingest = stub.Ingest.future(requests())
        assert stub.GetHull(pb.GetHullRequest(name="a", min_revision=3)).hull.point_count == 3
        server.process.terminate()
        assert next(health).status == NOT_SERVING
        for call in (lambda: list(watch), read.result, ingest.result):
            with pytest.raises(grpc.RpcError, match="shutting down") as caught:
                call()
            assert caught.value.code() == grpc.StatusCode.UNAVAILABLE
        more.set()
        health.cancel()
        assert server.process.wait(PATIENCE) == 0
        with pytest.raises(grpc.RpcError) as caught:
            stub.CreateHull(pb.CreateHullRequest(name="b"))
        assert caught.value.code() == grpc.StatusCode.UNAVAILABLE


def test_a_batch_under_way_is_finished_at_the_end() -> None:
    points = np.random.default_rng(0).normal(size=(200_000, 2))
    batch = {"inserts": {"packed": points.astype("<f8").tobytes()}}
    with server_process() as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name="a"))
        watch = stub.Watch(pb.WatchRequest(name="a"))
        next(watch)
        first = stub.Apply.future(pb.ApplyRequest(name="a", batch=batch))
        second = stub.Apply.future(pb.ApplyRequest(name="a", batch=batch))
        assert next(watch).revision >= 1
        server.process.terminate()
        assert {first.result().result.revision, second.result().result.revision} == {1, 2}
        with pytest.raises(grpc.RpcError):
            list(watch)


def test_what_a_writer_that_has_gone_left_behind_does_not_hold_up_the_end() -> None:
    points = np.random.default_rng(0).normal(size=(8192, 2)).astype("<f8").tobytes()
    request = pb.StreamRequest(name="a", batch={"inserts": {"packed": points}})
    with server_process() as server:
        channels = [grpc.insecure_channel(server.address) for _ in range(3)]
        HullServiceStub(channels[0]).CreateHull(pb.CreateHullRequest(name="a"))
        for channel in channels:
            acknowledgements = HullServiceStub(channel).Stream(repeat(request))
            for _ in range(5):
                next(acknowledgements)
        for channel in channels:
            channel.close()
        server.process.terminate()  # in peace, and without a word


@slow
@pytest.mark.one_process("a supervisor has one thread")
def test_a_signal_that_another_thread_gets_ends_the_server() -> None:
    with server_process() as server:
        pid = server.process.pid
        wait_for_rest(pid)
        other = next(int(task.name) for task in Path(f"/proc/{pid}/task").iterdir() if int(task.name) != pid)
        assert ctypes.CDLL(None).tgkill(pid, other, signal.SIGTERM) == 0
        assert server.process.wait(PATIENCE) == 0


def test_python_m_is_the_same_and_keeps_its_data_here(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dynhull_server", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as process:
        assert process.stdout.readline().startswith("dynhull serving on 127.0.0.1:")
        process.terminate()
        assert process.wait(PATIENCE) == 0
    assert (tmp_path / "dynhull-data" / "dynhull.db").exists()
