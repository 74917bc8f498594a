"""Counts of batches. Thousands arrive per second, so the counts are plain numbers, used only on the event loop."""

from bisect import bisect_left
from itertools import accumulate

from prometheus_client.core import CounterMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.utils import INF, floatToGoString

from ..state.batch import Applied


class BatchCounts:
    """Counts of batches and their points, and a histogram of their delays.

    Args:
        buckets: the upper bounds in seconds; one more bucket has no bound.
    """

    def __init__(self, buckets: tuple[float, ...]) -> None:
        self._bounds = buckets
        self._took = [0] * (len(buckets) + 1)
        self._seconds = 0.0
        self._applied = self._duplicate = self._refused = 0
        self._inserted = self._deleted = self._missing = 0

    def applied(self, applied: Applied, seconds: float) -> None:
        """Count a batch that was applied `seconds` after its arrival."""
        self._took[bisect_left(self._bounds, seconds)] += 1
        self._seconds += seconds
        if applied.duplicate:
            self._duplicate += 1
            return
        self._applied += 1
        self._inserted += applied.inserted
        self._deleted += applied.deleted
        self._missing += applied.missing

    def refused(self) -> None:
        """Count a refused batch."""
        self._refused += 1

    def families(self) -> list[Metric]:
        """The metrics for Prometheus."""
        batches = CounterMetricFamily("dynhull_batches", "Batches, by outcome.", labels=["outcome"])
        for outcome, count in (
            ("applied", self._applied),
            ("duplicate", self._duplicate),
            ("refused", self._refused),
        ):
            batches.add_metric([outcome], count)
        updates = CounterMetricFamily("dynhull_updates", "Points inserted and deleted.", labels=["operation"])
        for operation, count in (("insert", self._inserted), ("delete", self._deleted), ("missing", self._missing)):
            updates.add_metric([operation], count)
        durations = HistogramMetricFamily(
            "dynhull_batch_duration_seconds", "Seconds from the arrival of a batch until its acknowledgement is ready."
        )
        bounds = map(floatToGoString, (*self._bounds, INF))
        durations.add_metric([], list(zip(bounds, accumulate(self._took), strict=True)), self._seconds)
        return [batches, updates, durations]
