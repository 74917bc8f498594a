"""The start of what serves, which waits for a storage that is not ready."""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Protocol, TypeVar

from .state.errors import words
from .storage.port import StorageError
from .storage.refusals import Meaning

# Seconds before the next attempt: at first, and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.25, 10.0

log = logging.getLogger(__name__)


class Drained(Protocol):
    """Serves until `drain` has returned."""

    async def drain(self) -> None:
        """End the calls in progress, and stop; also after a start that has failed."""


Served = TypeVar("Served", bound=Drained)


async def started(
    make: Callable[[], Awaitable[Served]],
    start: Callable[[Served], Awaitable[None]],
    stop: asyncio.Event,
    patience: float,
) -> Served | None:
    """What `make` returns, once it has started; None if `stop` is set before.

    While the storage refuses in a way that passes, another one is made and started, after growing pauses.

    Args:
        make: makes what is to serve.
        start: starts it.
        stop: ends the wait.
        patience: the seconds for which it may refuse in a way that may be final.

    Raises:
        StorageError: the storage refuses for good.
    """
    pause = FIRST_PAUSE
    doubted: float | None = None  # since when
    while not stop.is_set():
        try:
            made = await make()
            try:
                await start(made)
            except BaseException:
                await made.drain()
                raise
            return made
        except StorageError as error:
            seconds = pause
            if error.meaning is Meaning.DOUBTFUL:
                now = time.monotonic()
                doubted = doubted or now
                seconds = min(pause, doubted + patience - now)
            else:
                doubted = None
            if error.meaning is Meaning.FINAL or seconds <= 0:
                raise
            log.warning("cannot serve yet", extra={"reason": words(error), "pause": round(seconds, 3)})
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await stop.wait()
        pause = min(2 * pause, LONGEST_PAUSE)
    return None
