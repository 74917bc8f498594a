"""The background scrub: compares every hull with Chan's algorithm, repeatedly."""

from collections.abc import Callable

from ..state.errors import HullNotFoundError
from .engine import Engine
from .live_hull import LiveHull
from .threads import Clock
from .verification import Verification


class Scrub:
    """Compares one hull after another, except those unchanged since the previous round.

    Args:
        engine: the hulls.
        clock: the time.
        cpu: the share of one processor it may use on average, between 0 and 1.
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
