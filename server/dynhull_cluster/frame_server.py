"""The answering end of a connection: a worker serves the calls that arrive as frames, by the handlers that gRPC has.

Of calls that arrive together, neighbours that ask the same about other points are a run, which is answered at once: a
busy worker finds more of them, and so has less to do for each.
"""

import asyncio
import hmac
import socket
import ssl
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from itertools import islice, takewhile
from pathlib import Path
from typing import Any, NamedTuple

import grpc
from google.rpc import code_pb2
from google.rpc.status_pb2 import Status

from dynhull_server.rpc.methods import RunHandler
from dynhull_server.rpc.runs import Run, run_of_requests

from .callers import KEY, OWNER
from .frames import ANSWERS_PINGS, Frames, Kind, unpack_request
from .versions import NEWEST, UNSAID, Versions, own_versions

DETAILS = "grpc-status-details-bin"
# Seconds that the others get to receive their last answers and to close their connections.
LEAVE_SECONDS = 1.0
ENDED = Status(code=code_pb2.UNAVAILABLE, message="the call ended without an answer; its outcome is unknown")


class FrameServer:
    """Listens from `listen` or `listen_on` until `say_goodbye`, and serves until `close`.

    Args:
        handlers: the handlers of all methods.
        runs: those of runs of calls, by the paths of their methods.
        greeting: what a connection has to begin with; empty where only gateways can connect.

    Attributes:
        greeting: the same.
        runs: the handlers of runs, by the paths of their methods.
        handler: finds the handler of a method by its path.
        leaving: whether it has said goodbye.
    """

    def __init__(
        self, handlers: Sequence[grpc.GenericRpcHandler], runs: Mapping[str, RunHandler], greeting: bytes = b""
    ) -> None:
        self._handlers = handlers
        self.greeting = greeting
        self.runs = {path.encode(): handler for path, handler in runs.items()}
        self.handler = cache(self._find)
        self.leaving = False
        self._open: set[_Connection] = set()
        self._left = asyncio.Event()

    async def listen(self, path: Path) -> None:
        """Listen on a Unix socket, and serve in the background."""
        self._server = await asyncio.get_running_loop().create_unix_server(self._connect, path)

    async def listen_on(self, bound: socket.socket, tls: ssl.SSLContext | None) -> None:
        """Listen on a socket that is bound, and serve in the background."""
        self._server = await asyncio.get_running_loop().create_server(self._connect, sock=bound, ssl=tls)

    def say_goodbye(self) -> None:
        """Take no more connections and requests."""
        self.leaving = True
        self._server.close()
        for each in self._open:
            each.say_goodbye()
        self._notice_left()

    async def close(self) -> None:
        """Close the connections, after `say_goodbye`: once the others have all answers, or after a while."""
        with suppress(TimeoutError):
            async with asyncio.timeout(LEAVE_SECONDS):
                await self._left.wait()
        for each in list(self._open):
            each.close()

    def opened(self, connection: "_Connection") -> None:
        """A connection is open."""
        self._open.add(connection)

    def closed(self, connection: "_Connection") -> None:
        """It is closed."""
        self._open.discard(connection)
        self._notice_left()

    def _notice_left(self) -> None:
        """Notice that all have left to whom it has said goodbye."""
        if self.leaving and not any(each.leaving for each in self._open):
            self._left.set()

    def _connect(self) -> "_Connection":
        return _Connection(self)

    def _find(self, method: bytes) -> Any:
        details = _Details(method.decode(), ())
        found = (each.service(details) for each in self._handlers)
        return next(each for each in found if each is not None)


class _Details(grpc.HandlerCallDetails):
    def __init__(self, method: str, metadata: tuple[tuple[str, str], ...]) -> None:
        self.method = method
        self.invocation_metadata = metadata


class _Request(NamedTuple):
    number: int
    method: bytes
    caller: bytes
    message: bytes


