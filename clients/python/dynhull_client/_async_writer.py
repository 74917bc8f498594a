"""Sends points to a hull in numbered batches, each applied exactly once, with asyncio."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from functools import partial
from time import monotonic
from typing import TYPE_CHECKING, Any, Self

from ._async_connection import end, unless
from ._calls import Writing, known
from ._errors import DynhullError
from ._gathering import put_parts, remove_parts
from ._outcomes import settle
from ._window import InFlight
from ._writer import CLOSED

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from datetime import timedelta
    from types import TracebackType

    import numpy.typing as npt

    from dynhull_proto.v1 import hull_service_pb2 as pb

    from ._async_connection import AsyncConnection
    from ._batch import Only
    from ._gathering import Part
    from ._messages import Applied
    from ._window import Settled


class AsyncWriter:
    """`Writer` for asyncio: an async context manager for one use. Await `put`, `flush` and `close`."""

    def __init__(self, connection: AsyncConnection, writing: Writing) -> None:
        self._connection = connection
        self._writing = writing
        self._opening = asyncio.Lock()
        self._turn = asyncio.Condition()
        self._connections = 0
        self._closed = asyncio.Event()
        self._window: InFlight[asyncio.Future[Applied]] | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def sequence(self) -> int:
        """The number of the producer's last acknowledged batch. RuntimeError before the writer has started."""
        if self._window is None:
            raise RuntimeError("the writer has not started: put points, or use it in an async with statement")
        return self._window.sequence

    @property
    def uid(self) -> str:
        """The uid of the hull, for a later writer. RuntimeError before the writer has started."""
        if self._window is None:
            raise RuntimeError("the writer has not started: put points, or use it in an async with statement")
        return self._window.uid

    async def put(
        self,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        *,
        keys: Any = None,
        points: npt.ArrayLike | None = None,
        times: Any = None,
        only: Only | None = None,
        ttl: float | timedelta | str | None = None,
        expire_times: Any = None,
        accuracies: Any = None,
        sequence: int | None = None,
    ) -> asyncio.Future[Applied]:
        """Add points to the next batch, all to the same one; waits while too many are not acknowledged.

        Returns the future of the batch's effect. Arguments and errors as for `Writer.put`.
        """
        columns = times, only, ttl, expire_times, accuracies
        parts = put_parts(self._writing, insert, delete, move, keys, points, *columns)
        return await self._add(parts, sequence)

    async def remove(self, keys: Any, *, sequence: int | None = None) -> asyncio.Future[Applied]:
        """Remove keys, as `Writer.remove` does."""
        return await self._add(remove_parts(self._writing, keys), sequence)

    async def flush(self) -> None:
        """Wait until everything put so far is acknowledged; raises the first error of a batch since the last flush."""
        window = self._window
        if window is None:
            return
        async with self._turn:
            window.hurry(monotonic())
            self._turn.notify_all()
            begun = window.begun
            await self._turn.wait_for(lambda: window.settled >= begun or window.failure or self._closed.is_set())
            window.raise_refusal()
            if window.settled < begun:
                raise RuntimeError(CLOSED)

    async def close(self) -> None:
        """Wait like `flush`, then end the writer. A second call does nothing."""
        if self._closed.is_set():
            return
        try:
            await self.flush()
        finally:
            await self._end()

    async def __aenter__(self) -> Self:
        await self._open()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None:
            await self.close()
        else:
            await self._end()

    def __repr__(self) -> str:
        return f"<AsyncWriter to {self._writing.name!r} as producer {self._writing.producer!r}>"

    async def _add(self, parts: list[Part], sequence: int | None) -> asyncio.Future[Applied]:
        window = self._window
        if window is None or self._closed.is_set():
            window = await self._open()
        number = window.number(parts, sequence)
        async with self._turn:
            for part in parts:
                if not window.admits(part):
                    await self._turn.wait_for(partial(self._may_put, window, part))
                if self._closed.is_set():
                    raise RuntimeError(CLOSED)
                outcome = window.put(part, monotonic(), number)
            if window.ready:  # otherwise each put would wake the sender in vain
                self._turn.notify_all()
        return outcome

    def _may_put(self, window: InFlight[asyncio.Future[Applied]], part: Part) -> bool:
        return window.admits(part) or window.failure is not None or self._closed.is_set()

    async def _open(self) -> InFlight[asyncio.Future[Applied]]:
        async with self._opening:
            if self._window is None:
                asking = self._connection.answer(known(self._writing))
                begin = await unless(self._closed, asking)
                if self._closed.is_set() or begin is None:
                    raise RuntimeError(CLOSED)
                self._window = InFlight(self._writing, begin, asyncio.get_running_loop().create_future)
                self._task = asyncio.create_task(self._run(self._window), name=f"writer to {self._writing.name}")
            if self._closed.is_set():
                raise RuntimeError(CLOSED)
            return self._window

    async def _end(self) -> None:
        self._closed.set()
        async with self._turn:
            left = [] if self._window is None else self._window.abandon()
            self._turn.notify_all()
        for outcome in left:
            outcome.cancel()
        if self._task is not None:
            await end(self._task)

    async def _run(self, window: InFlight[asyncio.Future[Applied]]) -> None:
        """One connection after another, until the writer is closed or has failed."""
        while True:
            lost = await self._connect(window)
            async with self._turn:
                if window.failure:
                    return
                self._connections += 1
                settled, pause = window.lost(lost, monotonic())
                self._turn.notify_all()
            _settle(settled)
            if pause is None:
                return
            await self._connection.pause(pause)

    async def _connect(self, window: InFlight[asyncio.Future[Applied]]) -> DynhullError:
        """Send batches and read acknowledgements; returns the error that ended the connection."""

        async def hear(response: pb.StreamResponse) -> bool:
            async with self._turn:
                settled = window.acknowledge(response)
                self._turn.notify_all()
            _settle(settled)
            return not window.failure

        requests = self._requests(window, self._connections)
        return await self._connection.converse("Stream", requests, hear)

    async def _requests(
        self, window: InFlight[asyncio.Future[Applied]], connection: int
    ) -> AsyncIterator[pb.StreamRequest]:
        """The messages to send on a connection."""
        yield window.first()
        while True:
            async with self._turn:
                request = None
                while request is None:
                    if self._closed.is_set() or window.failure or self._connections != connection:
                        return
                    request = window.take(monotonic())
                    if request is None:
                        with suppress(TimeoutError):
                            async with asyncio.timeout(window.due_in(monotonic())):
                                await self._turn.wait()
                self._turn.notify_all()
            yield request


def _settle(settled: Settled) -> None:
    """Settle the futures. asyncio does not log their errors: `flush` and `close` raise the first."""
    settle(settled)
    for outcome, result in settled:
        if isinstance(result, DynhullError) and not outcome.cancelled():
            outcome.exception()
