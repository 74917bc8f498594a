"""The calls under way: who calls, how many there are, refusals as statuses, what a draining server cuts off."""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any

import grpc
from google.protobuf.message import Message
from grpc_status import rpc_status

from ..state.errors import LimitExceededError
from .access import Access
from .metrics import Metrics
from .status import ANSWERED, DrainingError, StartingError, error_status

Context = grpc.aio.ServicerContext[Any, Any]
Work = Callable[[Any, "Call"], Awaitable[Any]]
# A message and how many bytes it had, or what is wrong with it.
Received = tuple[Message, int] | Exception

SUSPICIOUS = ("UNAUTHENTICATED", "PERMISSION_DENIED")

log = logging.getLogger(__name__)


class Call:
    """One call.

    Attributes:
        access: what the caller may do.
        owner: who answers for the producers it names.
        batches: how many batches the call has applied; None for calls that apply none or one.
        message_bytes: the size of the last message that came.
    """

    def __init__(self, calls: "Calls", context: Context, access: Access) -> None:
        self.access = access
        self.owner = ""
        self.batches: int | None = None
        self.message_bytes = 0
        self.cutoff = calls.cutoff
        self._context = context
        self._max_message_bytes = calls.max_message_bytes

    def take(self, received: Received) -> Any:
        """The message, or raise what is wrong with it."""
        if isinstance(received, Exception):
            raise received
        message, self.message_bytes = received
        return message

    async def read(self) -> Any:
        """The next message, None after the last."""
        received = await self._context.read()
        return None if received is grpc.aio.EOF else self.take(received)

    def serialize(self, message: Message) -> bytes:
        """The bytes of a message. Raises LimitExceededError where it is too large to be sent."""
        data: bytes = message.SerializeToString()
        if len(data) > self._max_message_bytes:
            raise LimitExceededError("max_message_bytes", self._max_message_bytes)
        return data

    async def write(self, message: Message) -> None:
        """Send a message. Waits while the client does not read."""
        try:
            await self._context.write(self.serialize(message))
        except grpc.aio.InternalError:
            # The client has gone while the message was on its way.
            raise asyncio.CancelledError from None

    async def write_within(self, seconds: float, message: Message) -> None:
        """Send a message, or raise LimitExceededError where that took longer.

        The client will get the message and then the error, for gRPC cannot take back what it has begun to send.
        """
        begun = time.monotonic()
        await self.write(message)
        if time.monotonic() - begun > seconds:
            raise LimitExceededError("max_watch_lag", seconds)


class Calls:
    """Every call goes through `serve`.

    Args:
        authenticate: what a caller may do; raises UnauthenticatedError.
        metrics: where calls are counted.
        max_message_bytes: the largest message sent.
        max_streams: how many streaming calls there may be at a time.
    """

    def __init__(
        self,
        authenticate: Callable[[Context], Access],
        metrics: Metrics,
        max_message_bytes: int,
        max_streams: int,
    ) -> None:
        self.max_message_bytes = max_message_bytes
        self._authenticate = authenticate
        self._metrics = metrics
        self._max_streams = max_streams
        self._streams = 0
        self._starting = True
        self.draining = False
        self._short: set[asyncio.Task[Any]] = set()
        self.waiting: set[asyncio.Task[Any]] = set()

    def ready(self) -> None:
        """From now on calls are served: before, they are told that the server is starting."""
        self._starting = False

    async def drain(self, grace: float) -> None:
        """End the calls that wait, refuse new ones, and let the short ones finish for up to `grace` seconds."""
        self.draining = True
        for task in self.waiting:
            task.cancel()
        if self._short:
            await asyncio.wait(self._short, timeout=grace)

    async def serve(self, method: str, work: Work, request: object, context: Context) -> Any:
        """What `work` makes of a request. Its refusals become statuses."""
        begun = time.perf_counter()
        code = "OK"
        call = None
        try:
            if self._starting:
                raise StartingError
            if self.draining:
                raise DrainingError
            call = Call(self, context, self._authenticate(context))
            return await work(request, call)
        except ANSWERED as error:
            status = rpc_status.to_status(error_status(error, None if call is None else call.batches))
            code = status.code.name
            if code in SUSPICIOUS:
                log.warning(status.details, extra={"method": method, "code": code, "peer": context.peer()})
            await context.abort(status.code, status.details, status.trailing_metadata)
        except asyncio.CancelledError:
            code = "CANCELLED"
            raise
        except Exception:
            code = "INTERNAL"
            log.exception("a call failed; this is a bug", extra={"method": method})
            await context.abort(grpc.StatusCode.INTERNAL, "internal error, see the server's log")
        finally:
            # The answer leaves first: the caller waits for it.
            seconds = time.perf_counter() - begun
            asyncio.get_running_loop().call_soon(self._metrics.call, method, code, seconds)

    @contextmanager
    def short(self) -> Iterator[None]:
        """What happens inside is finished by a draining server."""
        task = _current_task()
        self._short.add(task)
        task.add_done_callback(self._short.discard)
        yield

    def cutoff(self) -> "Cutoff":
        """Whatever happens inside ends with DrainingError when the server drains.

        It must not be sending: a message cut off half-way would leave the call without a status.
        """
        return Cutoff(self)

    @contextmanager
    def stream(self) -> Iterator[None]:
        """What happens inside is a streaming call, of which there are not too many."""
        if self._streams >= self._max_streams:
            raise LimitExceededError("max_streams", self._max_streams)
        self._streams += 1
        try:
            yield
        finally:
            self._streams -= 1


class Cutoff:
    """The context of `Calls.cutoff`. A class, because each message of a stream goes through one."""

    __slots__ = ("_calls", "_task")

    def __init__(self, calls: Calls) -> None:
        self._calls = calls

    def __enter__(self) -> None:
        if self._calls.draining:
            raise DrainingError
        self._task = _current_task()
        self._calls.waiting.add(self._task)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._calls.waiting.discard(self._task)
        if isinstance(error, asyncio.CancelledError) and self._calls.draining and self._task.uncancel() == 0:
            raise DrainingError from None


def _current_task() -> asyncio.Task[Any]:
    task = asyncio.current_task()
    assert task is not None  # gRPC runs each call in a task
    return task
