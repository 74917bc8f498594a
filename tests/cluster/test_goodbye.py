"""A worker that stops as planned says goodbye: what it has begun is answered, and the rest is for the next one."""

import asyncio
import socket
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import grpc
import pytest
from patience import PATIENCE
from worker_links import running

from dynhull_cluster import worker_link
from dynhull_cluster.divisions.peers import PeerAwayError, Peers, peer_handler
from dynhull_cluster.frame_server import FrameServer
from dynhull_cluster.frames import (
    ANSWERS_PINGS,
    HEADER,
    MOST_BYTES,
    Frames,
    Kind,
    pack_request,
    unpack_request,
)
from dynhull_cluster.sockets import Sockets
from dynhull_cluster.versions import NEWEST, own_versions
from dynhull_cluster.worker_link import WorkerLink
from dynhull_server.rpc.status import WorkerAwayError

CALL: Any = SimpleNamespace(owner="owner", caller=SimpleNamespace(key=""))
WRITE = "/dynhull.v1.HullService/DeleteHull"  # what is not repeated, if it may have begun
LETTERS = "/dynhull.Shards/Send"
UNKNOWN_KIND = 99


class Worker(Frames):
    """One that does what a test says; `taken` are the messages of the requests that it has got."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self.taken: dict[bytes, int] = {}
        self.came = asyncio.Event()
        self.left = asyncio.Event()
        workers.put_nowait(self)

    def connection_lost(self, error: Exception | None) -> None:
        super().connection_lost(error)
        self.left.set()

    def received(self, number: int, kind: Kind, rest: bytes) -> None:
        if kind is Kind.REQUEST:
            self.taken[unpack_request(rest)[2]] = number
            self.came.set()

    async def takes(self, message: bytes) -> int:
        while message not in self.taken:
            self.came.clear()
            await self.came.wait()
        return self.taken[message]


workers: asyncio.Queue[Worker]


def linked(folder: Path) -> AbstractAsyncContextManager[WorkerLink]:
    """A gateway's link to the workers at a socket."""
    global workers
    workers = asyncio.Queue()
    return running(WorkerLink(0, Sockets(folder), (), lambda: None))


async def started(folder: Path) -> tuple[asyncio.Server, Worker]:
    """The next worker at the socket, connected."""
    listening = await asyncio.get_running_loop().create_unix_server(Worker, Sockets(folder).frames(0))
    return listening, await workers.get()


def test_what_came_after_the_last_request_taken_is_for_the_next_worker(tmp_path: Path) -> None:
    async def run() -> None:
        async with linked(tmp_path) as link:
            listening, one = await started(tmp_path)
            begun = asyncio.create_task(link.ask(WRITE, CALL, b"begun"))
            await one.takes(b"begun")
            after = asyncio.create_task(link.ask(WRITE, CALL, b"after"))
            await one.takes(b"after")
            listening.close()
            one.send(one.taken[b"begun"], Kind.GOODBYE)
            listening, other = await started(tmp_path)
            other.send(await other.takes(b"after"), Kind.ANSWER, b"of the other")
            assert await after == b"of the other"
            later = asyncio.create_task(link.ask(WRITE, CALL, b"later"))
            other.send(await other.takes(b"later"), Kind.ANSWER, b"of the other")
            assert await later == b"of the other"
            assert not one.left.is_set()
            one.send(one.taken[b"begun"], Kind.ANSWER, b"of the one")
            assert await begun == b"of the one"
            await one.left.wait()
            assert other.taken.keys() == {b"after", b"later"}
            listening.close()

    asyncio.run(run())


def test_a_large_request_that_was_begun_is_answered_before_the_connection_ends(tmp_path: Path) -> None:
    """It goes through gRPC, and the worker serves that until the gateway has all answers."""
    may_answer, begun = asyncio.Event(), asyncio.Event()

    async def serve(requests: Any, context: Any) -> None:
        async for _ in requests:
            begun.set()
        await may_answer.wait()
        await context.write(b"answer")

    async def run() -> None:
        server = grpc.aio.server()
        handlers = {"DeleteHull": grpc.stream_stream_rpc_method_handler(serve)}
        server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("dynhull.v1.HullService", handlers),))
        server.add_insecure_port(f"unix:{Sockets(tmp_path).grpc(0)}")
        await server.start()
        async with linked(tmp_path) as link:
            listening, one = await started(tmp_path)
            large = asyncio.create_task(link.ask(WRITE, CALL, bytes(MOST_BYTES + 1)))
            await begun.wait()
            listening.close()
            one.send(0, Kind.GOODBYE)
            listening, _ = await started(tmp_path)
            assert not one.left.is_set()
            may_answer.set()
            assert await large == b"answer"
            await one.left.wait()
            listening.close()
        await server.stop(None)

    asyncio.run(run())


class SkippingLoop(asyncio.SelectorEventLoop):
    """A loop whose time passes at once where somebody would wait."""

    skipped = 0.0

    def time(self) -> float:
        return super().time() + self.skipped


