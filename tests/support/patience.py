"""Waiting for a condition, with a time limit."""

import asyncio
import time
from collections.abc import Callable

PATIENCE = 120  # seconds: many times what anything takes beside other programs
LONGEST_PAUSE = 0.05  # seconds: conditions may be calls, and take processor time from what they wait for


def wait_until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    pause = 0.001
    while not condition():
        assert time.monotonic() < end, f"not within {PATIENCE} s"
        time.sleep(pause)
        pause = min(1.5 * pause, LONGEST_PAUSE)


async def until(condition: Callable[[], object]) -> None:
    """The same for a task."""
    async with asyncio.timeout(PATIENCE):
        while not condition():
            await asyncio.sleep(0.01)
