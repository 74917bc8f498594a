"""Following a hull."""

import threading
from collections.abc import Iterator
from types import TracebackType
from typing import Any, Self

import grpc

from ._calls import Watching
from ._connection import BlockingConnection
from ._errors import DynhullError, error_of
from ._messages import Event
from ._place import Place


class Watch(Iterator[Event]):
    """The events of a watched hull: a `Snapshot`, then `Change` and `Progress`. Iterates until closed.

    Iterating blocks until the next event, reconnects as often as necessary, and raises DynhullError if the watch cannot
    continue. A context manager, which closes it; `close` may also be called by another thread, and ends the iteration.
    """

    def __init__(self, connection: BlockingConnection, watching: Watching) -> None:
        self._connection = connection
        self._place = Place(watching)
        self._closed = threading.Event()
        self._call: Any = None
        self._begin()

    @property
    def lost(self) -> DynhullError | None:
        """Why no events can arrive: the lost connection or, with `follow`, the missing hull. None while they can.

        Other threads may read it.
        """
        return self._place.lost

    def __next__(self) -> Event:
        event = None
        while event is None:
            if self._call is None:
                self._closed.wait(self._place.pause)
                self._begin()
            try:
                event = self._place.take(next(self._call))
            except grpc.RpcError as failure:
                if self._closed.is_set():
                    raise StopIteration from None
                self._call = None
                event = self._place.end(error_of(failure))
        return event

    def close(self) -> None:
        """End the watch."""
        self._closed.set()
        call = self._call
        if call is not None:
            call.cancel()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Watch of {self._place.request.name!r}>"

    def _begin(self) -> None:
        self._call = self._connection.begin(self._connection.stub.Watch, self._place.request, self._place.timeout())
        if self._closed.is_set():
            self._call.cancel()
