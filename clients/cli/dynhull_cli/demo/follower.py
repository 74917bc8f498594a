"""A thread that follows a subscription."""

import threading
from collections.abc import Callable, Iterator
from time import monotonic
from typing import Generic, Protocol, TypeVar

PATIENCE = 30.0  # seconds to wait for an event; later, it counts as missing
Event = TypeVar("Event")
Event_co = TypeVar("Event_co", covariant=True)
Found = TypeVar("Found")


class Subscription(Protocol[Event_co]):
    """Events until it is closed."""

    def __iter__(self) -> Iterator[Event_co]: ...

    def close(self) -> None:
        """End the iteration, from any thread."""


class Follower(Generic[Event]):
    """Gives each event of a subscription to a function, in a thread, until it is stopped."""

    def __init__(self, name: str, events: Subscription[Event], take: Callable[[Event], object]) -> None:
        self._events = events
        self._take = take
        self._taken = threading.Condition()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._follow, name=name, daemon=True)
        self._thread.start()

    def _follow(self) -> None:
        try:
            for event in self._events:
                with self._taken:
                    self._take(event)
                    self._taken.notify_all()
        except Exception as failure:  # raised in the thread that waits
            with self._taken:
                self._failure = failure
                self._taken.notify_all()

    def wait(self, find: Callable[[], Found | None]) -> Found | None:
        """What `find` finds after the events so far or later ones; None if that does not come in time.

        `find` runs while no event is taken.
        """
        deadline = monotonic() + PATIENCE
        with self._taken:
            while (found := find()) is None:
                if self._failure:
                    raise self._failure
                if not self._taken.wait(deadline - monotonic()) and monotonic() >= deadline:
                    return None
            return found

    def stop(self) -> None:
        """End the subscription."""
        self._events.close()
        self._thread.join()
