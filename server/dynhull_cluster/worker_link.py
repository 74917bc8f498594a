"""The connection of a gateway with one worker."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import partial
from typing import Any, TypeVar
from weakref import WeakSet

import grpc
from grpc_health.v1 import health_pb2

from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.status import RelayedError, WorkerAwayError
from dynhull_server.state.errors import StoppingError

from .again import READS, has_not_begun, may_have_begun, may_repeat
from .asking_frames import AskingFrames
from .callers import Metadata, metadata_of
from .frames import MOST_BYTES
from .upstream import LATE_SECONDS, Upstream, one_request
from .ways import PATIENCE, Ways

# Seconds until a worker that is away is looked for again.
LOOK_SECONDS = 0.05
HEALTH_WATCH = "/grpc.health.v1.Health/Watch"
UNKNOWN = health_pb2.HealthCheckResponse.UNKNOWN

T = TypeVar("T")

log = logging.getLogger(__name__)


class RetiredError(WorkerAwayError):
    """The names are divided among other workers now; the request has not reached the one that was asked."""


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
        self._connection: WorkerConnection | None = None
        self._leaving: dict[asyncio.Task[None], AskingFrames] = {}
        self._retired = False
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
        """Connect, and connect again whenever the worker has ended. Raises StoppingError after `retire`."""
        loop = asyncio.get_running_loop()
        while not self._retired:
            self._elsewhere.clear()
            try:
                frames = await self._ways.connect(self.number, AskingFrames)
            except OSError:
                await _until(self._elsewhere)
                continue
            connection = WorkerConnection(frames, self._ways.channel(self.number))
            try:
                async with asyncio.TaskGroup() as tasks:
                    watches = [tasks.create_task(self._watch(connection, service)) for service in self.health]
                    self._connection = connection
                    self._arrived.set()
                    self._again.set()
                    self._again = asyncio.Event()
                    self._changed()
                    await frames.left
                    for each in watches:
                        each.cancel()
            finally:
                self._connection = None
                self._arrived.clear()
                self.health = dict.fromkeys(self.health, UNKNOWN)
                leaving = loop.create_task(connection.leave(self._closed))
                self._leaving[leaving] = frames
                leaving.add_done_callback(self._leaving.pop)
                self._changed()
        raise StoppingError

    def retire(self) -> None:
        """Reach nobody from now on: other links have the names. What waits here is looked for there."""
        self._retired = True
        self._follow()
        self._arrived.set()
        self._again.set()

    async def close(self) -> None:
        """End what is left of former connections, after `run`."""
        self._closed.set()
        for frames in self._leaving.values():
            frames.gone.set()
        await asyncio.gather(*self._leaving)

    async def arrive(self, patience: "Patience") -> None:
        """Wait for a worker that is away, but not for ever. Raises WorkerAwayError if that was in vain."""
        if self._connection is None and not self._retired:
            await patience.wait(self._arrived)
        self._present()

    async def ask(self, method: str, call: Call, message: bytes) -> bytes:
        """The response of the worker to a request.

        A worker that is away is waited for, and asked again where no request can take effect twice by that.

        Raises:
            WorkerAwayError: the worker is away; it has not seen the request.
            RelayedError: the worker refuses it, or has ended meanwhile.
        """
        return await self._repeat(
            method, message, partial(self._ask, method, call, message), lambda: False, nullcontext
        )

    async def answer(self, method: str, call: Call, message: bytes, work: Callable[[], Awaitable[T]]) -> T:
        """Do the work of a call with many responses; again, as `ask` does, as long as its caller has none of them."""
        return await self._repeat(method, message, work, lambda: call.begun, call.cutoff)

    async def _repeat(
        self,
        method: str,
        message: bytes,
        work: Callable[[], Awaitable[T]],
        begun: Callable[[], bool],
        waiting: Callable[[], AbstractContextManager[None]],
    ) -> T:
        patience = Patience()
        unknown: RelayedError | None = None
        while True:
            try:
                with waiting():
                    await self.arrive(patience)
                return await work()
            except (WorkerAwayError, RelayedError) as error:
                if begun():
                    raise
                if isinstance(error, RelayedError) and may_have_begun(method, error.status):
                    unknown = error
                elif unknown is not None and patience.over and _has_not_begun(error):
                    raise unknown from error  # an attempt before may have
                await self.again(method, message, error, patience)

    async def again(
        self, method: str, message: bytes, error: WorkerAwayError | RelayedError, patience: "Patience"
    ) -> None:
        """Wait until a request that has failed may succeed; raises its error if that is in vain or not allowed.

        Args:
            method: the path of the method.
            message: the request.
            error: the error.
            patience: that of the request.
        """
        repeatable = isinstance(error, WorkerAwayError) or may_repeat(method, message, error.status)
        if patience.over or not repeatable or isinstance(error, RetiredError):
            raise error
        await patience.wait(self._again, LOOK_SECONDS)

    async def _ask(self, method: str, call: Call, message: bytes) -> bytes:
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

    def _present(self) -> "WorkerConnection":
        if self._retired:
            raise RetiredError(self.number)
        if self._connection is None or not self._connection.frames.connected:
            raise WorkerAwayError(self.number)
        return self._connection

    def _follow(self) -> None:
        """Connect again: the worker is elsewhere."""
        self._elsewhere.set()
        if self._connection is not None:
            self._connection.frames.replaced()
        for frames in self._leaving.values():
            frames.replaced()

    async def _watch(self, connection: "WorkerConnection", service: str) -> None:
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


class Patience:
    """The time in which a call that meets workers that are away is tried again: PATIENCE from its beginning.

    A root has waited as long for a shard before it says that one is away, so that is not tried again.
    """

    def __init__(self) -> None:
        self._until = asyncio.get_running_loop().time() + PATIENCE

    @property
    def over(self) -> bool:
        """Whether nothing of it is left."""
        return asyncio.get_running_loop().time() >= self._until

    async def wait(self, event: asyncio.Event, seconds: float = PATIENCE) -> None:
        """Wait for an event, no longer than this and no longer than the patience lasts."""
        await _until(event, min(seconds, self._until - asyncio.get_running_loop().time()))


def _has_not_begun(error: WorkerAwayError | RelayedError) -> bool:
    return isinstance(error, WorkerAwayError) or has_not_begun(error.status)


async def _until(event: asyncio.Event, seconds: float = LOOK_SECONDS) -> None:
    """Wait for an event, but not for long."""
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            await event.wait()


class WorkerConnection:
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
        self._writes: WeakSet[Upstream] = WeakSet()  # of them, those that cannot be repeated

    def stream(self, method: str, metadata: Metadata) -> Upstream:
        """A call of the worker."""
        upstream = Upstream(self.channel.stream_stream(method)(metadata=metadata, wait_for_ready=True))
        self._upstreams.add(upstream)
        if method not in READS:
            self._writes.add(upstream)
        return upstream

    async def leave(self, at_once: asyncio.Event) -> None:
        """Have the worker complete what it has begun. Once it is gone, the calls have a moment for what has arrived.

        They end `at_once` if that is set, then without an answer.
        """
        finishing = asyncio.create_task(self._finish())
        await self.frames.gone.wait()
        await _until(at_once, LATE_SECONDS)
        finishing.cancel()
        self.frames.abort()
        for each in list(self._upstreams):
            each.sever()
        await self.channel.close()

    async def _finish(self) -> None:
        """Say that nothing is left to ask, once the worker has ended what cannot be repeated."""
        for each in list(self._writes):
            await each.ended()
        self.frames.leave()
