"""Work on one hull, in order: small work at once, the rest off the event loop."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any, TypeVar

T = TypeVar("T")
Outcome = tuple[Any, Exception | None]
Job = tuple[Callable[[], Any], Callable[[Any, Exception | None], None]]


class SerialExecutor:
    """Runs functions one at a time and in the order they came. To be used on one event loop.

    A small function runs at once where nothing is under way: the trip to another thread would take longer. Everything
    else goes to a pool of threads, and whatever waits when the pool is ready goes there in one trip.

    Args:
        pool: where the functions run.
        after: called on the event loop whenever something has run, before its callers are told.
    """

    def __init__(self, pool: Executor, after: Callable[[], None]) -> None:
        self._pool = pool
        self._after = after
        self._waiting: list[Job] = []
        self._busy = False

    def submit(self, function: Callable[[], T], done: Callable[[Any, Exception | None], None], small: bool) -> None:
        """Call `function`, and `done` with its result or its exception, on the event loop."""
        if small and not self._busy:
            outcome = _outcome(function)
            self._after()
            done(*outcome)
            return
        self._waiting.append((function, done))
        if not self._busy:
            self._busy = True
            self._start_trip(asyncio.get_running_loop())

    async def run(self, function: Callable[[], T], small: bool) -> T:
        """The function's result, or its exception. A caller that is cancelled stops waiting, its function runs."""
        future: asyncio.Future[T] = asyncio.get_running_loop().create_future()

        def done(result: T, error: Exception | None) -> None:
            if future.done():
                return
            if error is None:
                future.set_result(result)
            else:
                future.set_exception(error)

        self.submit(function, done, small)
        return await future

    def _start_trip(self, loop: asyncio.AbstractEventLoop) -> None:
        jobs, self._waiting = self._waiting, []

        def trip() -> None:
            outcomes = [_outcome(function) for function, _ in jobs]
            loop.call_soon_threadsafe(self._end_trip, loop, jobs, outcomes)

        self._pool.submit(trip)

    def _end_trip(self, loop: asyncio.AbstractEventLoop, jobs: list[Job], outcomes: list[Outcome]) -> None:
        self._after()
        if self._waiting:
            self._start_trip(loop)
        else:
            self._busy = False
        for (_, done), outcome in zip(jobs, outcomes, strict=True):
            done(*outcome)


def _outcome(function: Callable[[], Any]) -> Outcome:
    try:
        return function(), None
    except Exception as error:  # whatever it is, it belongs to the caller
        return None, error
