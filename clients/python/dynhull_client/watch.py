"""Following a hull."""

from collections.abc import Iterator
from types import TracebackType
from typing import Self

import grpc

from .calls import Watching
from .connection import Connection
from .errors import error_of
from .messages import Event, decode_event


class Watch(Iterator[Event]):
    """The events of a watched hull: a `Snapshot`, then `Change` and `Progress`. Iterates until closed.

    Iterating waits for the next event, and raises DynhullError where the server ends the watch. A context manager,
    closed on leaving; `close` may also be called by another thread, and ends the iteration.
    """

    def __init__(self, connection: Connection, watching: Watching) -> None:
        self._call = connection.begin(connection.stub.Watch, watching.request, watching.timeout)
        self._closed = False

    def __next__(self) -> Event:
        try:
            return decode_event(next(self._call))
        except grpc.RpcError:
            if self._closed:
                raise StopIteration from None
            raise error_of(self._call) from None

    def close(self) -> None:
        """End the watch."""
        self._closed = True
        self._call.cancel()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()
