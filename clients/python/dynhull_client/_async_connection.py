"""A channel to a server, and calls on it, with asyncio."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import suppress
from types import TracebackType
from typing import Any, ClassVar, Self, TypeVar
from weakref import WeakSet

import grpc

from ._calls import Call
from ._connection import BlockingConnection, Connection, Dialling, client_is_closed
from ._errors import DynhullError
from ._retry import Attempts

Result = TypeVar("Result")


class CallErrors:
    """What a call on gRPC's asyncio ends with: an error of ours, or the cancellation of the task that waits for it.

    gRPC does not keep these apart. It may go on, or raise another error, although the task was cancelled, because it
    waits in tasks of its own, which catch the cancellation (`UnaryUnaryCall._invoke`, `StreamStreamCall._prepare_rpc`);
    and it raises CancelledError where nobody cancelled the task, but the channel was closed.

    Args:
        connection: the connection of the call.
        method: its method.
    """

    def __init__(self, connection: Connection, method: str) -> None:
        self._connection = connection
        self._method = method

    def __enter__(self) -> Self:
        task = asyncio.current_task()
        assert task is not None  # only tasks await calls
        self._task = task
        self._before = task.cancelling()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._task.cancelling() > self._before:
            if not isinstance(error, asyncio.CancelledError):
                raise asyncio.CancelledError from error
        elif isinstance(error, asyncio.CancelledError):
            if self._connection.closed:  # else the task was cancelled before, while it ran
                raise client_is_closed() from None
        elif isinstance(error, grpc.RpcError):
            raise self._connection.error_of(error, self._method) from None


class AsyncConnection(Connection):
    """A connection of one event loop."""

    _grpc: ClassVar[Any] = grpc.aio
    _event = asyncio.Event

    def __init__(self, address: str, dialling: Dialling) -> None:
        super().__init__(address, dialling)
        self._others: WeakSet[BlockingConnection] = WeakSet()  # shared with those of other tokens

    def blocking(self) -> BlockingConnection:
        """A connection like this one for threads, which ends with this one."""
        other = BlockingConnection(self.address, self._dialling)
        self._others.add(other)
        return other

    async def answer(self, call: Call[Result]) -> Result:
        """Make a call, again if it may be repeated, and return its answer."""
        attempts = self._attempts(call)
        while True:
            method = getattr(self.stub, call.method)
            try:
                with CallErrors(self, call.method):
                    begun = self.begin(method, call.request, attempts.timeout())
                    response = [part async for part in begun] if call.in_parts else await begun
                return call.decode(response)
            except DynhullError as error:
                call, pause = attempts.after(call, error)
            await self.pause(pause)

    async def parts(self, call: Call[Result]) -> AsyncIterator[Result]:
        """Make a call that is answered by a stream, and return what is decoded of each message of it.

        It may be repeated until the first message is there. It has no limit of time but its own.
        """
        attempts, begun = Attempts(call, call.timeout, self.retries), False
        while True:
            stream = self.begin(getattr(self.stub, call.method), call.request, attempts.timeout())
            try:
                messages = aiter(stream)
                while True:
                    with CallErrors(self, call.method):
                        message = await anext(messages, None)
                    if message is None:
                        return
                    begun = True
                    yield call.decode(message)
            except DynhullError as error:
                if begun:
                    raise
                call, pause = attempts.after(call, error)
            finally:
                stream.cancel()
            await self.pause(pause)

    async def pause(self, seconds: float) -> None:
        """Wait before a new attempt, while the connection is open."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._closed.wait()

    async def presence(self) -> AsyncIterator[bool]:
        """Whether the server is connected, now and whenever that changes, until this is closed."""
        state, before = self._channel.get_state(try_to_connect=True), None
        while not self._closed.is_set():
            if (connected := state is grpc.ChannelConnectivity.READY) is not before:
                yield connected
            before = connected
            with suppress(grpc.aio.UsageError):  # closed meanwhile
                await self._channel.wait_for_state_change(state)
                state = self._channel.get_state(try_to_connect=True)

    async def converse(
        self, method: str, requests: AsyncIterator[Any], hear: Callable[[Any], Awaitable[bool]]
    ) -> DynhullError:
        """Make a call with many requests and responses, until it ends.

        Args:
            method: the method.
            requests: the requests.
            hear: called with each response; returns whether the call goes on.

        Returns:
            What ended the call.
        """
        said: list[grpc.aio.AioRpcError] = []
        unmade: list[BaseException] = []

        def sent(sending: asyncio.Task[None]) -> None:
            """End a call whose requests have ended before their end, without which it would last for ever."""
            if not sending.cancelled() and (error := sending.exception()) is not None:
                unmade.append(error)
                call.cancel()

        try:
            with CallErrors(self, method):
                call = self.begin(getattr(self.stub, method), None, None)
                call.add_done_callback(lambda ended: said.append(_status(ended)))
                sending = asyncio.create_task(_send(call, requests))
                sending.add_done_callback(sent)
                try:
                    async for response in call:  # `read` leaves out responses that are there when a write has failed
                        if not await hear(response):
                            break
                except grpc.aio.AioRpcError:
                    if said:  # gRPC may have forgotten it since, for that of a write that failed
                        raise said[0] from None
                    raise
                except asyncio.CancelledError:
                    if not unmade:
                        raise
                finally:
                    call.cancel()
                    await end(sending)  # a task of gRPC's own may wait for ever for a call that has ended
        except DynhullError as error:
            return error
        if unmade:
            return DynhullError(f"a request could not be made: {unmade[0]!r}", grpc.StatusCode.UNKNOWN, "", {})
        return DynhullError("the server ended the call", grpc.StatusCode.OK, "", {})

    async def close(self) -> None:
        """End the connection and the calls on it."""
        self._closed.set()
        for each in list(self._others):
            each.close()
        await self._channel.close()


def _status(call: Any) -> grpc.aio.AioRpcError:
    """The status that a call has when it ends."""
    code, before, after, details = (
        _now(each()) for each in (call.code, call.initial_metadata, call.trailing_metadata, call.details)
    )
    return grpc.aio.AioRpcError(code, before, after, details)


def _now(coroutine: Coroutine[Any, Any, Any]) -> Any:
    """The result of a coroutine that does not wait, because its call has ended."""
    try:
        coroutine.send(None)
    except StopIteration as result:
        return result.value
    raise AssertionError("a call that has ended has a status")


async def end(task: asyncio.Task[Any]) -> None:
    """Cancel a task and wait for its end; if this is cancelled, too, only the former."""
    task.cancel()
    await asyncio.wait([task])


async def unless(ended: asyncio.Event, work: Coroutine[Any, Any, Result]) -> Result | None:
    """The result of work; None if `ended` is set before, which cancels it."""
    working, ending = asyncio.create_task(work), asyncio.create_task(ended.wait())
    working.add_done_callback(note)
    try:
        await asyncio.wait([working, ending], return_when=asyncio.FIRST_COMPLETED)
    finally:
        working.cancel()
        ending.cancel()
        await asyncio.wait([working, ending])
    return None if working.cancelled() else working.result()


def note(task: asyncio.Future[Any]) -> None:
    """Note the error of a task that nobody may wait for any more."""
    if not task.cancelled():
        task.exception()


async def _send(call: Any, requests: AsyncIterator[Any]) -> None:
    """Send requests until the call ends, which its responses explain."""
    with suppress(grpc.RpcError, grpc.aio.InternalError, asyncio.InvalidStateError):  # the call has ended meanwhile
        async for request in requests:
            await call.write(request)
        await call.done_writing()
