"""The asyncio client."""

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from types import TracebackType
from typing import Any, ClassVar, Concatenate, ParamSpec, Self, TypeVar

import grpc

from . import calls, uses
from .async_ingest import AsyncIngest
from .async_watch import AsyncWatch
from .async_writer import AsyncWriter
from .calls import Call
from .connection import Connection
from .errors import error_of
from .messages import HullInfo
from .methods import documented, opening

P = ParamSpec("P")
Result = TypeVar("Result")


def _answering(
    describe: Callable[P, Call[Result]],
) -> Callable[Concatenate["AsyncHullClient", P], Coroutine[Any, Any, Result]]:
    """The coroutine that makes a call and returns its answer."""

    async def method(self: "AsyncHullClient", /, *arguments: P.args, **options: P.kwargs) -> Result:
        return await self._answer(describe(*arguments, **options))

    documented(method, describe)
    return method


class AsyncHullClient(Connection):
    """A connection to a dynhull server; arguments and errors as of `Connection`.

    Made and used in one running event loop. An async context manager, closed on leaving.
    """

    _grpc: ClassVar[Any] = grpc.aio

    create_hull = _answering(calls.create_hull)
    delete_hull = _answering(calls.delete_hull)
    apply = _answering(calls.apply)
    last_sequence = _answering(calls.last_sequence)
    locate = _answering(calls.locate)
    count = _answering(calls.count)
    support = _answering(calls.support)
    tangents = _answering(calls.tangents)
    distance = _answering(calls.distance)
    intersect_lines = _answering(calls.intersect_lines)
    get_hull = _answering(calls.get_hull)
    sample_points = _answering(calls.sample_points)
    verify = _answering(calls.verify)
    get_measures = _answering(uses.get_measures)
    separate = _answering(uses.separate)
    phase_diagram = _answering(uses.phase_diagram)
    frontier = _answering(uses.frontier)
    ingest = opening(AsyncIngest, calls.ingest)
    watch = opening(AsyncWatch, calls.watch)
    writer = opening(AsyncWriter, calls.writer)

    async def list_hulls(self, prefix: str = "", *, timeout: float | None = None) -> AsyncIterator[HullInfo]:
        """The hulls whose names begin with `prefix`, in the order of their names, fetched as they are wanted."""
        following: str | None = ""
        while following is not None:
            hulls, token = await self._answer(calls.list_page(prefix, following, timeout))
            for each in hulls:
                yield each
            following = token or None

    async def close(self) -> None:
        """Close the connection; calls under way end."""
        self._closed = True
        await self.channel.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()

    async def _answer(self, call: Call[Result]) -> Result:
        attempts = self.attempts(call)
        while True:
            try:
                return call.decode(await self.begin(getattr(self.stub, call.method), call.request, attempts.timeout()))
            except grpc.RpcError as failure:
                pause = attempts.pause_after(error_of(failure))
            await asyncio.sleep(pause)
