"""Following a hull, a fence or an alarm."""

import threading
from collections import deque
from collections.abc import Iterator
from types import TracebackType
from typing import Any, Self

import grpc

from ._alarm_messages import AlarmEvent
from ._alarm_place import AlarmPlace
from ._alarms import WatchingAlarm
from ._calls import Watching
from ._connection import BlockingConnection
from ._errors import DynhullError
from ._feed import Feeding, FeedPlace
from ._feed_messages import FeedBatch
from ._fence_messages import FenceEvent
from ._fence_place import FencePlace
from ._fences import WatchingFence
from ._fences_between import BetweenPlace, ReadingBetween
from ._home import Home
from ._hull_place import HullPlace
from ._many import ManyPlace, WatchingMany
from ._many_messages import ManyChange
from ._messages import Event
from ._place import Happening, Place
from ._replay import ReplayPlace


class Follower(Iterator[Happening]):
    """The events of something that is watched. A context manager, which closes it."""

    def __init__(self, connection: BlockingConnection, place: Place[Happening]) -> None:
        self._connection = connection
        self._place = place
        self._home = Home("watch")
        self._closed = threading.Event()
        self._arrived: deque[Happening] = deque()
        self._call: Any = None
        self._begin()

    @property
    def lost(self) -> DynhullError | None:
        """Why no events can arrive: the lost connection or, with `follow`, the missing hull. None while they can.

        Other threads may read it.
        """
        return self._place.lost

    def __next__(self) -> Happening:
        self._home.require()
        while not self._arrived:
            if self._place.ended:
                raise StopIteration
            if self._call is None:
                self._connection.pause(self._place.pause, self._closed.is_set)
                self._begin()
            try:
                self._arrived.extend(self._place.take(next(self._call)))
            except StopIteration:
                self._place.ended = True
                self._home.end()
                raise
            except grpc.RpcError as failure:
                if self._closed.is_set():
                    raise StopIteration from None
                self._call = None
                self._home.end()
                self._arrived.extend(self._place.end(self._connection.error_of(failure, self._place.method)))
        return self._arrived.popleft()

    def close(self) -> None:
        """End the watch. In a process that was forked later it does nothing."""
        if self._home.left():
            return
        self._closed.set()
        self._connection.wake()
        call = self._call
        if call is not None:
            call.cancel()
        self._home.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self._place.subject}>"

    def _begin(self) -> None:
        method = getattr(self._connection.stub, self._place.method)
        self._home.begin()
        self._call = self._connection.begin(method, self._place.request, self._place.timeout())
        if self._closed.is_set():
            self._call.cancel()


class Watch(Follower[Event]):
    """The events of a watched hull: a `Snapshot`, then `Change` and `Progress`. Iterates until closed.

    Iterating blocks until the next event, reconnects as often as necessary, and raises DynhullError if the watch cannot
    continue. A context manager, which closes it; `close` may also be called by another thread, and ends the iteration.
    """

    def __init__(self, connection: BlockingConnection, watching: Watching) -> None:
        super().__init__(connection, HullPlace(watching, connection.retries))


class Replay(Follower[Event]):
    """The events of the past of a hull: a `Snapshot`, then `Change` and `Progress`. Iterates until the last revision.

    Iterating blocks until the next event, reconnects as often as necessary, and raises DynhullError if the replay
    cannot continue. A context manager, which closes it; `close` may also be called by another thread, and ends the
    iteration.
    """

    def __init__(self, connection: BlockingConnection, watching: Watching) -> None:
        super().__init__(connection, ReplayPlace(watching, connection.retries))


class ManyWatch(Follower[ManyChange]):
    """What becomes of many hulls: a `ManyChange` for each, one that says "complete", then what changes, until closed.

    Iterating blocks until the next change, reconnects as often as necessary, and raises DynhullError if the watch
    cannot continue. A context manager, which closes it; `close` may also be called by another thread, and ends the
    iteration.
    """

    def __init__(self, connection: BlockingConnection, watching: WatchingMany) -> None:
        super().__init__(connection, ManyPlace(watching, connection.retries))


class FenceWatch(Follower[FenceEvent]):
    """The events of a watched fence, in order. Iterates until closed, or until the fence is deleted.

    Iterating blocks until the next event, reconnects as often as necessary, and raises DynhullError if the watch cannot
    continue. A context manager, which closes it; `close` may also be called by another thread, and ends the iteration.
    """

    def __init__(self, connection: BlockingConnection, watching: WatchingFence) -> None:
        super().__init__(connection, FencePlace(watching, connection.retries))


class FenceEvents(Follower[FenceEvent]):
    """The events that a fence would have made, in order. Iterates until the end of the asked time, or until closed.

    Iterating blocks until the next event, and raises DynhullError if the server cannot go on, or is lost. A context
    manager, which closes it; `close` may also be called by another thread, and ends the iteration.
    """

    def __init__(self, connection: BlockingConnection, reading: ReadingBetween) -> None:
        super().__init__(connection, BetweenPlace(reading, connection.retries))


class AlarmWatch(Follower[AlarmEvent]):
    """The events of a watched alarm, in order. Iterates until closed, or until the alarm is deleted.

    Iterating blocks until the next event, reconnects as often as necessary, and raises DynhullError if the watch cannot
    continue. A context manager, which closes it; `close` may also be called by another thread, and ends the iteration.
    """

    def __init__(self, connection: BlockingConnection, watching: WatchingAlarm) -> None:
        super().__init__(connection, AlarmPlace(watching, connection.retries))


class Feed(Follower[FeedBatch]):
    """The batches of a hull, each once and in order. Iterates until closed.

    Iterating blocks until the next batch, reconnects as often as necessary, and raises DynhullError if the feed cannot
    continue. A context manager, which closes it; `close` may also be called by another thread, and ends the iteration.
    """

    def __init__(self, connection: BlockingConnection, feeding: Feeding) -> None:
        super().__init__(connection, FeedPlace(feeding, connection.retries))
