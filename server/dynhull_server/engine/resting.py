"""Lets the points of hulls that nobody uses take less memory."""

from collections.abc import Callable, Iterable

from ..state.hull import Hull
from .steps import Slices


class Resting:
    """Looks at all hulls now and then.

    Args:
        hulls: returns the hulls.
    """

    SECONDS = 10.0

    def __init__(self, hulls: Callable[[], Iterable[Hull]]) -> None:
        self._hulls = hulls

    async def round(self) -> None:
        """Put away the points of small hulls that nobody has used since the last round."""
        slices = Slices()
        for hull in list(self._hulls()):
            hull.put_away()
            await slices.others()
