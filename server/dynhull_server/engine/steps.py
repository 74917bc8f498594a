"""Large reads in short steps, one after another: after a caller disconnects, only the present step still runs."""

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import numpy as np

# Calls a function, perhaps in a thread, and returns its result.
Run = Callable[[Callable[[], Any]], Awaitable[Any]]

# The rows of a step: some milliseconds with the kernel, a tenth of a second with the Python reference.
BLOCK = 8192
# With so few rows, passing them to another thread would take a large part of the time.
FEW_ROWS = 16


# Seconds of work on the event loop before others may run.
SLICE = 0.005


class Slices:
    """Work on the event loop in slices, between which others run."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._begun = self._loop.time()

    async def others(self) -> None:
        """Let others run if the slice is over."""
        if self._loop.time() - self._begun > SLICE:
            await asyncio.sleep(0)
            self._begun = self._loop.time()


async def at_once(function: Callable[[], Any]) -> Any:
    """Call a function that is too short for another thread."""
    return function()


async def in_blocks(run: Run, question: Callable[[slice], Any], rows: int, block: int = BLOCK) -> Any:
    """The answers to a query about `rows` rows, computed block by block, as one array."""
    answers = [
        await run(partial(question, slice(first, min(first + block, rows)))) for first in range(0, max(rows, 1), block)
    ]
    return np.concatenate(answers)
