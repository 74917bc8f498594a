"""Following a hull with asyncio."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

import grpc

from ._calls import Watching
from ._connection import AsyncConnection
from ._errors import DynhullError, error_of
from ._messages import Event
from ._place import Place


class AsyncWatch(AsyncIterator[Event]):
    """`Watch` for asyncio: an async iterator and an async context manager; another task may call `close`."""

    def __init__(self, connection: AsyncConnection, watching: Watching) -> None:
        self._connection = connection
        self._place = Place(watching)
        self._closed = asyncio.Event()
        self._call: Any = None
        self._begin()

    @property
    def lost(self) -> DynhullError | None:
        """Why no events can arrive: the lost connection or, with `follow`, the missing hull. None while they can.

        Other tasks may read it.
        """
        return self._place.lost

    async def __anext__(self) -> Event:
        event = None
        while event is None:
            if self._call is None:
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._closed.wait(), self._place.pause)
            if self._closed.is_set():
                raise StopAsyncIteration
            if self._call is None or self._call.cancelled():  # gRPC cancels a call when its caller stops waiting
                self._begin()
            try:
                event = self._place.take(await anext(self._events))
            except grpc.RpcError as failure:
                self._call = None
                event = self._place.end(error_of(failure))
            except asyncio.CancelledError:
                if not self._closed.is_set():
                    raise
        return event

    async def close(self) -> None:
        """End the watch."""
        self._closed.set()
        if self._call is not None:
            self._call.cancel()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()

    def __repr__(self) -> str:
        return f"<AsyncWatch of {self._place.request.name!r}>"

    def _begin(self) -> None:
        self._call = self._connection.begin(self._connection.stub.Watch, self._place.request, self._place.timeout())
        self._events = aiter(self._call)
