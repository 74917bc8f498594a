"""Following a hull with asyncio."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from types import TracebackType
from typing import Self

import grpc

from .calls import Watching
from .connection import Connection
from .errors import DynhullError, error_of
from .messages import Event
from .place import Place


class AsyncWatch(AsyncIterator[Event]):
    """`Watch` for asyncio: an async iterator and an async context manager; `close` may be called by another task."""

    def __init__(self, connection: Connection, watching: Watching) -> None:
        self._connection = connection
        self._place = Place(watching)
        self._closed = asyncio.Event()
        self._begin()

    @property
    def lost(self) -> DynhullError | None:
        """What the connection was lost with; None while there is one. For other tasks to look at."""
        return self._place.lost

    async def __anext__(self) -> Event:
        event = None
        while event is None:
            if self._closed.is_set():
                raise StopAsyncIteration
            if self._call.cancelled():  # as gRPC does when a wait for an event is given up
                self._begin()
            try:
                event = self._place.take(await anext(self._events))
            except grpc.RpcError as failure:
                pause = self._place.pause_after(error_of(failure))
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._closed.wait(), pause)
                self._begin()
            except asyncio.CancelledError:
                if not self._closed.is_set():
                    raise
        return event

    async def close(self) -> None:
        """End the watch."""
        self._closed.set()
        self._call.cancel()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()

    def _begin(self) -> None:
        self._call = self._connection.begin(self._connection.stub.Watch, self._place.request, self._place.timeout())
        self._events = aiter(self._call)
