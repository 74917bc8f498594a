"""The calls in progress: authentication, limits, refusals as statuses, and the end of calls when the server drains."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AbstractContextManager
from types import TracebackType
from typing import Any

import grpc
from google.protobuf.message import DecodeError, Message
from google.rpc import code_pb2
from google.rpc.status_pb2 import Status
from grpc_status import rpc_status

from ..logs import caller_has_left
from ..state.errors import LimitExceededError
from .access import (
    UNAUTHENTICATED_CALLER,
    Caller,
    PermissionDeniedError,
    Rights,
    TokensChangedError,
    UnauthenticatedError,
)
from .call_counts import CallCounts
from .metrics import Metrics
from .places import Places, Unread
from .refusal_log import RefusalLog
from .status import ANSWERED, DrainingError, StartingError, error_status

Context = grpc.aio.ServicerContext[Any, Any]
Work = Callable[["Call"], Awaitable[Any]]
# A message, or what has been read of one, and its size in bytes; or the error that it is invalid.
Received = tuple[Any, int] | Exception

# The name of the metrics page in the counts of calls.
METRICS_PAGE = "metrics"

SUSPICIOUS = ("UNAUTHENTICATED", "PERMISSION_DENIED")

log = logging.getLogger(__name__)


class Call:
    """One call.

    Attributes:
        caller: the caller.
        batches: the number of batches the call has applied; None for calls that do not stream batches.
        message_bytes: the size of the last message received.
        counted: the number of calls that it is counted as.
        ending: the error that ends it, or None.
        waiting: its tasks that `end` may cancel.
    """

    __slots__ = (
        "_begun",
        "_calls",
        "_context",
        "_owner",
        "_rights",
        "batches",
        "caller",
        "counted",
        "ending",
        "message_bytes",
        "waiting",
    )

    def __init__(self, calls: "Calls", context: Context, caller: Caller) -> None:
        self.caller = caller
        self._owner = caller.owner
        self._rights: Rights | None = None  # made for those that ask
        self.batches: int | None = None
        self.message_bytes = 0
        self.counted = 1
        self.ending: Exception | None = None
        self.waiting: set[asyncio.Task[Any]] = set()
        self._calls = calls
        self._context = context
        self._begun = False

    @property
    def begun(self) -> bool:
        """Whether `write_within` has sent anything."""
        return self._begun

    @property
    def access(self) -> Rights:
        """The permissions of the call."""
        if self._rights is None:
            self._rights = Rights(self.caller.access)
        return self._rights

    @property
    def owner(self) -> str:
        """The owner whose limits apply: that of the token, or without tokens the address of the caller."""
        if not self._owner:
            self._owner = self._context.peer().partition(":")[2].rpartition(":")[0]
        return self._owner

    async def receive(self) -> Any:
        """The only message of a call that does not stream."""
        return self.take(await self.receive_any())

    async def receive_any(self) -> Any:
        """The same, as it was deserialized; DecodeError if there is none."""
        received = await self._context.read()
        if received is grpc.aio.EOF:
            raise DecodeError("no message")
        return received

    async def read(self) -> Any:
        """The next message, None after the last."""
        received = await self._context.read()
        if type(received) is tuple:  # nearly always
            message, self.message_bytes = received
            return message
        return None if received is grpc.aio.EOF else self.take(received)

    def take(self, received: Received) -> Any:
        """A message that was received, or raise the error that it is invalid."""
        if isinstance(received, tuple):
            message, self.message_bytes = received
            return message
        raise received

    async def messages(self) -> AsyncIterator[Any]:
        """All messages of a stream."""
        while True:
            with self.cutoff():
                message = await self.read()
            if message is None:
                return
            yield message

    @property
    def max_message_bytes(self) -> int:
        """The size of the largest message."""
        return self._calls.max_message_bytes

    def require_entitled(self) -> None:
        """Raise StartingError while nothing may be read from memory: before each answer leaves."""
        self._calls.require_entitled()

    def note_refusal(self, method: str, status: Status) -> str:
        """Log a refused part of the call as a refused call would be. Returns the name of its code."""
        code: str = code_pb2.Code.Name(status.code)
        self._calls.note(status.message, method, code, self._context)
        return code

    def serialize(self, message: Message) -> bytes:
        """The bytes of a message. Raises LimitExceededError if it is too large to send."""
        data: bytes = message.SerializeToString()
        if len(data) > self._calls.max_message_bytes:
            raise LimitExceededError("max_message_bytes", self._calls.max_message_bytes)
        return data

    async def write(self, message: Message | bytes) -> None:
        """Send a message, or the bytes of one. Waits while the client does not read."""
        data = message if isinstance(message, bytes) else self.serialize(message)
        try:
            await self._context.write(data)
        except grpc.aio.InternalError:
            # The client has disconnected during the write.
            raise asyncio.CancelledError from None

    async def write_within(self, seconds: float, message: Message | bytes) -> None:
        """Send a message, or raise the error of `end`.

        Raises LimitExceededError if that takes longer, or if the caller would have too much that it has not received.
        The client receives the message and then the error, because gRPC cannot cancel a message in part.
        """
        begun = time.monotonic()
        if not self._begun:  # otherwise a cut-off first message would leave unclear whether the call has begun
            self._begun = True
            await self._send_initial_metadata()
        data = message if isinstance(message, bytes) else self.serialize(message)
        with self._calls.unread.sending(self.owner, len(data)), self.cutoff():
            await self.write(data)
        if time.monotonic() - begun > seconds:
            raise LimitExceededError("max_watch_lag", seconds)

    async def _send_initial_metadata(self) -> None:
        """Begin the answer, to its end: gRPC could not send the error of `end` with a beginning under way."""
        task = self.task()
        in_cutoff = task in self.waiting
        self.waiting.discard(task)
        try:
            await self._context.send_initial_metadata(())
        finally:
            if in_cutoff:
                self.waiting.add(task)

    def stream(self) -> AbstractContextManager[None]:
        """Holds a place of a streaming call, whose number is limited."""
        return self._calls.streams.take(self.owner)

    def finish(self) -> None:
        """Run the call to its end from here, even if the server drains or the token is removed."""
        self._calls.finish(self.task())

    def task(self) -> asyncio.Task[Any]:
        """The task that runs."""
        task = asyncio.current_task(self._calls.loop())
        assert task is not None  # gRPC runs each call in a task
        return task

    def cutoff(self) -> "Cutoff":
        """A block that `end` interrupts with its error."""
        return Cutoff(self)

    def end(self, error: Exception) -> None:
        """End the call with an error, as soon as it waits."""
        if self.ending is None:
            self.ending = error
            for task in self.waiting:
                task.cancel()


class Calls:
    """Every call goes through a `handler`.

    Args:
        authenticate: returns the caller, or raises UnauthenticatedError.
        metrics: counts the calls.
        max_message_bytes: the size of the largest message sent.
        streams: limits the streaming calls.
        unread: limits what callers do not read.
        entitled: whether calls may be answered: not while another server may have other hulls.
    """

    def __init__(
        self,
        authenticate: Callable[[Context], Caller],
        metrics: Metrics,
        max_message_bytes: int,
        streams: Places,
        unread: Unread,
        entitled: Callable[[], bool] = lambda: True,
    ) -> None:
        self.max_message_bytes = max_message_bytes
        self.streams = streams
        self.unread = unread
        self._authenticate = authenticate
        self._entitled = entitled
        self._metrics = metrics
        metrics.count_unread(unread)
        self._starting = True
        self._draining = False
        self._open: set[Call] = set()
        self._short: set[asyncio.Task[Any]] = set()
        self._refusals = RefusalLog()
        self._loop: asyncio.AbstractEventLoop | None = None

    def ready(self) -> None:
        """Serve calls from now on; before, they are refused with StartingError."""
        self._starting = False

    async def drain(self, grace: float) -> None:
        """End waiting calls, refuse new ones, and give short ones up to `grace` seconds to finish."""
        self._draining = True
        for call in self._open:
            call.end(DrainingError())
        if self._short:
            await asyncio.wait(self._short, timeout=grace)
        self._refusals.flush()

    def recheck(self, known: Callable[[str], Caller]) -> None:
        """End the calls that their tokens no longer allow, and those for others, whose tokens are not known here.

        Args:
            known: returns the present caller for the hash of a token, or raises UnauthenticatedError.
        """
        for call in self._open:
            if call.caller.for_others:
                call.end(TokensChangedError())
            if not call.caller.key:  # it was admitted without a token
                continue
            try:
                call.caller = known(call.caller.key)
                call.access.change(call.caller.access)
            except (UnauthenticatedError, PermissionDeniedError) as refusal:
                call.end(refusal)

    def loop(self) -> asyncio.AbstractEventLoop:
        """The event loop of all calls; asyncio asks the system for the number of the process to find it."""
        if self._loop is None:
            self._loop = asyncio.get_running_loop()
        return self._loop

    def admit(self, context: Context) -> Call:
        """Begin a call, or raise the error that refuses it."""
        caller = self._authenticate(context)
        if self._starting:
            raise StartingError
        if self._draining:
            raise DrainingError
        self.require_entitled()
        call = Call(self, context, caller)
        self._open.add(call)
        return call

    def require_entitled(self) -> None:
        """Raise StartingError while calls may not be answered."""
        if not self._entitled():
            raise StartingError("the server waits for its database; another server may have the hulls meanwhile")

    def admit_anybody(self, context: Context) -> Call:
        """Begin a call that needs no token, at any time."""
        return Call(self, context, UNAUTHENTICATED_CALLER)

    def note(self, what: str, method: str, code: str, context: Context) -> None:
        """Log a refusal that may be of interest to the operator."""
        if code in SUSPICIOUS:
            self._refusals.add(what, method, code, context.peer())

    def refused_elsewhere(self) -> Callable[[str, str, str], None]:
        """A function for other threads, to report a refused request for metrics: its reason, code and peer."""
        return refusals_elsewhere(self._refusals, self._metrics.calls)

    def finish(self, task: asyncio.Task[Any]) -> None:
        """Have a draining server wait for this task."""
        self._short.add(task)
        task.add_done_callback(self._short.discard)

    def handler(
        self, method: str, admit: Callable[[Context], Call], work: Work
    ) -> Callable[[object, Context], Awaitable[Any]]:
        """What gRPC calls for a method: runs `work` on an admitted call. Refusals become statuses.

        No message of the call is in memory before `work` reads it.
        """
        open_calls, ended = self._open, self._metrics.calls.ended

        # A plain function, because gRPC asks at each call what a handler is, and of a partial that takes longer.
        async def handle(_: object, context: Context) -> Any:
            begun = time.perf_counter()
            code = "OK"
            call = None
            try:
                call = admit(context)
                return await work(call)
            except ANSWERED as error:
                status = rpc_status.to_status(error_status(error, None if call is None else call.batches))
                code = status.code.name
                if isinstance(error, LimitExceededError):
                    self._metrics.limited(error.limit)
                self.note(status.details, method, code, context)
                await context.abort(status.code, status.details, status.trailing_metadata)
            except asyncio.CancelledError:
                code = "CANCELLED"
                raise
            except Exception as error:
                if caller_has_left(error):
                    code = "CANCELLED"
                    raise asyncio.CancelledError from None
                code = "INTERNAL"
                log.exception("a call failed; this is a bug", extra={"method": method})
                await context.abort(grpc.StatusCode.INTERNAL, "internal error, see the server's log")
            finally:
                if call is not None:
                    open_calls.discard(call)
                ended(method, code, time.perf_counter() - begun, 1 if call is None else call.counted)

        return handle


class UnaryHandler:
    """What gRPC calls for a method with one response, made of what `Calls.handler` returns.

    At each call gRPC asks twice whether it is asynchronous: of a function that takes 4 µs, of an awaitable less than 1.
    """

    __slots__ = ("_handle",)

    def __init__(self, handle: Callable[[object, Context], Awaitable[Any]]) -> None:
        self._handle = handle

    def __call__(self, request: object, context: Context) -> Awaitable[Any]:
        """Handle a call."""
        return self._handle(request, context)

    def __await__(self) -> Iterator[Any]:
        """Say that it is asynchronous; it is called, and what that returns is awaited."""
        raise TypeError("a handler has to be called")


def refusals_elsewhere(refusals: RefusalLog, calls: CallCounts) -> Callable[[str, str, str], None]:
    """A function for other threads, to log and count a refused request for metrics: its reason, code and peer."""
    loop = asyncio.get_running_loop()

    def count(reason: str, code: str, peer: str) -> None:
        refusals.add(reason, METRICS_PAGE, code, peer)
        calls.ended(METRICS_PAGE, code, 0.0)

    def refused(reason: str, code: str, peer: str) -> None:
        loop.call_soon_threadsafe(count, reason, code, peer)

    return refused


class Cutoff:
    """The context manager of `Call.cutoff`; a class for speed, because each message of a stream uses one.

    A block within another one leaves its end to that one.
    """

    __slots__ = ("_call", "_nested", "_task")

    def __init__(self, call: Call) -> None:
        self._call = call

    def __enter__(self) -> None:
        if self._call.ending is not None:
            raise self._call.ending
        self._task = self._call.task()
        self._nested = self._task in self._call.waiting
        self._call.waiting.add(self._task)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self._nested:
            return
        self._call.waiting.discard(self._task)
        if isinstance(error, asyncio.CancelledError) and self._call.ending and self._task.uncancel() == 0:
            raise self._call.ending from None
