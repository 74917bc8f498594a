"""The background scrub: every hull compared with Chan's algorithm, again and again."""

import asyncio
from collections.abc import Callable

from ..state.errors import HullNotFoundError
from .hulls import Engine
from .live_hull import LiveHull
from .verification import Verification


async def scrub(
    engine: Engine,
    cpu: float,
    pause: float,
    compared: Callable[[LiveHull, Verification], None],
    finished: Callable[[], None],
) -> None:
    """Compare one hull after the other, and begin again; a hull that is as it was is left out.

    Args:
        engine: the hulls.
        cpu: how much of one processor it may take in the long run, between 0 and 1.
        pause: seconds between two rounds.
        compared: called with each outcome.
        finished: called after each round.
    """
    seen: dict[str, int] = {}
    while True:
        before, seen = seen, {}
        for hull in engine:
            if before.get(hull.uid) == hull.counts.revision:
                seen[hull.uid] = hull.counts.revision
                continue
            try:
                counts, outcome = await hull.verify()
            except HullNotFoundError:
                continue
            seen[hull.uid] = counts.revision
            compared(hull, outcome)
            await asyncio.sleep(outcome.seconds * (1 / cpu - 1))
        finished()
        await asyncio.sleep(pause)
