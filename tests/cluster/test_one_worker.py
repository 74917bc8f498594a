"""One worker gets every request, whatever names it has, and is asked again as soon as it is there."""

import asyncio
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from patience import PATIENCE

from dynhull_client import Batch, HullClient
from dynhull_cluster.frames import Frames, Kind, unpack_request
from dynhull_cluster.sockets import Sockets
from dynhull_cluster.worker_link import WorkerLink
from dynhull_server.rpc.status import RelayedError, WorkerAwayError

CALL: Any = SimpleNamespace(owner="owner", caller=SimpleNamespace(key=""))
METHOD = "/dynhull.v1.HullService/GetHull"


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


def test_who_asks_again_just_when_the_worker_has_ended_is_told(tmp_path: Path) -> None:
    async def run() -> None:
        link, running = await linked(tmp_path, Ends)
        with pytest.raises(RelayedError, match="the outcome is unknown"):
            await link.ask(METHOD, CALL, b"")
        with pytest.raises(WorkerAwayError):
            link.stream(METHOD, ())
        with pytest.raises(WorkerAwayError):
            await link.ask(METHOD, CALL, b"")
        running.cancel()

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
        running.cancel()

    asyncio.run(run())
