"""Work on one hull, off the event loop and in order."""

import asyncio
from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any, TypeVar

T = TypeVar("T")
Job = tuple[Callable[[], Any], asyncio.Future[Any]]


class SerialExecutor:
    """Runs functions on a pool of threads, one at a time and in the order they came.

    Whatever waits when the pool is ready goes there in one trip. A caller that is cancelled stops waiting; its function
    runs all the same once it has been handed to the pool.

    Args:
        pool: where the functions run.
        after: called on the event loop after each trip.
    """

    def __init__(self, pool: Executor, after: Callable[[], None]) -> None:
        self._pool = pool
        self._after = after
        self._waiting: deque[Job] = deque()
        self._running: asyncio.Task[None] | None = None

    async def run(self, function: Callable[[], T]) -> T:
        """The function's result, or its exception."""
        loop = asyncio.get_running_loop()
        future: asyncio.Future[T] = loop.create_future()
        self._waiting.append((function, future))
        if self._running is None:
            self._running = loop.create_task(self._run_waiting())
        return await future

    async def _run_waiting(self) -> None:
        loop = asyncio.get_running_loop()
        while self._waiting:
            jobs = [job for job in self._waiting if not job[1].done()]
            self._waiting.clear()
            outcomes = await loop.run_in_executor(self._pool, _outcomes, jobs)
            self._after()
            for (_, future), (result, error) in zip(jobs, outcomes, strict=True):
                if future.done():
                    continue
                if error is None:
                    future.set_result(result)
                else:
                    future.set_exception(error)
        self._running = None


def _outcomes(jobs: list[Job]) -> list[tuple[Any, Exception | None]]:
    outcomes: list[tuple[Any, Exception | None]] = []
    for function, _ in jobs:
        try:
            outcomes.append((function(), None))
        except Exception as error:  # whatever it is, it belongs to the caller
            outcomes.append((None, error))
    return outcomes
