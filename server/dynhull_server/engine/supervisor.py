"""The supervisor: owns all background work, and reports its failures.

A transient failure (no file descriptors, a full disk, an I/O error) is counted, and the work is retried after a growing
pause. A failure that lasts, or that indicates a bug, makes the server unhealthy until the work succeeds again; the log
has the reason. A failure that cannot be retried ends the process, so that the service manager restarts it.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from ..state.errors import OutcomeUnknownError, RefusedError, StoppingError, words
from ..storage.port import StorageError
from .threads import Clock

# Seconds that a transient failure may last.
PATIENCE = 30.0
# Seconds before failed work is retried: at first, and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.25, 10.0

log = logging.getLogger(__name__)


@dataclass(slots=True)
class WorkHealth:
    """The health of one kind of background work.

    Attributes:
        failures: the number of failures.
        failing_since: the time of the first failure since the last success; None while it succeeds.
        unwell: the reason why it makes the server unhealthy; None where it does not.
    """

    failures: int = 0
    failing_since: float | None = None
    unwell: str | None = None


class Supervisor:
    """Runs periodic work, and receives the failures of other background work.

    Args:
        clock: the time.
        changed: called with the reason when the server becomes unhealthy, and with None when it is healthy again.
        fatal: called with the reason when the process must end.

    Attributes:
        works: the health of each kind of work.
        reason: why the server is unhealthy; None where it is healthy.
    """

    def __init__(self, clock: Clock, changed: Callable[[str | None], None], fatal: Callable[[str], None]) -> None:
        self._clock = clock
        self._changed = changed
        self._fatal = fatal
        self._tasks: list[asyncio.Task[None]] = []
        self.reason: str | None = None
        self.works: dict[str, WorkHealth] = {}

    def every(self, seconds: float, name: str, work: Callable[[], Awaitable[object]]) -> None:
        """Repeat some work, with a pause in between."""
        self.works.setdefault(name, WorkHealth())
        task = asyncio.get_running_loop().create_task(self._repeat(seconds, name, work), name=name)
        task.add_done_callback(lambda task: self._ended(name, task))
        self._tasks.append(task)

    def failed(self, name: str, error: BaseException) -> None:
        """Record a failure of work that will be retried."""
        health = self.works.setdefault(name, WorkHealth())
        now = self._clock.monotonic()
        health.failures += 1
        if health.failing_since is None:
            health.failing_since = now
            log.warning("background work failed", extra={"work": name, "reason": words(error)})
        if not isinstance(error, TRANSIENT):
            log.error("background work failed; this is a bug", extra={"work": name}, exc_info=error)
        if health.unwell is None and (now - health.failing_since >= PATIENCE or not isinstance(error, TRANSIENT)):
            health.unwell = f"{name}: {words(error)}"
            self._update_reason()

    def succeeded(self, name: str) -> None:
        """Record a success."""
        if not self.fails(name):
            return
        health = self.works[name]
        health.failing_since = health.unwell = None
        log.info("background work succeeds again", extra={"work": name})
        self._update_reason()

    def fails(self, name: str) -> bool:
        """Whether some work has failed and not succeeded since."""
        health = self.works.get(name)
        return health is not None and health.failing_since is not None

    def died(self, name: str, error: BaseException) -> None:
        """End the process, because work has failed that cannot be retried."""
        log.critical("background work has died: the server stops", extra={"work": name}, exc_info=error)
        self._fatal(f"{name}: {words(error)}")

    def failing_seconds(self, health: WorkHealth) -> float:
        """The seconds since work began to fail; 0 while it succeeds."""
        return 0.0 if health.failing_since is None else self._clock.monotonic() - health.failing_since

    async def stop(self) -> None:
        """Stop the periodic work."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _repeat(self, seconds: float, name: str, work: Callable[[], Awaitable[object]]) -> None:
        pause = FIRST_PAUSE
        while True:
            try:
                await work()
            except StoppingError:
                return
            except Exception as error:
                self.failed(name, error)
                await self._clock.sleep(max(seconds, pause))
                pause = min(2 * pause, LONGEST_PAUSE)
                continue
            pause = FIRST_PAUSE
            self.succeeded(name)
            await self._clock.sleep(seconds)

    def _ended(self, name: str, task: "asyncio.Task[None]") -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            self.died(name, error)

    def _update_reason(self) -> None:
        reason = next((health.unwell for health in self.works.values() if health.unwell is not None), None)
        if reason == self.reason:
            return
        self.reason = reason
        if reason is None:
            log.warning("healthy again: health is SERVING")
        else:
            log.error("unhealthy: health is NOT_SERVING", extra={"reason": reason})
        self._changed(reason)


TRANSIENT = (OSError, StorageError, RefusedError, OutcomeUnknownError, MemoryError)
