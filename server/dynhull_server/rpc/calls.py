"""The calls under way: who calls, how many there are, refusals as statuses, what a draining server cuts off."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import TracebackType
from typing import Any

import grpc
from google.protobuf.message import DecodeError, Message
from grpc_status import rpc_status

from ..state.errors import LimitExceededError
from .access import NOBODY, Caller, PermissionDeniedError, Rights, UnauthenticatedError
from .metrics import Metrics
from .places import Places
from .refusal_log import RefusalLog
from .status import ANSWERED, DrainingError, StartingError, error_status

Context = grpc.aio.ServicerContext[Any, Any]
Work = Callable[["Call"], Awaitable[Any]]
# A message and how many bytes it had, or what is wrong with it.
Received = tuple[Message, int] | Exception

# The page for Prometheus among the methods that are counted.
METRICS_PAGE = "metrics"

SUSPICIOUS = ("UNAUTHENTICATED", "PERMISSION_DENIED")

log = logging.getLogger(__name__)


class Call:
    """One call.

    Attributes:
        caller: who calls.
        access: what the call may do.
        batches: how many batches the call has applied; None for calls that apply none or one.
        message_bytes: the size of the last message that came.
        ending: what ends it; None as long as nothing does.
        waiting: its tasks that `end` may cancel.
    """

    __slots__ = (
        "_begun",
        "_calls",
        "_context",
        "_owner",
        "access",
        "batches",
        "caller",
        "ending",
        "message_bytes",
        "waiting",
    )

    def __init__(self, calls: "Calls", context: Context, caller: Caller) -> None:
        self.caller = caller
        self._owner = caller.owner
        self.access = Rights(caller.access)
        self.batches: int | None = None
        self.message_bytes = 0
        self.ending: Exception | None = None
        self.waiting: set[asyncio.Task[Any]] = set()
        self._calls = calls
        self._context = context
        self._begun = False

    @property
    def owner(self) -> str:
        """Whose bounds the call counts under: the token's, or without tokens the address it comes from."""
        if not self._owner:
            self._owner = self._context.peer().partition(":")[2].rpartition(":")[0]
        return self._owner

    async def receive(self) -> Any:
        """The only message of a call that is no stream."""
        return self._take(await self._context.read())

    async def read(self) -> Any:
        """The next message, None after the last."""
        received = await self._context.read()
        return None if received is grpc.aio.EOF else self._take(received)

    def _take(self, received: Any) -> Any:
        if isinstance(received, tuple):
            message, self.message_bytes = received
            return message
        raise DecodeError("no message") if received is grpc.aio.EOF else received

    async def messages(self) -> AsyncIterator[Any]:
        """All messages of a stream."""
        while True:
            with self.cutoff():
                message = await self.read()
            if message is None:
                return
            yield message

    def serialize(self, message: Message) -> bytes:
        """The bytes of a message. Raises LimitExceededError where it is too large to be sent."""
        data: bytes = message.SerializeToString()
        if len(data) > self._calls.max_message_bytes:
            raise LimitExceededError("max_message_bytes", self._calls.max_message_bytes)
        return data

    async def write(self, message: Message) -> None:
        """Send a message. Waits while the client does not read."""
        try:
            await self._context.write(self.serialize(message))
        except grpc.aio.InternalError:
            # The client has gone while the message was on its way.
            raise asyncio.CancelledError from None

    async def write_within(self, seconds: float, message: Message) -> None:
        """Send a message, or raise LimitExceededError where that took longer, or the error of `end`.

        The client will get the message and then the error, for gRPC cannot take back what it has begun to send.
        """
        begun = time.monotonic()
        if not self._begun:  # else a first message that is cut off leaves it open whether the call has begun
            self._begun = True
            await self._context.send_initial_metadata(())
        with self.cutoff():
            await self.write(message)
        if time.monotonic() - begun > seconds:
            raise LimitExceededError("max_watch_lag", seconds)

    def stream(self) -> AbstractContextManager[None]:
        """What happens inside is a streaming call, of which there are not too many."""
        return self._calls.streams.take(self.owner)

    @contextmanager
    def short(self) -> Iterator[None]:
        """What happens inside is finished, by a draining server and without its token."""
        self._calls.finish(_current_task())
        yield

    def cutoff(self) -> "Cutoff":
        """Whatever happens inside ends with the error of `end`."""
        return Cutoff(self)

    def end(self, error: Exception) -> None:
        """End the call with an error, as soon as it waits for something."""
        if self.ending is None:
            self.ending = error
            for task in self.waiting:
                task.cancel()


