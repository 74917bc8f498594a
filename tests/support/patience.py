"""Waiting for a condition, with a time limit."""

import asyncio
import sys
import threading
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


def waits(thread: threading.Thread) -> bool:
    """Whether a thread waits for a condition or an event, so that only another one can let it go on."""
    frame = sys._current_frames().get(thread.ident or 0)
    return frame is not None and (frame.f_code.co_filename, frame.f_code.co_name) == (threading.__file__, "wait")


async def turns(count: int = 10) -> None:
    """Let the other tasks of the loop go on until they wait for something from outside of it."""
    for _ in range(count):
        await asyncio.sleep(0)
