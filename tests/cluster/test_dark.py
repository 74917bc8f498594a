"""The network between two machines of a cluster stops carrying bytes: who asks notices, and connects anew."""

import asyncio
import socket
from contextlib import AbstractAsyncContextManager
from types import SimpleNamespace
from typing import Any

import grpc
import pytest
from patience import until
from proxy import Proxy, proxy
from worker_links import running

from dynhull_cluster.frame_server import FrameServer
from dynhull_cluster.frames import Frames, Kind
from dynhull_cluster.machines.addresses import Addresses
from dynhull_cluster.machines.board import Owner, Tables
from dynhull_cluster.machines.entrance import proof_of
from dynhull_cluster.versions import NEWEST
from dynhull_cluster.worker_link import WorkerLink
from dynhull_server.rpc.status import RelayedError

PARTITION, WORKER, SECRET = 3, "north-1/0", "secret"
READ, WRITE = "/dynhull.v1.HullService/GetHull", "/dynhull.v1.HullService/DeleteHull"
CALL: Any = SimpleNamespace(owner="owner", caller=SimpleNamespace(key=""))


def linked(port: int, ping_interval: float) -> AbstractAsyncContextManager[WorkerLink]:
    """A gateway's link to a worker behind a network."""
    ways = Addresses(SECRET, None, ping_interval)
    ways.learn(
        Tables({PARTITION: Owner(1, WORKER, "", f"127.0.0.1 1 {port}", "now", False, True)}, {}, {}, {}, PARTITION + 1)
    )
    return running(WorkerLink(PARTITION, ways, (), lambda: None))


def port_of(way: Proxy) -> int:
    return int(way.address.rpartition(":")[2])


def test_a_gateway_goes_on_by_another_connection() -> None:
    may_answer = asyncio.Event()

    async def answer(_requests: Any, _context: Any) -> bytes:
        await may_answer.wait()
        return b"answer"

    async def run() -> None:
        handler = grpc.stream_unary_rpc_method_handler(answer, request_deserializer=bytes)
        service = grpc.method_handlers_generic_handler(
            "dynhull.v1.HullService", {"GetHull": handler, "DeleteHull": handler}
        )
        server = FrameServer([service], {}, proof_of(PARTITION, WORKER, SECRET).encode())
        bound = socket.create_server(("127.0.0.1", 0))
        await server.listen_on(bound, None)
        try:
            with proxy(f"127.0.0.1:{bound.getsockname()[1]}") as way:
                await over(way)
        finally:
            server.say_goodbye()
            await server.close()

    async def over(way: Proxy) -> None:
        async with linked(port_of(way), 0.4) as link:
            await until(lambda: link.present)
            swallowed = asyncio.create_task(link.ask(WRITE, CALL, b""))
            await asyncio.sleep(0)
            way.silence()
            with pytest.raises(RelayedError, match="the outcome is unknown"):
                await swallowed
            may_answer.set()
            assert await link.ask(READ, CALL, b"") == b"answer"

    asyncio.run(run())


class Earlier(Frames):
    """A worker of a version that knows no pings, and answers late."""

    def received(self, number: int, kind: Kind, _rest: bytes) -> None:
        if kind is Kind.GREETING:
            self.send(NEWEST, Kind.ANSWER)
        else:
            self._loop.call_later(0.3, self.send, number, Kind.ANSWER, b"late")


def test_a_worker_that_knows_no_pings_is_not_lost() -> None:
    async def run() -> None:
        listening = await asyncio.get_running_loop().create_server(Earlier, "127.0.0.1", 0)
        async with listening, linked(listening.sockets[0].getsockname()[1], 0.05) as link:
            assert await link.ask(WRITE, CALL, b"") == b"late"

    asyncio.run(run())
