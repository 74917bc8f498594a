"""What calls end with that are under way, or arrive, while a server stops."""

import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import grpc
import numpy as np
from google.rpc.error_details_pb2 import ErrorInfo
from grpc_status import rpc_status
from patience import PATIENCE, wait_until
from server_process import server_process

from dynhull_proto.v1 import batch_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

BATCH = batch_pb2.Batch(inserts=points_pb2.Points(packed=np.eye(2).tobytes()))
READ = pb.Read(get_hull=pb.GetHullRequest(name="a"))
CALLS: list[Callable[[HullServiceStub], Any]] = [
    lambda stub: stub.GetHull(READ.get_hull, timeout=PATIENCE),
    lambda stub: stub.Apply(pb.ApplyRequest(name="a", batch=BATCH), timeout=PATIENCE),
    lambda stub: stub.ListHulls(pb.ListHullsRequest(), timeout=PATIENCE),
    lambda stub: list(stub.Query(iter([pb.QueryRequest(reads=[READ])]), timeout=PATIENCE)),
    lambda stub: next(stub.Watch(pb.WatchRequest(name="a"), timeout=PATIENCE)),
    lambda stub: list(stub.Stream(batches(), timeout=PATIENCE)),
]
# The last is gRPC's own way to end a call that has arrived, and that a server which stops has not begun.
NAMED = {("UNAVAILABLE", "DRAINING"), ("UNAVAILABLE", "STARTING"), ("UNAVAILABLE", ""), ("CANCELLED", "")}


def batches() -> Iterator[pb.StreamRequest]:
    yield pb.StreamRequest(name="a")
    yield pb.StreamRequest(batch=BATCH)


def test_every_call_ends_as_promised_and_the_server_has_nothing_to_complain_about() -> None:
    ends: set[tuple[str, str]] = set()
    begun, over = threading.Event(), threading.Event()

    def call(address: str, number: int) -> None:
        with grpc.insecure_channel(address, [("grpc.use_local_subchannel_pool", 1)]) as channel:
            stub = HullServiceStub(channel)
            while not over.is_set():
                number += 1
                try:
                    CALLS[number % len(CALLS)](stub)
                    begun.set()
                except grpc.RpcError as error:
                    ends.add((error.code().name, reason_of(error)))

    def query(address: str) -> None:
        """Many at a time, so that one of them has just begun to be answered."""
        with grpc.insecure_channel(address, [("grpc.use_local_subchannel_pool", 1)]) as channel:
            stub = HullServiceStub(channel)
            while not over.is_set():
                calls = [stub.Query(iter([pb.QueryRequest(reads=[READ])]), timeout=PATIENCE) for _ in range(50)]
                for each in calls:
                    with suppress(grpc.RpcError):
                        list(each)
                    if each.code() is not grpc.StatusCode.OK:
                        ends.add((each.code().name, reason_of(each)))

    with server_process("--log-level", "error") as server:
        with grpc.insecure_channel(server.address) as channel:
            HullServiceStub(channel).CreateHull(pb.CreateHullRequest(name="a"))
        threads = [threading.Thread(target=call, args=(server.address, number)) for number in range(12)]
        threads += [threading.Thread(target=query, args=(server.address,)) for _ in range(4)]
        for each in threads:
            each.start()
        assert begun.wait(PATIENCE)
        server.process.terminate()
        server.process.wait(PATIENCE)
        wait_until(lambda: ("UNAVAILABLE", "") in ends)
        over.set()
        for each in threads:
            each.join(PATIENCE)
    assert {("UNAVAILABLE", "DRAINING"), ("UNAVAILABLE", "")} <= ends <= NAMED


def reason_of(error: Any) -> str:
    status = rpc_status.from_call(error)
    for detail in () if status is None else status.details:
        info = ErrorInfo()
        if detail.Unpack(info):
            return str(info.reason)
    return ""
