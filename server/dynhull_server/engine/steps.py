"""Large reads in short steps, one after the other: a caller that goes costs no more than the step under way."""

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import numpy as np

# Calls a function somewhere, and has what it returns.
Run = Callable[[Callable[[], Any]], Awaitable[Any]]

# So many rows make a step: some milliseconds where the kernel answers, a tenth of a second where Python does.
BLOCK = 8192
# With so few the trip to another thread would be a good part of the time.
FEW_ROWS = 16


async def at_once(function: Callable[[], Any]) -> Any:
    """What a function returns that is too short for a trip to another thread."""
    return function()


async def in_blocks(run: Run, question: Callable[[slice], Any], rows: int, block: int = BLOCK) -> Any:
    """The answers to a question about so many rows, asked a block of rows at a time, in one array."""
    answers = [
        await run(partial(question, slice(first, min(first + block, rows)))) for first in range(0, max(rows, 1), block)
    ]
    return np.concatenate(answers)
