"""Counts of calls, used only on the event loop."""

from collections import Counter

from prometheus_client.core import CounterMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric

from .durations import Durations


class CallCounts:
    """Counts of completed calls by method and status, and a histogram of their durations by method.

    Args:
        buckets: the upper bounds of the histogram in seconds.
    """

    def __init__(self, buckets: tuple[float, ...]) -> None:
        self._bounds = buckets
        self._ended: Counter[tuple[str, str]] = Counter()
        self._took: dict[str, Durations] = {}

    def ended(self, method: str, code: str, seconds: float, calls: int = 1) -> None:
        """Count completed calls, each of this duration."""
        self._ended[method, code] += calls
        took = self._took.get(method)
        if took is None:
            took = self._took[method] = Durations(self._bounds)
        took.add(seconds, calls)

    def families(self) -> list[Metric]:
        """The metrics for Prometheus."""
        calls = CounterMetricFamily(
            "dynhull_calls", "Completed calls, by method and status.", labels=["method", "code"]
        )
        for labels, count in self._ended.items():
            calls.add_metric(labels, count)
        durations = HistogramMetricFamily(
            "dynhull_call_duration_seconds", "Seconds from the beginning of a call to its end.", labels=["method"]
        )
        for method, took in self._took.items():
            durations.add_metric([method], took.buckets(), took.seconds)
        return [calls, durations]
