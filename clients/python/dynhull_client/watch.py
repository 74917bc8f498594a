"""Following a hull."""

import threading
from collections.abc import Iterator
from types import TracebackType
from typing import Any, Self

import grpc

from .calls import Watching
from .connection import Connection
from .errors import DynhullError, error_of
from .messages import Event
from .place import Place


class Watch(Iterator[Event]):
    """The events of a watched hull: a `Snapshot`, then `Change` and `Progress`. Iterates until closed.

    Iterating waits for the next event, however often the connection is lost on the way, and raises DynhullError where
    the watch cannot go on. A context manager, closed on leaving; `close` may also be called by another thread, and ends
    the iteration.
    """

    def __init__(self, connection: Connection, watching: Watching) -> None:
        self._connection = connection
        self._place = Place(watching)
        self._closed = threading.Event()
        self._call = self._begin()

    @property
    def lost(self) -> DynhullError | None:
        """What the connection was lost with; None while there is one. For other threads to look at."""
        return self._place.lost

    def __next__(self) -> Event:
        event = None
        while event is None:
            try:
                event = self._place.take(next(self._call))
            except grpc.RpcError as failure:
                if self._closed.is_set():
                    raise StopIteration from None
                self._closed.wait(self._place.pause_after(error_of(failure)))
                self._call = self._begin()
        return event

    def close(self) -> None:
        """End the watch."""
        self._closed.set()
        self._call.cancel()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _begin(self) -> Any:
        call = self._connection.begin(self._connection.stub.Watch, self._place.request, self._place.timeout())
        if self._closed.is_set():
            call.cancel()
        return call
