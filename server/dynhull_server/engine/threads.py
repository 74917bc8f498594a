"""The interfaces to the machine: time, threads, and the queue from the event loop to a thread.

All waiting and all threads of the engine go through these, so that a test can substitute simulated time and threads.
"""

import asyncio
import secrets
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

# np.unique needs it, and two threads cannot import it at its first call: python/cpython#149728.
import numpy.ma  # noqa: F401

T = TypeVar("T")


class Clock:
    """The time."""

    monotonic = staticmethod(time.monotonic)  # seconds; read for each batch, so without a call around it

    def wall(self) -> float:
        """Seconds since 1970."""
        return time.time()

    async def sleep(self, seconds: float) -> None:
        """Sleep."""
        await asyncio.sleep(seconds)


class Inbox(Generic[T]):
    """A queue to a thread, which takes all items at once."""

    def __init__(self) -> None:
        self._turn = threading.Condition()
        self._items: list[T] = []
        self._closed = False

    def put(self, item: T) -> None:
        """Add an item; RuntimeError where the inbox is closed."""
        with self._turn:
            if self._closed:
                raise RuntimeError("the inbox is closed")
            self._items.append(item)
            self._turn.notify()

    def take(self, *, wait: bool = True) -> list[T]:
        """Wait for items, and take all of them; none once the inbox is closed and empty, or without `wait`."""
        with self._turn:
            self._turn.wait_for(lambda: self._items or self._closed or not wait)
            items, self._items = self._items, []
            return items

    def close(self) -> None:
        """Accept no more items."""
        with self._turn:
            self._closed = True
            self._turn.notify()


class Pool(Protocol):
    """Threads that run functions."""

    def submit(self, function: Callable[[], T], /) -> "Future[T]":
        """Call the function in one of the threads."""

    def shutdown(self) -> None:
        """Wait for the running functions."""


class Threads:
    """Creates threads."""

    def pool(self, name: str, size: int) -> Pool:
        """A pool of threads, all of them started at once: later the system might refuse one."""
        pool = ThreadPoolExecutor(size, thread_name_prefix=name)
        together = threading.Barrier(size + 1)
        for _ in range(size):
            pool.submit(together.wait)
        together.wait()
        return pool

    def inbox(self) -> Inbox[T]:
        """A queue to a thread."""
        return Inbox()

    def spawn(self, name: str, run: Callable[[], None], died: Callable[[BaseException], None]) -> "threading.Thread":
        """Start a thread. Its error, if any, is passed to `died` in that thread."""

        def guarded() -> None:
            try:
                run()
            except BaseException as error:
                died(error)

        thread = threading.Thread(target=guarded, name=name, daemon=True)
        thread.start()
        return thread


def _token() -> str:
    return secrets.token_hex(8)


@dataclass(frozen=True, slots=True)
class Machine:
    """All interfaces to the machine."""

    clock: Clock = field(default_factory=Clock)
    threads: Threads = field(default_factory=Threads)
    token: Callable[[], str] = _token
