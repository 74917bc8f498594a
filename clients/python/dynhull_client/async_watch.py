"""Following a hull with asyncio."""

import asyncio
from collections.abc import AsyncIterator
from types import TracebackType
from typing import Self

import grpc

from .calls import Watching
from .connection import Connection
from .errors import error_of
from .messages import Event, decode_event


class AsyncWatch(AsyncIterator[Event]):
    """`Watch` for asyncio: an async iterator and an async context manager; `close` may be called by another task."""

    def __init__(self, connection: Connection, watching: Watching) -> None:
        self._call = connection.begin(connection.stub.Watch, watching.request, watching.timeout)
        self._closed = False

    async def __anext__(self) -> Event:
        try:
            message = await self._call.read()
        except grpc.RpcError as error:
            raise error_of(error) from None
        except asyncio.CancelledError:
            if self._closed:
                raise StopAsyncIteration from None
            raise
        if message is grpc.aio.EOF:
            raise StopAsyncIteration
        return decode_event(message)

    async def close(self) -> None:
        """End the watch."""
        self._closed = True
        self._call.cancel()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()
