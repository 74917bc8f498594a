"""The connection of a gateway with one worker."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from contextlib import nullcontext, suppress
from functools import partial
from typing import Any, TypeVar
from weakref import WeakSet

import grpc
from google.rpc.status_pb2 import Status
from grpc_health.v1 import health_pb2

from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.status import RelayedError, WorkerAwayError

from .again import may_repeat
from .callers import Metadata, metadata_of
from .frames import MOST_BYTES, Frames, Kind, pack_request
from .upstream import LATE_SECONDS, Upstream, lost_status, one_request
from .ways import PATIENCE, Ways

# Seconds until a worker that is away is looked for again.
LOOK_SECONDS = 0.05
HEALTH_WATCH = "/grpc.health.v1.Health/Watch"
UNKNOWN = health_pb2.HealthCheckResponse.UNKNOWN

T = TypeVar("T")

log = logging.getLogger(__name__)


class WorkerLink:
    """The way to one worker, from `run` until that is cancelled.

    Args:
        number: the number of the worker.
        ways: where it is.
        watched: the health services to watch.
        changed: called when the health or the presence of the worker changes.

    Attributes:
        number: the number of the worker.
        health: the last known status of each health service; UNKNOWN while the worker is away.
    """

    def __init__(self, number: int, ways: Ways, watched: tuple[str, ...], changed: Callable[[], None]) -> None:
        self.number = number
        self.health = dict.fromkeys(watched, UNKNOWN)
        self._ways = ways
        self._changed = changed
        self._connection: Connection | None = None
        self._leaving: set[asyncio.Task[None]] = set()
        self._closed = asyncio.Event()
        self._arrived = asyncio.Event()
        self._elsewhere = asyncio.Event()
        self._again = asyncio.Event()
        ways.when_moved(number, self._follow)

    @property
    def present(self) -> bool:
        """Whether the worker can be called."""
        return self._connection is not None and self._connection.frames.connected

    async def run(self) -> None:
        """Connect, and connect again whenever the worker has ended."""
        loop = asyncio.get_running_loop()
        while True:
            lost: asyncio.Future[None] = loop.create_future()
            self._elsewhere.clear()
            try:
                frames = await self._ways.connect(self.number, partial(AskingFrames, lost))
            except OSError:
                await _until(self._elsewhere)
                continue
            connection = Connection(frames, self._ways.channel(self.number))
            try:
                async with asyncio.TaskGroup() as tasks:
                    watches = [tasks.create_task(self._watch(connection, service)) for service in self.health]
                    self._connection = connection
                    self._arrived.set()
                    self._again.set()
                    self._again = asyncio.Event()
                    self._changed()
                    await lost
                    for each in watches:
                        each.cancel()
            finally:
                self._connection = None
                self._arrived.clear()
                self.health = dict.fromkeys(self.health, UNKNOWN)
                frames.close()
                leaving = loop.create_task(connection.end(self._closed))
                self._leaving.add(leaving)
                leaving.add_done_callback(self._leaving.discard)
                self._changed()

    async def close(self) -> None:
        """End what is left of former connections, after `run`."""
        self._closed.set()
        await asyncio.gather(*self._leaving)

    async def arrive(self) -> None:
        """Wait for a worker that is away, but not for ever; `stream` says if that was in vain."""
        if self._connection is None:
            try:
                async with asyncio.timeout(PATIENCE):
                    await self._arrived.wait()
            except TimeoutError:
                return

    async def ask(self, method: str, call: Call, message: bytes) -> bytes:
        """The response of the worker to a request.

        A worker that is away is waited for, and asked again where no request can take effect twice by that.

        Raises:
            WorkerAwayError: the worker is away; it has not seen the request.
            RelayedError: the worker refuses it, or has ended meanwhile.
        """
        return await self._repeat(method, message, partial(self._ask, method, call, message), lambda: False)

    async def answer(self, method: str, call: Call, message: bytes, work: Callable[[], Awaitable[T]]) -> T:
        """Do the work of a call with many responses; again, as `ask` does, as long as its caller has none of them."""
        return await self._repeat(method, message, work, lambda: call.begun)

    async def _repeat(
        self, method: str, message: bytes, work: Callable[[], Awaitable[T]], begun: Callable[[], bool]
    ) -> T:
        until: float | None = None
        while True:
            try:
                return await work()
            except (WorkerAwayError, RelayedError) as error:
                if begun():
                    raise
                until = await self.again(method, message, error, until)

    async def again(
        self, method: str, message: bytes, error: WorkerAwayError | RelayedError, until: float | None
    ) -> float:
        """Wait until a request that has failed may succeed; raises its error if that is in vain or not allowed.

        Args:
            method: the path of the method.
            message: the request.
            error: the error.
            until: what this returned for the error before it, None for the first: when it is in vain.
        """
        now = asyncio.get_running_loop().time()
        if until is None:
            until = now + PATIENCE
        repeatable = isinstance(error, WorkerAwayError) or may_repeat(method, message, error.status)
        if now > until or not repeatable:
            raise error
        await _until(self._again)
        return until

    async def _ask(self, method: str, call: Call, message: bytes) -> bytes:
        await self.arrive()
        frames = self._present().frames
        if len(message) <= MOST_BYTES:
            while not frames.writable.is_set():  # what a worker that does not read has not got is its caller's alone
                await frames.writable.wait()
                frames = self._present().frames
            return await frames.ask(method, f"{call.owner} {call.caller.key}".encode(), message)
        async with one_request(self.stream(method, metadata_of(call)), message, nullcontext()) as upstream:
            response = await upstream.read()
        assert response is not None  # a call that succeeds has one
        return response

    def stream(self, method: str, caller: Metadata) -> Upstream:
        """A call of the worker, with any number of requests and responses. Raises WorkerAwayError.

        Args:
            method: its path.
            caller: the metadata that name the caller.
        """
        return self._present().stream(method, (*caller, *self._ways.proof(self.number)))

    def _present(self) -> "Connection":
        if self._connection is None or not self._connection.frames.connected:
            raise WorkerAwayError(self.number)
        return self._connection

    def _follow(self) -> None:
        """Connect again: the worker is elsewhere."""
        self._elsewhere.set()
        if self._connection is not None:
            self._connection.frames.abort()

    async def _watch(self, connection: "Connection", service: str) -> None:
        """Follow one health service of the worker."""
        while True:
            responses = connection.channel.unary_stream(
                HEALTH_WATCH,
                request_serializer=health_pb2.HealthCheckRequest.SerializeToString,
                response_deserializer=health_pb2.HealthCheckResponse.FromString,
            )(health_pb2.HealthCheckRequest(service=service))
            try:
                async for response in responses:
                    self.health[service] = response.status
                    self._changed()
            except grpc.aio.AioRpcError as error:
                log.debug("the health of a worker is not known", extra={"worker": self.number, "reason": str(error)})
            finally:
                responses.cancel()
            await asyncio.sleep(LOOK_SECONDS)


async def _until(event: asyncio.Event, seconds: float = LOOK_SECONDS) -> None:
    """Wait for an event, but not for long."""
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            await event.wait()


class Connection:
    """What leads to a worker until it ends: frames, and a channel for gRPC.

    The frames notice the end of the worker. gRPC may not, as when a machine is gone, and have calls wait for ever.

    Args:
        frames: the connected frames.
        channel: the channel.
    """

    def __init__(self, frames: "AskingFrames", channel: Any) -> None:
        self.frames = frames
        self.channel = channel
        self._upstreams: WeakSet[Upstream] = WeakSet()

    def stream(self, method: str, metadata: Metadata) -> Upstream:
        """A call of the worker."""
        upstream = Upstream(self.channel.stream_stream(method)(metadata=metadata, wait_for_ready=True))
        self._upstreams.add(upstream)
        return upstream

    async def end(self, at_once: asyncio.Event) -> None:
        """End the calls: they have a moment for what has arrived, or end `at_once`, then without an answer."""
        await _until(at_once, LATE_SECONDS)
        for each in list(self._upstreams):
            each.sever()
        await self.channel.close()


class AskingFrames(Frames):
    """The calls in progress.

    Args:
        lost: set when the connection is lost.

    Attributes:
        writable: set while the worker takes what is sent, and when the connection is lost.
    """

    def __init__(self, lost: "asyncio.Future[None]") -> None:
        super().__init__()
        self.writable = asyncio.Event()
        self.writable.set()
        self._lost = lost
        self._last = 0
        self._waiting: dict[int, asyncio.Future[bytes]] = {}

    async def greet(self, greeting: bytes) -> None:
        """Prove to be a gateway. Raises RelayedError if the other end does not accept that."""
        answer = self._waiting[0] = self._loop.create_future()
        self.send(0, Kind.GREETING, greeting)
        try:
            await answer
        finally:
            del self._waiting[0]

    async def ask(self, method: str, caller: bytes, message: bytes) -> bytes:
        """The answer to a request. Raises RelayedError if it is refused, or the connection is lost."""
        self._last = number = (self._last + 1) % 2**32
        answer: asyncio.Future[bytes] = self._loop.create_future()
        self._waiting[number] = answer
        self.send(number, Kind.REQUEST, *pack_request(method.encode(), caller, message))
        try:
            return await answer
        except asyncio.CancelledError:
            self.send(number, Kind.CANCEL)
            raise
        finally:
            self._waiting.pop(number, None)

    def received(self, number: int, kind: Kind, rest: bytes) -> None:
        """Resume the caller."""
        answer = self._waiting.get(number)
        if answer is None or answer.done():
            return
        if kind is Kind.ANSWER:
            answer.set_result(rest)
        else:
            answer.set_exception(RelayedError(Status.FromString(rest)))

    def pause_writing(self) -> None:
        """The worker has not read for a while."""
        self.writable.clear()

    def resume_writing(self) -> None:
        """It has read on."""
        self.writable.set()

    def connection_lost(self, error: Exception | None) -> None:
        """Refuse what waits."""
        super().connection_lost(error)
        self.writable.set()
        for answer in self._waiting.values():
            if not answer.done():
                answer.set_exception(RelayedError(lost_status()))
        if not self._lost.done():
            self._lost.set_result(None)
