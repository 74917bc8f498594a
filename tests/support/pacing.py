"""Pauses that are input: faults and load that come at some moment, whatever the others do meanwhile.

After a pause nothing may be expected to have happened: `patience` waits for what has to.
"""

import asyncio
import time


def pause(seconds: float) -> None:
    """Let some time pass."""
    time.sleep(seconds)


async def pause_async(seconds: float) -> None:
    """Let some time pass in this task."""
    await asyncio.sleep(seconds)
