"""A server that stood still while another one took its hulls: what it has read before is no answer any more."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import grpc
import pytest
from google.rpc import error_details_pb2
from grpc_status import rpc_status

from dynhull_proto.v1 import fence_service_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub
from dynhull_server.app import Server
from dynhull_server.settings import Settings
from dynhull_server.storage.memory import MemoryStorage

pytestmark = pytest.mark.one_process("its server runs in the process of the test")

POINT = pb.ApplyRequest(name="hull", batch={"inserts": {"packed": bytes(16)}})
LOCATE = pb.LocateRequest(name="hull", points={"packed": bytes(16)})
# Both stubs, and what is asked.
Ask = Callable[[HullServiceStub, FenceServiceStub], Awaitable[Any]]
READS: dict[str, Ask] = {
    "a hull": lambda hulls, _: hulls.GetHull(pb.GetHullRequest(name="hull")),
    "a missing hull": lambda hulls, _: hulls.GetHull(pb.GetHullRequest(name="missing")),
    "a place": lambda hulls, _: hulls.Locate(LOCATE),
    "all hulls": lambda hulls, _: hulls.ListHulls(pb.ListHullsRequest()),
    "all fences": lambda _, fences: fences.ListFences(fence_service_pb2.ListFencesRequest()),
    "reads of a message": lambda hulls, _: anext(
        aiter(hulls.Query(iter([pb.QueryRequest(reads=[pb.Read(locate=LOCATE)] * 3)])))
    ),
}


class Lent(MemoryStorage):
    """A storage that is this server's until it has been asked so many times."""

    def __init__(self) -> None:
        super().__init__(keeps=False)
        self.left = 1_000

    def entitled(self) -> bool:
        self.left -= 1
        return self.left >= 0


async def replaced(ask: Ask) -> Any:
    """What a caller gets of a server that is replaced after the call was admitted."""
    storage = Lent()
    server = Server(Settings(in_memory=True, port=0, create_on_write=True, scrub_cpu=0), storage)
    await server.start()
    try:
        async with grpc.aio.insecure_channel(server.address) as channel:
            hulls, fences = HullServiceStub(channel), FenceServiceStub(channel)
            await hulls.Apply(POINT)
            storage.left = 1
            return await ask(hulls, fences)
    finally:
        await server.drain()


@pytest.mark.parametrize("ask", READS.values(), ids=READS)
def test_what_was_read_before_does_not_leave(ask: Ask) -> None:
    with pytest.raises(grpc.aio.AioRpcError) as refused:
        asyncio.run(replaced(ask))
    assert refused.value.code() is grpc.StatusCode.UNAVAILABLE
    status = rpc_status.from_call(refused.value)
    info = error_details_pb2.ErrorInfo()
    assert status is not None
    assert status.details[0].Unpack(info)
    assert info.reason == "STARTING"


def test_what_was_committed_is_acknowledged() -> None:
    assert asyncio.run(replaced(lambda hulls, _: hulls.Apply(POINT))).result.revision == 2