class _Connection(Frames):
    def __init__(self, server: FrameServer) -> None:
        super().__init__()
        self.leaving = False
        self._server = server
        self._greeting = server.greeting
        self._version = 0 if server.greeting else NEWEST  # without a greeting, both ends are of one program
        self._theirs = b""
        self._last = 0
        self._arrived: list[_Request] = []
        self._running: dict[int, asyncio.Task[None]] = {}
        self._running_runs: set[asyncio.Task[None]] = set()

    def say_goodbye(self) -> None:
        """Take no more requests, if the other end understands that."""
        if self._version:
            self.leaving = True
            self.send(self._last, Kind.GOODBYE)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self._server.opened(self)

    def connection_lost(self, error: Exception | None) -> None:
        """The gateway has ended, and so have its callers; or it has all answers."""
        super().connection_lost(error)
        self._server.closed(self)
        for task in (*self._running.values(), *self._running_runs):
            task.cancel()

    def pause_writing(self) -> None:
        """Take no more requests while the gateway does not read the answers."""
        if self._transport is not None:
            self._transport.pause_reading()

    def resume_writing(self) -> None:
        if self._transport is not None:
            self._transport.resume_reading()

    def received(self, number: int, kind: Kind, rest: bytes) -> None:
        if self._greeting and kind is Kind.VERSIONS:
            self._theirs = rest
        elif self._greeting:
            known = kind is Kind.GREETING and hmac.compare_digest(rest, self._greeting)
            if not known or self._server.leaving:
                self.abort()
                return
            self.send(0, Kind.VERSIONS, own_versions().text.encode())
            theirs = Versions.of(self._theirs.decode()) if self._theirs else UNSAID
            if not own_versions().meet(theirs):
                self.close()
                return
            self._greeting = b""
            self._version = number
            self.send(number, Kind.ANSWER, ANSWERS_PINGS)
        elif kind is Kind.REQUEST:
            if not self.leaving:
                self._last = number
                self._arrived.append(_Request(number, *unpack_request(rest)))
        elif kind is Kind.PING:
            self.send(number, Kind.PONG)
        elif number in self._running:
            self._running[number].cancel()
        else:  # it has been answered, or has just arrived
            self._arrived = [each for each in self._arrived if each.number != number]

    def data_received(self, data: bytes) -> None:
        """Serve what has arrived."""
        super().data_received(data)
        arrived, self._arrived = self._arrived, []
        index = 0
        while index < len(arrived):
            run = self._run_of(arrived, index)
            if run is None:
                self._begin(arrived[index])
                index += 1
            else:
                self._begin_run(run, arrived[index : index + run.length])
                index += run.length

    def _run_of(self, arrived: list[_Request], index: int) -> Run | None:
        """The run that begins with a request; none that waits for a revision, because each may be cancelled."""
        first = arrived[index]
        handler = self._server.runs.get(first.method)
        if handler is None or index + 1 == len(arrived) or not _alike(first, arrived[index + 1]):
            return None
        alike = takewhile(partial(_alike, first), islice(arrived, index, None))
        run = run_of_requests(handler.kind, first.message, (each.message for each in alike))
        return None if run is None or run.request.min_revision else run

    def _begin(self, request: _Request) -> None:
        task = self._loop.create_task(self._serve(request))
        self._running[request.number] = task
        task.add_done_callback(lambda task: self._ended(request.number, task))

    async def _serve(self, request: _Request) -> None:
        handler = self._server.handler(request.method)
        context = FrameContext(handler.request_deserializer(request.message), request.caller)
        answer = await handler.stream_unary(None, context)
        if context.status is None:
            self.send(request.number, Kind.ANSWER, answer)
        else:
            self.send(request.number, Kind.REFUSAL, context.status.SerializeToString())

    def _ended(self, number: int, task: "asyncio.Task[None]") -> None:
        del self._running[number]
        if task.cancelled() or task.exception() is not None:
            self.send(number, Kind.REFUSAL, ENDED.SerializeToString())

    def _begin_run(self, run: Run, requests: list[_Request]) -> None:
        task = self._loop.create_task(self._serve_run(run, requests))
        self._running_runs.add(task)
        task.add_done_callback(lambda task: self._ended_run(requests, task))

    async def _serve_run(self, run: Run, requests: list[_Request]) -> None:
        context = FrameContext((run, run.request.ByteSize()), requests[0].caller)
        answers = await self._server.runs[requests[0].method].handle(None, context)
        if context.status is not None:  # one of them may be at fault, or all
            for each in requests:
                self._begin(each)
            return
        for request, answer in zip(requests, answers, strict=True):
            self.send(request.number, Kind.ANSWER, answer)

    def _ended_run(self, requests: list[_Request], task: "asyncio.Task[None]") -> None:
        self._running_runs.discard(task)
        if task.cancelled() or task.exception() is not None:
            for each in requests:
                self.send(each.number, Kind.REFUSAL, ENDED.SerializeToString())


def _alike(request: _Request, other: _Request) -> bool:
    """Whether two requests may be of one run."""
    return (
        request.method == other.method and request.caller == other.caller and len(request.message) == len(other.message)
    )


class FrameContext:
    """What the handlers use of gRPC's context, for a call with one request and one response.

    Attributes:
        status: the error that the call ends with, or None.
    """

    __slots__ = ("_caller", "_request", "status")

    def __init__(self, request: object, caller: bytes) -> None:
        self._request = request
        self._caller = caller
        self.status: Status | None = None

    async def read(self) -> Any:
        """The request, once."""
        request, self._request = self._request, grpc.aio.EOF
        return request

    def invocation_metadata(self) -> tuple[tuple[str, str], ...]:
        """The metadata that name the caller."""
        owner, _, key = self._caller.decode().partition(" ")
        return ((OWNER, owner), (KEY, key))

    def peer(self) -> str:
        """The address of the caller, as far as the gateway says it."""
        return f"gateway:{self._caller.decode().partition(' ')[0]}:"

    async def abort(self, code: grpc.StatusCode, message: str, metadata: Sequence[tuple[str, Any]] = ()) -> None:
        """End the call with an error."""
        details = dict(metadata).get(DETAILS)
        self.status = Status(code=code.value[0], message=message) if details is None else Status.FromString(details)
