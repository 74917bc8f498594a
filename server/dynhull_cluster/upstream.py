"""A call of a worker with any number of requests and responses."""

import asyncio
from collections.abc import AsyncIterator, Coroutine, Iterator
from contextlib import AbstractContextManager, asynccontextmanager, contextmanager, suppress
from typing import Any, TypeVar

import grpc
from google.rpc.status_pb2 import Status
from grpc_status import rpc_status

from dynhull_server.rpc.status import RelayedError

# Writing to a call that has ended.
ENDED = suppress(asyncio.InvalidStateError, grpc.aio.AioRpcError)
# What gRPC itself makes of a connection that breaks, or of a worker that ends in the middle of a request; a worker
# gives its own errors details.
BROKEN = grpc.StatusCode.CANCELLED, grpc.StatusCode.INTERNAL, grpc.StatusCode.UNKNOWN
# Seconds that what a worker has sent may arrive after a write that it has made fail, or after its end.
LATE_SECONDS = 1.0

T = TypeVar("T")


class Upstream:
    """The call, with bytes for messages.

    gRPC forgets the status of a call that ends while a request is written (github.com/grpc/grpc/issues/36066), and
    reports an internal error, by `read` even before the responses that are there. So they are read by iteration, which
    goes on to the last, because the status of the worker comes after it; and the first status from there is kept.
    """

    def __init__(self, call: "grpc.aio.StreamStreamCall[bytes, bytes]") -> None:
        self._call = call
        self._severed = False
        self._ended = asyncio.Event()
        self._waiting: set[asyncio.Task[Any]] = set()
        self._interrupted: set[asyncio.Task[Any]] = set()
        self._responses = aiter(call)
        self._said: asyncio.Future[Status] = asyncio.get_running_loop().create_future()
        call.add_done_callback(self._note)

    async def write(self, message: bytes) -> bool:
        """Send a request. Returns False if the call has ended: `read` says why."""
        with ENDED, self._unless_severed():
            await self._call.write(message)
            return True
        return False

    async def done_writing(self) -> None:
        """Say that there are no more requests."""
        with ENDED, self._unless_severed():
            await self._call.done_writing()

    async def read(self) -> bytes | None:
        """The next response; None after the last. Raises RelayedError."""
        try:
            if not self._severed:
                with self._unless_severed():
                    return await anext(self._responses, None)
            raise RelayedError(lost_status())
        except grpc.aio.AioRpcError as error:
            if not self._said.done() and error.code() in BROKEN:
                await asyncio.wait([self._said], timeout=LATE_SECONDS)
            status = self._said.result() if self._said.done() else status_of(error)
            if status.code == grpc.StatusCode.OK.value[0]:
                return None
            raise RelayedError(status) from None

    @property
    def over(self) -> bool:
        """Whether the call has ended, though responses may be left to read."""
        return bool(self._call.done())

    async def ended(self) -> None:
        """Wait until it has ended."""
        await self._ended.wait()

    def sever(self) -> None:
        """End the call as one whose connection was lost: nobody will answer it."""
        self._severed = True
        for task in self._waiting:  # gRPC leaves who writes to a connection that is never made waiting for ever
            self._interrupted.add(task)
            task.cancel()
        self._call.cancel()

    @contextmanager
    def _unless_severed(self) -> Iterator[None]:
        """End the block without an error when the call is severed."""
        task = asyncio.current_task()
        assert task is not None  # the event loop runs nothing else that waits
        self._waiting.add(task)
        try:
            yield
        except asyncio.CancelledError:
            if task in self._interrupted:
                self._interrupted.discard(task)
                task.uncancel()
            if not self._severed or task.cancelling():
                raise
        finally:
            self._waiting.discard(task)

    def cancel(self) -> None:
        """End the call."""
        self._call.cancel()

    def _note(self, call: Any) -> None:
        """Keep the status that the call has now."""
        self._ended.set()
        code, details, metadata = (_now(each) for each in (call.code(), call.details(), call.trailing_metadata()))
        status = _details(code, details, metadata)
        if status is None and code not in BROKEN:
            status = Status(code=code.value[0], message=details or "")
        if status is not None and not self._said.done():
            self._said.set_result(status)


@asynccontextmanager
async def one_request(
    upstream: Upstream, message: bytes, sending: AbstractContextManager[None]
) -> AsyncIterator[Upstream]:
    """The call of a worker, with this request and no other, which ends with the block.

    `sending` is around the sending of the request, which waits while the worker starts.
    """
    try:
        with sending:
            await upstream.write(message)
            await upstream.done_writing()
        yield upstream
    finally:
        upstream.cancel()


def status_of(error: "grpc.aio.AioRpcError") -> Status:
    """The status of an error, as the caller gets it."""
    code, details = error.code(), error.details()
    status = _details(code, details, error.trailing_metadata())
    if status is None and code in BROKEN:
        return lost_status()
    return status or Status(code=code.value[0], message=details or "")


def lost_status() -> Status:
    """The status of a call whose worker has ended: without a reason, as that of a lost connection."""
    return Status(code=grpc.StatusCode.UNAVAILABLE.value[0], message="the worker has ended; the outcome is unknown")


def _details(code: grpc.StatusCode, details: str | None, metadata: Any) -> Status | None:
    """The google.rpc.Status that a worker gives its errors."""
    status: Status | None = rpc_status.from_call(_Finished(code, details or "", metadata))
    return status


def _now(coroutine: Coroutine[Any, Any, T]) -> T:
    """The result of a coroutine that does not wait, because its call has ended."""
    try:
        coroutine.send(None)
    except StopIteration as result:
        value: T = result.value
        return value
    raise AssertionError("a call that has ended has a status")


class _Finished:
    """A finished call, for grpc_status."""

    def __init__(self, code: grpc.StatusCode, details: str, metadata: Any) -> None:
        self._code = code
        self._details = details
        self._metadata = metadata

    def trailing_metadata(self) -> Any:
        return self._metadata

    def code(self) -> grpc.StatusCode:
        return self._code

    def details(self) -> str:
        return self._details