def test_nobody_waits_longer_than_the_pages_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def skip(_: asyncio.Event, seconds: float) -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, SkippingLoop)
        loop.skipped += seconds

    async def seconds_waited() -> float:
        link = WorkerLink(0, Sockets(tmp_path), (), lambda: None)
        begun = asyncio.get_running_loop().time()
        with pytest.raises(WorkerAwayError):
            await link.ask(WRITE, CALL, b"")
        return asyncio.get_running_loop().time() - begun

    monkeypatch.setattr(worker_link, "_until", skip)
    with asyncio.Runner(loop_factory=SkippingLoop) as runner:
        assert 10.0 <= runner.run(seconds_waited()) < 15.0


class Asker:
    """One that asks a frame server over a bare socket."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    def send(self, number: int, kind: int, *parts: bytes) -> None:
        self._writer.write(HEADER.pack(sum(map(len, parts)), number, kind) + b"".join(parts))

    def ask(self, number: int, letter: bytes) -> None:
        self.send(number, Kind.REQUEST, *pack_request(LETTERS.encode(), b" ", letter))

    async def read(self) -> tuple[int, int, bytes] | None:
        """The number, the kind and the rest of a frame; None at the end."""
        header = await self._reader.read(HEADER.size)
        if not header:
            return None
        length, number, kind = HEADER.unpack(header)
        return number, kind, await self._reader.readexactly(length)

    def close(self) -> None:
        self._writer.close()


class Letters:
    """A frame server that answers letters when it may."""

    def __init__(self) -> None:
        self.taken: asyncio.Queue[bytes] = asyncio.Queue()
        self.may_answer = asyncio.Event()
        self.server = FrameServer((peer_handler(self._receive),), {}, b"secret")

    async def _receive(self, letter: bytes) -> bytes:
        self.taken.put_nowait(letter)
        await self.may_answer.wait()
        return letter

    async def asker(self, version: int) -> Asker:
        """Somebody who has greeted it."""
        bound = socket.socket()
        bound.bind(("127.0.0.1", 0))
        port = bound.getsockname()[1]
        await self.server.listen_on(bound, None)
        asker = Asker(*await asyncio.open_connection("127.0.0.1", port))
        asker.send(version, Kind.GREETING, b"secret")
        assert await asker.read() == (0, Kind.VERSIONS, own_versions().text.encode())
        assert await asker.read() == (version, Kind.ANSWER, ANSWERS_PINGS)
        asker.send(7, UNKNOWN_KIND, b"of a later version")
        asker.ask(1, b"first")
        assert await self.taken.get() == b"first"
        return asker


def test_a_worker_says_goodbye_and_waits_until_everybody_has_left() -> None:
    async def run() -> None:
        letters = Letters()
        asker = await letters.asker(NEWEST)
        letters.server.say_goodbye()
        assert await asker.read() == (1, Kind.GOODBYE, b"")
        asker.ask(2, b"second")
        closing = asyncio.create_task(letters.server.close())
        letters.may_answer.set()
        assert await asker.read() == (1, Kind.ANSWER, b"first")
        assert not closing.done()
        asker.close()
        await closing
        assert letters.taken.empty()

    asyncio.run(asyncio.wait_for(run(), PATIENCE))


def test_one_of_an_older_version_gets_no_goodbye() -> None:
    """It is served to the end, as it was by a worker of its version."""

    async def run() -> None:
        letters = Letters()
        asker = await letters.asker(0)
        letters.may_answer.set()
        letters.server.say_goodbye()
        asker.ask(2, b"second")
        assert await asker.read() == (1, Kind.ANSWER, b"first")
        assert await asker.read() == (2, Kind.ANSWER, b"second")
        await letters.server.close()
        assert await asker.read() is None
        asker.close()

    asyncio.run(asyncio.wait_for(run(), PATIENCE))


def test_roots_go_to_the_next_worker_of_a_shard(tmp_path: Path) -> None:
    async def run() -> None:
        global workers
        workers = asyncio.Queue()
        peers = Peers(Sockets(tmp_path))
        listening = await asyncio.get_running_loop().create_unix_server(Worker, Sockets(tmp_path).frames(0))
        begun = asyncio.create_task(peers.ask(0, b"begun"))
        one = await workers.get()
        number = await one.takes(b"begun")
        after = asyncio.create_task(peers.ask(0, b"after"))
        await one.takes(b"after")
        listening.close()
        one.send(number, Kind.GOODBYE)
        with pytest.raises(PeerAwayError):
            await after
        listening = await asyncio.get_running_loop().create_unix_server(Worker, Sockets(tmp_path).frames(0))
        after = asyncio.create_task(peers.ask(0, b"after"))
        other = await workers.get()
        other.send(await other.takes(b"after"), Kind.ANSWER, b"of the other")
        assert await after == b"of the other"
        one.send(number, Kind.ANSWER, b"of the one")
        assert await begun == b"of the one"
        await one.left.wait()
        peers.close()
        listening.close()

    asyncio.run(asyncio.wait_for(run(), PATIENCE))
