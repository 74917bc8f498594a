"""Following a hull, a fence or an alarm with asyncio."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

import grpc

from ._alarm_messages import AlarmEvent
from ._alarm_place import AlarmPlace
from ._alarms import WatchingAlarm
from ._async_connection import AsyncConnection, note, unless
from ._calls import Watching
from ._connection import client_is_closed
from ._errors import DynhullError
from ._feed import Feeding, FeedPlace
from ._feed_messages import FeedBatch
from ._fence_messages import FenceEvent
from ._fence_place import FencePlace
from ._fences import WatchingFence
from ._fences_between import BetweenPlace, ReadingBetween
from ._hull_place import HullPlace
from ._many import ManyPlace, WatchingMany
from ._many_messages import ManyChange
from ._messages import Event
from ._place import Happening, Place
from ._replay import ReplayPlace


class AsyncFollower(AsyncIterator[Happening]):
    """The events of something that is watched. An async context manager, which closes it."""

    def __init__(self, connection: AsyncConnection, place: Place[Happening]) -> None:
        self._connection = connection
        self._place = place
        self._closed = asyncio.Event()
        self._arrived: deque[Happening] = deque()
        self._call: Any = None
        self._reading: asyncio.Task[Any] | None = None
        self._begin()

    @property
    def lost(self) -> DynhullError | None:
        """Why no events can arrive: the lost connection or, with `follow`, the missing hull. None while they can.

        Other tasks may read it.
        """
        return self._place.lost

    async def __anext__(self) -> Happening:
        while not self._arrived:
            if self._call is None:
                await unless(self._closed, self._connection.pause(self._place.pause))
            if self._closed.is_set() or self._place.ended:
                raise StopAsyncIteration
            if self._call is None:
                self._begin()
            if self._reading is None:
                self._reading = asyncio.ensure_future(anext(self._events))
                self._reading.add_done_callback(note)
            reading = self._reading
            if not reading.done():
                await asyncio.wait([reading])  # a wait that is cancelled leaves the read to the next one
            if reading is not self._reading:
                continue  # another task has its events
            self._reading = None
            try:
                self._arrived.extend(self._place.take(reading.result()))
            except StopAsyncIteration:
                self._place.ended = True
                raise
            except grpc.RpcError as failure:
                self._call = None
                self._arrived.extend(self._place.end(self._connection.error_of(failure, self._place.method)))
            except asyncio.CancelledError:
                if not self._closed.is_set():
                    self._call = None
                    self._arrived.extend(self._place.end(client_is_closed()))
        return self._arrived.popleft()

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

    def __del__(self) -> None:
        # A read whose wait was cancelled holds the call; and a call and its iterator hold each other until garbage is
        # collected, in a quiet program perhaps never.
        with suppress(RuntimeError):  # the loop has ended
            for each in (self._reading, self._call):
                if each is not None:
                    each.cancel()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self._place.subject}>"

    def _begin(self) -> None:
        method = getattr(self._connection.stub, self._place.method)
        self._call = self._connection.begin(method, self._place.request, self._place.timeout())
        self._events = aiter(self._call)


class AsyncWatch(AsyncFollower[Event]):
    """`Watch` for asyncio: an async iterator and an async context manager; another task may call `close`."""

    def __init__(self, connection: AsyncConnection, watching: Watching) -> None:
        super().__init__(connection, HullPlace(watching, connection.retries))


class AsyncReplay(AsyncFollower[Event]):
    """`Replay` for asyncio: an async iterator and an async context manager; another task may call `close`."""

    def __init__(self, connection: AsyncConnection, watching: Watching) -> None:
        super().__init__(connection, ReplayPlace(watching, connection.retries))


class AsyncManyWatch(AsyncFollower[ManyChange]):
    """`ManyWatch` for asyncio: an async iterator and an async context manager; another task may call `close`."""

    def __init__(self, connection: AsyncConnection, watching: WatchingMany) -> None:
        super().__init__(connection, ManyPlace(watching, connection.retries))


class AsyncFenceWatch(AsyncFollower[FenceEvent]):
    """`FenceWatch` for asyncio: an async iterator and an async context manager; another task may call `close`."""

    def __init__(self, connection: AsyncConnection, watching: WatchingFence) -> None:
        super().__init__(connection, FencePlace(watching, connection.retries))


class AsyncFenceEvents(AsyncFollower[FenceEvent]):
    """`FenceEvents` for asyncio: an async iterator and an async context manager; another task may call `close`."""

    def __init__(self, connection: AsyncConnection, reading: ReadingBetween) -> None:
        super().__init__(connection, BetweenPlace(reading, connection.retries))


class AsyncAlarmWatch(AsyncFollower[AlarmEvent]):
    """`AlarmWatch` for asyncio: an async iterator and an async context manager; another task may call `close`."""

    def __init__(self, connection: AsyncConnection, watching: WatchingAlarm) -> None:
        super().__init__(connection, AlarmPlace(watching, connection.retries))


class AsyncFeed(AsyncFollower[FeedBatch]):
    """`Feed` for asyncio: an async iterator and an async context manager; another task may call `close`."""

    def __init__(self, connection: AsyncConnection, feeding: Feeding) -> None:
        super().__init__(connection, FeedPlace(feeding, connection.retries))
