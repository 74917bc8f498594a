"""Histograms of durations, which are measured thousands of times a second: plain numbers, used on the event loop."""

from bisect import bisect_left
from itertools import accumulate

from prometheus_client.utils import INF, floatToGoString


class Durations:
    """A histogram.

    Args:
        bounds: the upper bounds of the buckets in seconds, ascending; one more bucket has no bound.

    Attributes:
        seconds: the sum of all durations.
    """

    __slots__ = ("_bounds", "_counts", "seconds")

    def __init__(self, bounds: tuple[float, ...]) -> None:
        self._bounds = bounds
        self._counts = [0] * (len(bounds) + 1)
        self.seconds = 0.0

    def add(self, seconds: float, times: int = 1) -> None:
        """Count a duration, or several equal ones."""
        self._counts[bisect_left(self._bounds, seconds)] += times
        self.seconds += seconds * times

    def buckets(self) -> list[tuple[str, float]]:
        """Each bound, as Prometheus writes it, and the number of durations up to it."""
        bounds = map(floatToGoString, (*self._bounds, INF))
        return list(zip(bounds, accumulate(self._counts), strict=True))
