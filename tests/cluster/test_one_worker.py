"""One worker gets every request, whatever names it has, and is asked again as soon as it is there."""

import asyncio
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import grpc
import numpy as np
import pytest
from patience import PATIENCE, turns, until

from dynhull_client import Batch, HullClient
from dynhull_cluster.frames import MOST_BYTES, Frames, Kind, unpack_request
from dynhull_cluster.sockets import Sockets
from dynhull_cluster.worker_link import WorkerLink
from dynhull_server.rpc.status import RelayedError, WorkerAwayError

CALL: Any = SimpleNamespace(owner="owner", caller=SimpleNamespace(key=""))
METHOD = "/dynhull.v1.HullService/GetHull"
WRITE = "/dynhull.v1.HullService/DeleteHull"  # it is not repeated


def test_requests_that_do_not_begin_with_a_name(client: HullClient) -> None:
    """Their first bytes are no name, and may be no text at all."""
    for name in ("reads/a", "others/a"):
        client.create_hull(name)
    client.transfer({name: Batch(insert=[[0, 0], [4, 0], [0, 4]]) for name in ("reads/a", "others/a")})
    points = np.random.default_rng(1).normal(size=(100, 2))
    with client.pipeline() as pipeline:
        asked = [pipeline.locate(name, [point]) for name in ("reads/a", "others/a") for point in points]
        assert [int(each.result().sides[0]) for each in asked] == client.locate("reads/a", points).sides.tolist() * 2
    assert [each.name for each in client.list_hulls("reads/")] == ["reads/a"]
    assert client.separate("reads/a", "others/a").intersect


class Ends(Frames):
    """A worker that ends as soon as it is asked."""

    def received(self, *_: object) -> None:
        self.close()


class Answers(Frames):
    """A worker that answers."""

    def received(self, number: int, kind: Kind, _: bytes) -> None:
        if kind is Kind.REQUEST:
            self.send(number, Kind.ANSWER, b"answer")


class Stalls(Frames):
    """A worker that has stopped, until `resume`; it answers a request without a message."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self.requests = 0
        self._transport.pause_reading()
        started.append(self)

    def resume(self) -> None:
        self._transport.resume_reading()

    def received(self, number: int, kind: Kind, rest: bytes) -> None:
        self.requests += kind is Kind.REQUEST
        if kind is Kind.REQUEST and not unpack_request(rest)[2]:
            self.send(number, Kind.ANSWER, b"answer")


started: list[Stalls] = []


async def linked(folder: Path, worker: type[Frames]) -> tuple[WorkerLink, "asyncio.Task[None]"]:
    sockets = Sockets(folder)
    there = asyncio.Event()
    link = WorkerLink(0, sockets, (), there.set)
    listening = await asyncio.get_running_loop().create_unix_server(worker, sockets.frames(0))
    running = asyncio.create_task(link.run())
    await asyncio.wait_for(there.wait(), PATIENCE)
    listening.close()
    return link, running


async def ended(link: WorkerLink, running: "asyncio.Task[None]") -> None:
    running.cancel()
    await asyncio.wait([running])
    await link.close()


def test_who_asks_again_just_when_the_worker_has_ended_is_told(tmp_path: Path) -> None:
    async def run() -> None:
        link, running = await linked(tmp_path, Ends)
        with pytest.raises(RelayedError, match="the outcome is unknown"):
            await link.ask(WRITE, CALL, b"")
        with pytest.raises(WorkerAwayError):
            link.stream(METHOD, ())
        asking = asyncio.create_task(link.ask(WRITE, CALL, b""))  # it has not begun
        await turns()
        next_one = await asyncio.get_running_loop().create_unix_server(Answers, Sockets(tmp_path).frames(0))
        assert await asyncio.wait_for(asking, PATIENCE) == b"answer"
        next_one.close()
        await ended(link, running)

    asyncio.run(run())


class Leaves(Frames):
    """A worker that ends when it is asked to."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        leaving.append(self)


leaving: list[Leaves] = []


def test_calls_that_grpc_would_have_wait_end_with_their_worker(tmp_path: Path) -> None:
    """Nobody listens for gRPC, which waits for that."""

    async def run() -> None:
        link, running = await linked(tmp_path, Leaves)
        large = asyncio.create_task(link.ask(WRITE, CALL, bytes(MOST_BYTES + 1)))
        upstream = link.stream(METHOD, ())
        writing = asyncio.create_task(upstream.write(b""))
        reading = asyncio.create_task(upstream.read())
        await turns()
        assert not any(each.done() for each in (large, writing, reading))
        leaving.pop().close()
        async with asyncio.timeout(PATIENCE):
            assert not await writing
            for each in (large, reading):
                with pytest.raises(RelayedError, match="the outcome is unknown"):
                    await each
        await ended(link, running)

    asyncio.run(run())


def test_what_a_worker_sent_before_it_ended_arrives(tmp_path: Path) -> None:
    sent = asyncio.Event()

    async def serve(requests: Any, context: Any) -> None:
        async for request in requests:
            for _ in range(3):
                await context.write(request)
            sent.set()

    async def run() -> None:
        worker = grpc.aio.server()
        handlers = {"GetHull": grpc.stream_stream_rpc_method_handler(serve)}
        worker.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("dynhull.v1.HullService", handlers),))
        worker.add_insecure_port(f"unix:{Sockets(tmp_path).grpc(0)}")
        await worker.start()
        link, running = await linked(tmp_path, Leaves)
        upstream = link.stream(METHOD, ())
        assert await upstream.write(b"answer")
        assert await upstream.read() == b"answer"
        await sent.wait()
        leaving.pop().close()
        await worker.stop(None)
        await until(lambda: not link.present)
        async with asyncio.timeout(PATIENCE):
            assert [await upstream.read(), await upstream.read()] == [b"answer"] * 2
            with pytest.raises(RelayedError) as lost:
                await upstream.read()
            assert lost.value.status.code == grpc.StatusCode.UNAVAILABLE.value[0]
        await ended(link, running)

    asyncio.run(run())


def test_a_worker_that_has_stopped_gets_nothing_from_callers_that_have_left(tmp_path: Path) -> None:
    """Nor does the gateway keep it: what the worker does not take waits at the caller."""
    message = bytes(200_000)

    async def run() -> None:
        link, running = await linked(tmp_path, Stalls)
        asked = []
        for _ in range(100):
            asked.append(asyncio.create_task(link.ask(METHOD, CALL, message)))
            await asyncio.wait(asked, timeout=0)
        for each in asked:
            each.cancel()
        await asyncio.wait(asked)
        started[0].resume()
        assert await asyncio.wait_for(link.ask(METHOD, CALL, b""), PATIENCE) == b"answer"
        assert 1 < started[0].requests < 20
        await ended(link, running)

    asyncio.run(run())
