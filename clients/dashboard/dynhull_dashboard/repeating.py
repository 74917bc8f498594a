"""Work that is repeated in the background."""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable

from dynhull_client import DynhullError

# What is repeated costs the server time, some of it in proportion to the points. A pause of this many times its
# duration keeps it below a twentieth of that time.
PAUSE_FACTOR = 19
# After one long delay the figures must not stand still: no pause is longer than this many of the least ones.
LONGEST_PAUSE = 5

log = logging.getLogger(__name__)


async def repeat(
    name: str, work: Callable[[], Awaitable[None]], pause: Callable[[], float], at_once: asyncio.Event | None = None
) -> None:
    """Repeat `work` with a pause in between, longer after work that took long; setting `at_once` ends the pause.

    The pause is `PAUSE_FACTOR` times the duration of the work, but at most `LONGEST_PAUSE` times the least pause.

    Args:
        name: what the work is about, for the log.
        work: may raise DynhullError, which is logged: the watch fails for the same reason, which the page shows.
        pause: the least pause, in seconds.
        at_once: cleared before the work begins.
    """
    at_once = at_once or asyncio.Event()
    while True:
        begun = time.monotonic()
        try:
            await work()
        except DynhullError as error:
            log.info("%s: %s", name, error)
        took = time.monotonic() - begun
        try:
            # Not asyncio.wait_for: up to Python 3.11 it loses a cancellation that comes with what it waits for.
            async with asyncio.timeout(pause_after(took, pause())):
                await at_once.wait()
        except TimeoutError:
            continue
        at_once.clear()


def pause_after(took: float, least: float) -> float:
    """The pause after work of that duration, in seconds."""
    return min(max(least, PAUSE_FACTOR * took), LONGEST_PAUSE * least)
