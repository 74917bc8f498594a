"""Many reads in few messages, with asyncio."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Self, TypeVar

import grpc

from . import _calls as calls
from . import _layers as peeling
from . import _uses as uses
from ._async_connection import end
from ._errors import DynhullError
from ._methods import answer_of, described, documented
from ._outcomes import settle
from ._pipeline import CLOSED
from ._questions import Questions

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable
    from types import TracebackType

    from dynhull_proto.v1 import hull_service_pb2 as pb

    from ._async_connection import AsyncConnection
    from ._calls import Call, Piping
    from ._questions import Answered

P = ParamSpec("P")
Answer = TypeVar("Answer")


def _asking(describe: Callable[P, Call[Answer]]) -> Callable[Concatenate[AsyncPipeline, P], asyncio.Future[Answer]]:
    """The method that adds a read."""

    def method(self: AsyncPipeline, /, *arguments: P.args, **options: P.kwargs) -> asyncio.Future[Answer]:
        return self._add(described(describe, *arguments, **options))

    documented(method, describe, f"Future[{answer_of(describe)}]", without=("timeout",))
    return method


class AsyncPipeline:
    """`Pipeline` for asyncio: an async context manager for one use. Its methods return futures to await.

    They do not wait. A caller that adds reads faster than they are answered awaits some of the futures now and then, or
    `flush`; otherwise the reads fill the memory.
    """

    def __init__(self, connection: AsyncConnection, piping: Piping) -> None:
        self._connection = connection
        self._questions: Questions[asyncio.Future[Any]] = Questions(piping, connection.retries, self._new_outcome)
        self._news = asyncio.Event()
        self._connections = 0
        self._closed = False
        self._task: asyncio.Task[None] | None = None

    locate = _asking(calls.locate)
    count = _asking(calls.count)
    positions = _asking(calls.positions)
    support = _asking(calls.support)
    tangents = _asking(calls.tangents)
    distance = _asking(calls.distance)
    intersect_lines = _asking(calls.intersect_lines)
    get_hull = _asking(calls.get_hull)
    sample_points = _asking(calls.sample_points)
    verify = _asking(calls.verify)
    last_sequence = _asking(calls.last_sequence)
    layers = _asking(peeling.layers)
    influence = _asking(peeling.influence)
    get_measures = _asking(uses.get_measures)
    separate = _asking(uses.separate)
    phase_diagram = _asking(uses.phase_diagram)
    frontier = _asking(uses.frontier)

    async def flush(self) -> None:
        """Wait until every read so far is answered. Errors stay with the futures of their reads."""
        added = self._questions.added
        while self._questions.settled < added and not self._closed:
            await self._change()

    async def close(self) -> None:
        """Wait like `flush`, then end the pipeline. A second call does nothing."""
        try:
            await self.flush()
        finally:
            await self._end()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None:
            await self.close()
        else:
            await self._end()

    def __repr__(self) -> str:
        return f"<AsyncPipeline to {self._connection.address}>"

    def _new_outcome(self) -> asyncio.Future[Any]:
        return asyncio.get_running_loop().create_future()

    def _add(self, call: Call[Answer]) -> asyncio.Future[Answer]:
        if self._closed:
            raise RuntimeError(CLOSED)
        outcome = self._questions.add(call)
        if self._task is None:
            self._task = asyncio.create_task(self._run(), name=f"pipeline to {self._connection.address}")
        self._notify()
        return outcome

    def _notify(self) -> None:
        """Wake all who wait for a change."""
        if not self._news.is_set():
            self._news.set()
            self._news = asyncio.Event()

    async def _change(self) -> None:
        await self._news.wait()

    async def _end(self) -> None:
        self._closed = True
        for outcome, _ in self._questions.give_up(DynhullError(CLOSED, grpc.StatusCode.CANCELLED, "", {})):
            outcome.cancel()
        self._notify()
        if self._task is not None:
            await end(self._task)

    async def _run(self) -> None:
        """One connection after another, each begun when there is something to ask."""
        while True:
            while self._questions.empty:
                await self._change()
            lost = await self._connect()
            self._connections += 1
            answered, pause = self._questions.lost(lost)
            self._settle(answered)
            await self._connection.pause(pause)

    async def _connect(self) -> DynhullError:
        """Send reads and receive answers; returns the error that ended the connection."""

        async def hear(response: pb.QueryResponse) -> bool:
            self._settle(self._questions.answer(response))
            return self._questions.refusal is None

        requests = self._requests(self._connections)
        lost = await self._connection.converse("Query", requests, hear)
        return self._questions.refusal or lost

    def _settle(self, answered: Answered) -> None:
        settle(answered)
        self._questions.settled += len(answered)
        self._notify()

    async def _requests(self, connection: int) -> AsyncIterator[pb.QueryRequest]:
        """The messages to send on a connection."""
        while self._connections == connection:
            message = self._questions.take()
            if message is None:
                await self._change()
            else:
                yield message
