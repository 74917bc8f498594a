"""What a gateway does with a call: it passes the bytes to the worker that has the name, and the answers back."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, TypeVar

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.status import RelayedError
from dynhull_server.state.errors import LimitExceededError

from .callers import metadata_of
from .placement import worker_of
from .upstream import Upstream, one_request
from .worker_link import Patience, RetiredError, WorkerLink

T = TypeVar("T")
Route = Callable[[bytes, Call], WorkerLink]


class Relay:
    """The workers as one server.

    Args:
        links: the workers, by their numbers.
        max_watch_lag: the seconds that a caller may take to receive one message of a call that only answers.

    Attributes:
        links: the same; others when the names are divided among other workers.
    """

    def __init__(self, links: Sequence[WorkerLink], max_watch_lag: float) -> None:
        self.links = links
        self._max_watch_lag = max_watch_lag

    def link(self, name: str) -> WorkerLink:
        """The worker that has a name."""
        return self.links[worker_of(name, len(self.links))]

    def route(self, message: bytes, _: Call) -> WorkerLink:
        """The worker that has the name in a request: the first field of nearly all of them. Raises DecodeError."""
        if len(self.links) == 1:  # it gets all requests, those without a name, too
            return self.links[0]
        return self.link(pb.DeleteHullRequest.FromString(message).name)

    async def ask(self, method: str, finish: bool, route: Route, call: Call) -> bytes:
        """A call with one request and one response.

        Args:
            method: its path.
            finish: whether a gateway that drains waits for the response.
            route: finds the worker of the request.
            call: the call.
        """
        if not finish:
            with call.cutoff():
                message = await call.receive()
                return await self.found(lambda: route(message, call).ask(method, call, message))
        with call.cutoff():
            message = await call.receive()
        call.finish()
        return await self.found(lambda: route(message, call).ask(method, call, message))

    async def found(self, work: Callable[[], Awaitable[T]]) -> T:
        """Do work that finds its workers; once more if names were divided among others before it has begun."""
        while True:
            try:
                return await work()
            except RetiredError:
                continue

    async def read(self, method: str, call: Call) -> None:
        """A call with one request and many responses."""
        with call.stream():
            with call.cutoff():
                message = await call.receive()
            await self.read_from(self.route(message, call), method, call, message)

    async def read_from(
        self,
        link: WorkerLink,
        method: str,
        call: Call,
        message: bytes,
        sending: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        """Pass on the responses of a worker to a request, until the last; `sending` is around the sending of each."""

        async def pass_on() -> None:
            async with one_request(link.stream(method, metadata_of(call)), message, call.cutoff()) as upstream:
                while True:
                    with call.cutoff():
                        response = await upstream.read()
                    if response is None:
                        return
                    with sending():
                        await self.send(call, response)

        await link.answer(method, call, message, pass_on)

    async def send(self, call: Call, response: bytes) -> None:
        """Send a response. Raises LimitExceededError if the caller does not receive it."""
        await call.write_within(self._max_watch_lag, response)

    async def write(self, method: str, call: Call) -> None:
        """A call with many requests, the first of which names a hull, and one or many responses."""
        with call.stream():
            with call.cutoff():
                first = await call.read()
            # Without any request, every worker refuses the call with the same words.
            link = self.links[0] if first is None else self.route(first, call)
            with call.cutoff():
                await link.arrive(Patience())
            upstream = link.stream(method, metadata_of(call))
            feeding = asyncio.create_task(self._feed(call, first, upstream))
            try:
                while (response := await _response(upstream, feeding)) is not None:
                    await call.write(response)
                await feeding  # raises what has ended the requests
            except RelayedError:
                # Requests that were cut off, perhaps before the first one, are no fault of the caller.
                if feeding.done() and not feeding.cancelled() and (cut := feeding.exception()) is not None:
                    raise cut from None
                raise
            finally:
                feeding.cancel()
                upstream.cancel()

    async def _feed(self, call: Call, message: bytes | None, upstream: Upstream) -> None:
        """Pass on requests until the last, or until the call ends; the worker answers those that it has."""
        try:
            with call.cutoff():
                while message is not None and await upstream.write(message):
                    message = await call.read()
        finally:
            await upstream.done_writing()


async def _response(upstream: Upstream, feeding: "asyncio.Task[None]") -> bytes | None:
    """The next response. Raises what has ended the requests in the middle of one: gRPC then cancels the whole call."""
    try:
        return await upstream.read()
    except asyncio.CancelledError:
        task = asyncio.current_task()
        if task is not None and not task.cancelling():
            await feeding
        raise


def within(max_bytes: int) -> Any:
    """A deserializer that leaves the bytes as they are, and refuses too many of them."""

    def receive(data: bytes) -> tuple[bytes, int] | Exception:
        if len(data) > max_bytes:
            return LimitExceededError("max_message_bytes", max_bytes)
        return data, len(data)

    return receive