class Calls:
    """Every call goes through `serve`.

    Args:
        authenticate: who calls; raises UnauthenticatedError.
        metrics: where calls are counted.
        max_message_bytes: the largest message sent.
        streams: the places of streaming calls.
    """

    def __init__(
        self,
        authenticate: Callable[[Context], Caller],
        metrics: Metrics,
        max_message_bytes: int,
        streams: Places,
    ) -> None:
        self.max_message_bytes = max_message_bytes
        self.streams = streams
        self._authenticate = authenticate
        self._metrics = metrics
        self._starting = True
        self._draining = False
        self._open: set[Call] = set()
        self._short: set[asyncio.Task[Any]] = set()
        self._refusals = RefusalLog()

    def ready(self) -> None:
        """From now on calls are served: before, they are told that the server is starting."""
        self._starting = False

    async def drain(self, grace: float) -> None:
        """End the calls that wait, refuse new ones, and let the short ones finish for up to `grace` seconds."""
        self._draining = True
        for call in self._open:
            call.end(DrainingError())
        if self._short:
            await asyncio.wait(self._short, timeout=grace)
        self._refusals.flush()

    def recheck(self, known: Callable[[str], Caller]) -> None:
        """End the calls that their tokens no longer allow.

        Args:
            known: the caller whose token has this hash, as it is now; raises UnauthenticatedError.
        """
        for call in self._open:
            try:
                call.caller = known(call.caller.key)
                call.access.change(call.caller.access)
            except (UnauthenticatedError, PermissionDeniedError) as refusal:
                call.end(refusal)

    def admit(self, context: Context) -> Call:
        """The call, if it may begin."""
        caller = self._authenticate(context)
        if self._starting:
            raise StartingError
        if self._draining:
            raise DrainingError
        call = Call(self, context, caller)
        self._open.add(call)
        return call

    def admit_anybody(self, context: Context) -> Call:
        """A call that needs no token and may begin at any time."""
        return Call(self, context, NOBODY)

    def refused_elsewhere(self) -> Callable[[str, str, str], None]:
        """What other threads call with the reason, code and peer of a request for metrics that they have refused."""
        loop = asyncio.get_running_loop()

        def count(reason: str, code: str, peer: str) -> None:
            self._refusals.add(reason, METRICS_PAGE, code, peer)
            self._metrics.call(METRICS_PAGE, code, 0.0)

        def refused(reason: str, code: str, peer: str) -> None:
            loop.call_soon_threadsafe(count, reason, code, peer)

        return refused

    def finish(self, task: asyncio.Task[Any]) -> None:
        """A draining server waits for this task."""
        self._short.add(task)
        task.add_done_callback(self._short.discard)

    async def serve(
        self, method: str, admit: Callable[[Context], Call], work: Work, _: object, context: Context
    ) -> Any:
        """What `work` makes of a call that was admitted. Refusals become statuses.

        Nothing of a call's messages is in memory before `work` reads them.
        """
        begun = time.perf_counter()
        code = "OK"
        call = None
        try:
            call = admit(context)
            return await work(call)
        except ANSWERED as error:
            status = rpc_status.to_status(error_status(error, None if call is None else call.batches))
            code = status.code.name
            if code in SUSPICIOUS:
                self._refusals.add(status.details, method, code, context.peer())
            await context.abort(status.code, status.details, status.trailing_metadata)
        except asyncio.CancelledError:
            code = "CANCELLED"
            raise
        except Exception:
            code = "INTERNAL"
            log.exception("a call failed; this is a bug", extra={"method": method})
            await context.abort(grpc.StatusCode.INTERNAL, "internal error, see the server's log")
        finally:
            if call is not None:
                self._open.discard(call)
            # The answer leaves first: the caller waits for it.
            seconds = time.perf_counter() - begun
            asyncio.get_running_loop().call_soon(self._metrics.call, method, code, seconds)


class Cutoff:
    """The context of `Call.cutoff`. A class, because each message of a stream goes through one."""

    __slots__ = ("_call", "_task")

    def __init__(self, call: Call) -> None:
        self._call = call

    def __enter__(self) -> None:
        if self._call.ending is not None:
            raise self._call.ending
        self._task = _current_task()
        self._call.waiting.add(self._task)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._call.waiting.discard(self._task)
        if isinstance(error, asyncio.CancelledError) and self._call.ending and self._task.uncancel() == 0:
            raise self._call.ending from None


def _current_task() -> asyncio.Task[Any]:
    task = asyncio.current_task()
    assert task is not None  # gRPC runs each call in a task
    return task
