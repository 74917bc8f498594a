"""The background scrub: compares every hull with Chan's algorithm, and every fence with a recomputation, repeatedly."""

from collections.abc import Callable
from typing import Any

from ..state.errors import FenceNotFoundError, HullNotFoundError
from .driver import Driver
from .fence_verification import FenceVerification, verify_events
from .fences import Fences, LiveFence
from .hulls import Hulls
from .live_hull import LiveHull
from .verification import Verification


class Scrub:
    """Compares one hull after another, and one fence after another, except those unchanged since the previous round.

    Args:
        driver: drives the core that has the hulls and fences.
        hulls: the hulls.
        fences: the fences.
        cpu: the share of one processor it may use on average, between 0 and 1.
        compared: called with each outcome.
        followed: called with the outcome of each comparison of a fence's events.
    """

    def __init__(
        self,
        driver: Driver,
        hulls: Hulls,
        fences: Fences,
        cpu: float,
        compared: Callable[[LiveHull, Verification], None],
        followed: Callable[[LiveFence, FenceVerification], None],
    ) -> None:
        self._driver = driver
        self._hulls = hulls
        self._fences = fences
        self._cpu = cpu
        self._compared = compared
        self._followed = followed
        self._seen: dict[str, Any] = {}
        self._known: dict[str, FenceVerification] = {}

    async def round(self) -> None:
        """Compare every hull, then the events of every fence."""
        before, seen = self._seen, {}
        for hull in self._hulls:
            state = _state(hull)
            if before.get(hull.uid) != state:
                try:
                    _, outcome = await hull.verify(events=False)
                except HullNotFoundError:
                    continue
                self._compared(hull, outcome)
                await self._rest(outcome.seconds)
            seen[hull.uid] = state
        self._seen = seen
        await self._follow()

    async def _follow(self) -> None:
        known, seen = self._known, {}
        for fence in self._fences.all():
            before = known.get(fence.uid)
            if before is not None and before.last == fence.fence.last:
                seen[fence.uid] = before
                continue
            try:
                outcome = await verify_events(fence, self._driver.aside, before)
            except FenceNotFoundError:
                continue
            seen[fence.uid] = outcome
            self._followed(fence, outcome)
            await self._rest(outcome.seconds)
        self._known = seen

    async def _rest(self, seconds: float) -> None:
        await self._driver.machine.clock.sleep(seconds * (1 / self._cpu - 1))


def _state(hull: LiveHull) -> Any:
    """Differs if the hull may have changed, or what fences have about it."""
    fences = hull.fences()
    areas = [None if each.area is None else each.area.counts.revision for each in fences]
    return hull.counts.revision, [each.row for each in fences], [each.last for each in fences], areas
