"""The supervisor: owns all background work, and makes known what fails.

A fault that passes (no descriptors, no room, an I/O error) is counted, and the work is tried again after a pause that
grows. One that lasts, or that should not be possible, makes the server unwell, with the reason in the log, until the
work succeeds again. What cannot go on at all ends the process: whoever runs it will start it again.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from ..state.errors import RefusedError, StoppingError, words
from ..storage.port import StorageError
from .threads import Clock

# Seconds that a passing fault may last.
PATIENCE = 30.0
# Seconds before work that failed is tried again, the first time and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.25, 10.0

log = logging.getLogger(__name__)


@dataclass(slots=True)
class Health:
    """How one piece of background work fares.

    Attributes:
        failures: how often it has failed.
        failing_since: when it began to fail; None while it succeeds.
        unwell: why it makes the server unwell; None where it does not.
    """

    failures: int = 0
    failing_since: float | None = None
    unwell: str | None = None


class Supervisor:
    """Runs periodic work, and hears of all other.

    Args:
        clock: time.
        changed: called when the server becomes unwell or well, with the reason or None.
        fatal: called with the reason when the process has to end.

    Attributes:
        works: how each piece of work fares.
        reason: why the server is unwell; None where it is well.
    """

    def __init__(self, clock: Clock, changed: Callable[[str | None], None], fatal: Callable[[str], None]) -> None:
        self._clock = clock
        self._changed = changed
        self._fatal = fatal
        self._tasks: list[asyncio.Task[None]] = []
        self.reason: str | None = None
        self.works: dict[str, Health] = {}

    def every(self, seconds: float, name: str, work: Callable[[], Awaitable[object]]) -> None:
        """Do some work again and again, with a rest in between."""
        self.works.setdefault(name, Health())
        task = asyncio.get_running_loop().create_task(self._repeat(seconds, name, work), name=name)
        task.add_done_callback(lambda task: self._ended(name, task))
        self._tasks.append(task)

    def failed(self, name: str, error: BaseException) -> None:
        """Some work has failed, and will be tried again."""
        health = self.works.setdefault(name, Health())
        now = self._clock.monotonic()
        health.failures += 1
        if health.failing_since is None:
            health.failing_since = now
            log.warning("background work failed", extra={"work": name, "reason": words(error)})
        if not isinstance(error, PASSING):
            log.error("background work failed; this is a bug", extra={"work": name}, exc_info=error)
        if health.unwell is None and (now - health.failing_since >= PATIENCE or not isinstance(error, PASSING)):
            health.unwell = f"{name}: {words(error)}"
            self._tell()

    def succeeded(self, name: str) -> None:
        """Some work has been done."""
        if not self.fails(name):
            return
        health = self.works[name]
        health.failing_since = health.unwell = None
        log.info("background work goes on", extra={"work": name})
        self._tell()

    def fails(self, name: str) -> bool:
        """Whether some work has failed and not yet succeeded again."""
        health = self.works.get(name)
        return health is not None and health.failing_since is not None

    def died(self, name: str, error: BaseException) -> None:
        """Some work has ended, and cannot be begun again: the process ends."""
        log.critical("background work has died: the server ends", extra={"work": name}, exc_info=error)
        self._fatal(f"{name}: {words(error)}")

    def failing_seconds(self, health: Health) -> float:
        """For how long some work has been failing; 0 while it succeeds."""
        return 0.0 if health.failing_since is None else self._clock.monotonic() - health.failing_since

    async def stop(self) -> None:
        """End the periodic work."""
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

    def _tell(self) -> None:
        reason = next((health.unwell for health in self.works.values() if health.unwell is not None), None)
        if reason == self.reason:
            return
        self.reason = reason
        if reason is None:
            log.warning("well again")
        else:
            log.error("unwell: health is NOT_SERVING", extra={"reason": reason})
        self._changed(reason)


PASSING = (OSError, StorageError, RefusedError, MemoryError)
