"""Work on one hull, in order: small work at once, the rest off the event loop; what it wrote, committed before told."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any, TypeVar

T = TypeVar("T")
Outcome = tuple[Any, Exception | None]


@dataclass(frozen=True, slots=True)
class Job:
    """Work to do, and whom to tell."""

    function: Callable[[], Any]
    done: Callable[[Any, Exception | None], None]
    writes: bool


class SerialExecutor:
    """Runs functions one at a time and in the order they came. To be used on one event loop.

    A small function runs at once where nothing is under way: the trip to another thread would take longer. Everything
    else goes to a pool of threads, and whatever waits when the pool is ready goes there in one trip. Nobody is told
    anything before the trip is committed: so batches that come during one commit share the next, and no reader sees
    what a power failure could take back.

    Args:
        pool: where the functions run.
        commit: called after each trip, in its thread; what to wait for before anybody is told, None for nothing.
        roll_back: called in a thread of the pool where a commit failed. Writes are told the exception it returns, reads
            run again.
        after: called on the event loop whenever something has run and is committed, before its callers are told.
    """

    def __init__(
        self,
        pool: Executor,
        commit: Callable[[], Future[None] | None],
        roll_back: Callable[[BaseException], Exception],
        after: Callable[[], None],
    ) -> None:
        self._pool = pool
        self._commit = commit
        self._roll_back = roll_back
        self._after = after
        self._waiting: list[Job] = []
        self._busy = False
        self._stopped = False

    def stop(self) -> None:
        """Begin nothing more. What runs is committed; whoever waits behind it is gone, or hears of nothing."""
        self._stopped = True

    def submit(
        self,
        function: Callable[[], T],
        done: Callable[[Any, Exception | None], None],
        *,
        small: bool,
        writes: bool = False,
    ) -> None:
        """Call `function`, and `done` with its result or its exception, on the event loop."""
        if small and not self._busy:
            outcome = _outcome(function)
            pending = self._commit()
            if pending is None:
                self._after()
                done(*outcome)
                return
            self._busy = True
            self._await(asyncio.get_running_loop(), [Job(function, done, writes)], [outcome], pending)
            return
        self._waiting.append(Job(function, done, writes))
        if not self._busy:
            self._busy = True
            self._start_trip(asyncio.get_running_loop())

    async def run(self, function: Callable[[], T], *, small: bool, writes: bool = False) -> T:
        """The function's result, or its exception. A caller that is cancelled stops waiting, its function runs."""
        if small and not writes and not self._busy:
            return function()  # nothing to commit, nobody to tell
        future: asyncio.Future[T] = asyncio.get_running_loop().create_future()

        def done(result: T, error: Exception | None) -> None:
            if future.done():
                return
            if error is None:
                future.set_result(result)
            else:
                future.set_exception(error)

        self.submit(function, done, small=small, writes=writes)
        return await future

    def _start_trip(self, loop: asyncio.AbstractEventLoop) -> None:
        jobs, self._waiting = self._waiting, []

        def trip() -> None:
            outcomes = [_outcome(job.function) for job in jobs]
            pending = self._commit()
            if pending is None:
                loop.call_soon_threadsafe(self._end_trip, loop, jobs, outcomes)
            else:
                self._await(loop, jobs, outcomes, pending)

        self._pool.submit(trip)

    def _await(
        self, loop: asyncio.AbstractEventLoop, jobs: list[Job], outcomes: list[Outcome], pending: Future[None]
    ) -> None:
        def committed(pending: Future[None]) -> None:
            failure = pending.exception()
            if failure is None:
                loop.call_soon_threadsafe(self._end_trip, loop, jobs, outcomes)
            elif not self._stopped:
                self._pool.submit(self._retreat, loop, jobs, failure)

        pending.add_done_callback(committed)

    def _retreat(self, loop: asyncio.AbstractEventLoop, jobs: list[Job], failure: BaseException) -> None:
        error = self._roll_back(failure)
        outcomes = [(None, error) if job.writes else _outcome(job.function) for job in jobs]
        loop.call_soon_threadsafe(self._end_trip, loop, jobs, outcomes)

    def _end_trip(self, loop: asyncio.AbstractEventLoop, jobs: list[Job], outcomes: list[Outcome]) -> None:
        self._after()
        if self._waiting and not self._stopped:
            self._start_trip(loop)
        else:
            self._busy = False
        for job, outcome in zip(jobs, outcomes, strict=True):
            job.done(*outcome)


def _outcome(function: Callable[[], Any]) -> Outcome:
    try:
        return function(), None
    except Exception as error:  # whatever it is, it belongs to the caller
        return None, error
