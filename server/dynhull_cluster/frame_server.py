"""The end of a worker: it serves the calls that arrive as frames, by the handlers that gRPC has."""

import asyncio
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import grpc
from google.rpc import code_pb2
from google.rpc.status_pb2 import Status

from .callers import KEY, OWNER
from .frames import Frames, Kind, unpack_request

DETAILS = "grpc-status-details-bin"
ENDED = Status(code=code_pb2.UNAVAILABLE, message="the call ended without an answer; its outcome is unknown")


class FrameServer:
    """Listens on a Unix socket from `listen` until `close`.

    Args:
        handlers: the handlers of all methods.
    """

    def __init__(self, handlers: Sequence[grpc.GenericRpcHandler]) -> None:
        self._handlers = handlers
        self._handler = cache(self._find)
        self._open: set[_Connection] = set()

    async def listen(self, path: Path) -> None:
        """Listen, and serve in the background."""
        self._server = await asyncio.get_running_loop().create_unix_server(self._connect, path)

    async def close(self) -> None:
        """Close the connections, after the answers that are ready."""
        self._server.close()
        for each in list(self._open):
            each.close()

    def _connect(self) -> "_Connection":
        return _Connection(self._handler, self._open)

    def _find(self, method: bytes) -> Any:
        details = _Details(method.decode(), ())
        found = (each.service(details) for each in self._handlers)
        return next(each for each in found if each is not None)


class _Details(grpc.HandlerCallDetails):
    def __init__(self, method: str, metadata: tuple[tuple[str, str], ...]) -> None:
        self.method = method
        self.invocation_metadata = metadata


class _Connection(Frames):
    def __init__(self, handler: Any, among: "set[_Connection]") -> None:
        super().__init__()
        self._handler = handler
        self._among = among
        self._running: dict[int, asyncio.Task[None]] = {}

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self._among.add(self)

    def connection_lost(self, error: Exception | None) -> None:
        """The gateway has ended: so have its callers."""
        super().connection_lost(error)
        self._among.discard(self)
        for task in self._running.values():
            task.cancel()

    def pause_writing(self) -> None:
        """Take no more requests while the gateway does not read the answers."""
        if self._transport is not None:
            self._transport.pause_reading()

    def resume_writing(self) -> None:
        if self._transport is not None:
            self._transport.resume_reading()

    def received(self, number: int, kind: Kind, rest: bytes) -> None:
        if kind is Kind.CANCEL:
            if number in self._running:
                self._running[number].cancel()
            return
        method, caller, message = unpack_request(rest)
        task = self._loop.create_task(self._serve(number, self._handler(method), caller, message))
        self._running[number] = task
        task.add_done_callback(lambda task: self._ended(number, task))

    async def _serve(self, number: int, handler: Any, caller: bytes, message: bytes) -> None:
        context = FrameContext(handler.request_deserializer(message), caller)
        answer = await handler.stream_unary(None, context)
        if context.status is None:
            self.send(number, Kind.ANSWER, answer)
        else:
            self.send(number, Kind.REFUSAL, context.status.SerializeToString())

    def _ended(self, number: int, task: "asyncio.Task[None]") -> None:
        del self._running[number]
        if task.cancelled() or task.exception() is not None:
            self.send(number, Kind.REFUSAL, ENDED.SerializeToString())


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
