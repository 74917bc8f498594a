"""Waiting for a server or a broker that is away, and for the signal that ends the wait."""

import asyncio
import random
from collections.abc import Awaitable, Iterator
from datetime import UTC, datetime
from time import monotonic
from typing import TypeVar

import structlog

log = structlog.get_logger("dynhull_bridges")
SERVER_AWAY = "waiting for the server"
FIRST_GAP, LONGEST_GAP = 1.0, 30.0  # seconds
Result = TypeVar("Result")


class Absence:
    """The time for which a server or a broker has not answered. The log has it, however many ask, once in a while.

    Another kind of error is logged at once.

    Args:
        event: what the log says.
        limit: the seconds after which it is given up; None for never.
        names: what else the log says.
    """

    def __init__(self, event: str, limit: float | None = None, **names: str) -> None:
        self._event = event
        self._limit = limit
        self._names = names
        self._began: float | None = None
        self._since = ""
        self._next = self._gap = 0.0  # when the log says it again, and the seconds between
        self._logged: set[type[Exception]] = set()  # kinds of errors

    def begins(self) -> float:
        """It is asked, and has not answered; returns the time since when, on the monotonic clock."""
        if self._began is None:
            self._began = monotonic()
            self._since = datetime.now(UTC).isoformat(timespec="seconds")
            self._next, self._gap = self._began, FIRST_GAP
            self._logged.clear()
        return self._began

    def lasts(self, error: Exception, pause: float | None = None) -> None:
        """It still does not answer, which the error explains; raises the error if it has been away for too long.

        `pause` is the number of seconds until it is tried again, for the log.
        """
        now, began = monotonic(), self.begins()
        if self._limit is not None and now - began >= self._limit:
            raise error
        if now >= self._next or type(error) not in self._logged:
            self._logged.add(type(error))
            self._next, self._gap = now + self._gap, min(2 * self._gap, LONGEST_GAP)
            names = self._names if pause is None else {**self._names, "pause": round(self.pause(pause), 3)}
            log.warning(self._event, **names, since=self._since, error=str(error))

    def pause(self, pause: float) -> float:
        """The seconds until it is tried again, rather than `pause`: not beyond the limit."""
        if self._limit is None:
            return pause
        left = self._limit if self._began is None else self._began + self._limit - monotonic()
        return max(0.0, min(pause, left))

    def ends(self) -> None:
        """It answers."""
        self._began = None


async def unless(stop: asyncio.Event, awaited: Awaitable[Result]) -> Result | None:
    """What is awaited; None if `stop` is set before."""
    task = asyncio.ensure_future(awaited)
    stopping = asyncio.ensure_future(stop.wait())
    try:
        await asyncio.wait((task, stopping), return_when=asyncio.FIRST_COMPLETED)
        return task.result() if task.done() else None
    finally:
        stopping.cancel()
        if not task.done():
            task.cancel()
            await asyncio.wait((task,))


def growing_pauses(first: float, longest: float) -> Iterator[float]:
    """Seconds before each repetition: doubled each time, less a random part, so that many do not come back at once."""
    pause = first
    while True:
        yield pause * random.uniform(0.5, 1)  # noqa: S311  # no secret
        pause = min(2 * pause, longest)
