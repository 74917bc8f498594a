"""The background scrub: every hull compared with Chan's algorithm, again and again."""

from collections.abc import Callable

from ..state.errors import HullNotFoundError
from .engine import Engine
from .live_hull import LiveHull
from .threads import Clock
from .verification import Verification


class Scrub:
    """Compares one hull after the other; a hull that is as it was in the round before is left out.

    Args:
        engine: the hulls.
        clock: time.
        cpu: how much of one processor it may take in the long run, between 0 and 1.
        compared: called with each outcome.
    """

    def __init__(
        self, engine: Engine, clock: Clock, cpu: float, compared: Callable[[LiveHull, Verification], None]
    ) -> None:
        self._engine = engine
        self._clock = clock
        self._cpu = cpu
        self._compared = compared
        self._seen: dict[str, int] = {}

    async def round(self) -> None:
        """Compare every hull."""
        before, seen = self._seen, {}
        for hull in self._engine:
            if before.get(hull.uid) == hull.counts.revision:
                seen[hull.uid] = hull.counts.revision
                continue
            try:
                counts, outcome = await hull.verify()
            except HullNotFoundError:
                continue
            seen[hull.uid] = counts.revision
            self._compared(hull, outcome)
            await self._clock.sleep(outcome.seconds * (1 / self._cpu - 1))
        self._seen = seen
