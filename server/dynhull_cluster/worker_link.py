"""The connection of a gateway with one worker."""

import asyncio
import logging
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import grpc
from google.rpc.status_pb2 import Status
from grpc_health.v1 import health_pb2

from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.status import RelayedError, WorkerAwayError

from .callers import Metadata, metadata_of
from .frames import MOST_BYTES, Frames, Kind, pack_request
from .sockets import Sockets
from .upstream import Upstream, lost_status, status_of

# Seconds until a worker that is away is looked for again.
LOOK_SECONDS = 0.05
OPTIONS = [
    ("grpc.max_receive_message_length", -1),
    ("grpc.max_send_message_length", -1),
    ("grpc.initial_reconnect_backoff_ms", 50),
    ("grpc.min_reconnect_backoff_ms", 50),
    ("grpc.max_reconnect_backoff_ms", 500),
    ("grpc.http2.lookahead_bytes", 2**20),
    ("grpc.http2.bdp_probe", 0),
    ("grpc.use_local_subchannel_pool", 1),
]
HEALTH_WATCH = "/grpc.health.v1.Health/Watch"
UNKNOWN = health_pb2.HealthCheckResponse.UNKNOWN

log = logging.getLogger(__name__)


class WorkerLink:
    """The way to one worker, from `run` until that is cancelled.

    Args:
        number: the number of the worker.
        sockets: where it listens.
        watched: the health services to watch.
        changed: called when the health or the presence of the worker changes.

    Attributes:
        number: the number of the worker.
        health: the last known status of each health service; UNKNOWN while the worker is away.
    """

    def __init__(self, number: int, sockets: Sockets, watched: tuple[str, ...], changed: Callable[[], None]) -> None:
        self.number = number
        self.health = dict.fromkeys(watched, UNKNOWN)
        self._sockets = sockets
        self._changed = changed
        self._frames: AskingFrames | None = None

    @property
    def present(self) -> bool:
        """Whether the worker can be called."""
        return self._frames is not None and self._frames.connected

    async def run(self) -> None:
        """Connect, and connect again whenever the worker has ended."""
        loop = asyncio.get_running_loop()
        while True:
            lost: asyncio.Future[None] = loop.create_future()
            try:
                _, frames = await loop.create_unix_connection(
                    partial(AskingFrames, lost), str(self._sockets.frames(self.number))
                )
            except OSError:
                await asyncio.sleep(LOOK_SECONDS)
                continue
            try:
                async with asyncio.TaskGroup() as tasks:
                    watches = [tasks.create_task(self._watch(service)) for service in self.health]
                    self._frames = frames
                    self._changed()
                    await lost
                    for each in watches:
                        each.cancel()
            finally:
                self._frames = None
                self.health = dict.fromkeys(self.health, UNKNOWN)
                frames.close()
                self._changed()

    async def close(self) -> None:
        """Close the channel, after `run`."""
        await self._channel.close()

    async def ask(self, method: str, call: Call, message: bytes) -> bytes:
        """The response of the worker to a request.

        Raises:
            WorkerAwayError: the worker is away; it has not seen the request.
            RelayedError: the worker refuses it, or has ended meanwhile.
        """
        frames = self._present()
        if len(message) <= MOST_BYTES:
            while not frames.writable.is_set():  # what a worker that does not read has not got is its caller's alone
                await frames.writable.wait()
                frames = self._present()
            return await frames.ask(method, f"{call.owner} {call.caller.key}".encode(), message)
        asked = self._channel.unary_unary(method)(message, metadata=metadata_of(call), wait_for_ready=True)
        try:
            response: bytes = await asked
        except grpc.aio.AioRpcError as error:
            raise RelayedError(status_of(error)) from None
        finally:
            asked.cancel()
        return response

    def stream(self, method: str, caller: Metadata) -> Upstream:
        """A call of the worker, with any number of requests and responses. Raises WorkerAwayError.

        Args:
            method: its path.
            caller: the metadata that name the caller.
        """
        self._present()
        return Upstream(self._channel.stream_stream(method)(metadata=caller, wait_for_ready=True))

    def _present(self) -> "AskingFrames":
        if self._frames is None or not self._frames.connected:
            raise WorkerAwayError(self.number)
        return self._frames

    @cached_property
    def _channel(self) -> Any:
        return grpc.aio.insecure_channel(f"unix:{self._sockets.grpc(self.number)}", options=OPTIONS)

    async def _watch(self, service: str) -> None:
        """Follow one health service of the worker."""
        while True:
            responses = self._channel.unary_stream(
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
