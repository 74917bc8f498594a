"""Counts of batches. Thousands arrive per second, so the counts are plain numbers, used only on the event loop."""

from bisect import bisect_left
from itertools import accumulate

from prometheus_client.core import CounterMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.utils import INF, floatToGoString

from ..state.batch import Applied


class BatchCounts:
    """Counts of batches and their rows, and a histogram of their delays.

    Args:
        buckets: the upper bounds in seconds; one more bucket has no bound.
    """

    def __init__(self, buckets: tuple[float, ...]) -> None:
        self._bounds = buckets
        self._took = [0] * (len(buckets) + 1)
        self._seconds = 0.0
        self._applied = self._duplicate = self._refused = 0
        self._inserted = self._deleted = self._missing = 0
        self._updates = dict.fromkeys(("move", "evict", "expire"), 0)
        self._rows = dict.fromkeys(("stale", "late", "skipped", "clamped"), 0)

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
        if applied.moved or applied.clock is not None or applied.stale or applied.skipped:
            self._count_entities(applied)

    def _count_entities(self, applied: Applied) -> None:
        """Count what only hulls with keys or times do."""
        self._updates["move"] += applied.moved
        self._updates["evict"] += applied.evicted
        self._updates["expire"] += applied.expired
        self._rows["stale"] += applied.stale
        self._rows["late"] += applied.late
        self._rows["skipped"] += applied.skipped
        self._rows["clamped"] += applied.clamped

    def refused(self) -> None:
        """Count a refused batch."""
        self._refused += 1

    def families(self, expired: int) -> list[Metric]:
        """The metrics for Prometheus; `expired` is the number of points that left by the server's clock."""
        batches = CounterMetricFamily("dynhull_batches", "Batches, by outcome.", labels=["outcome"])
        for outcome, count in (
            ("applied", self._applied),
            ("duplicate", self._duplicate),
            ("refused", self._refused),
        ):
            batches.add_metric([outcome], count)
        updates = CounterMetricFamily(
            "dynhull_updates",
            "Points inserted, deleted, moved by their keys, evicted and expired; deletes of missing points.",
            labels=["operation"],
        )
        plain = {"insert": self._inserted, "delete": self._deleted, "missing": self._missing}
        for operation, count in (plain | self._updates).items():
            updates.add_metric([operation], count + (expired if operation == "expire" else 0))
        rows = CounterMetricFamily(
            "dynhull_rows",
            "Rows of batches that changed nothing, as stale, late or skipped, or whose event time was clamped.",
            labels=["outcome"],
        )
        for outcome, count in self._rows.items():
            rows.add_metric([outcome], count)
        durations = HistogramMetricFamily(
            "dynhull_batch_duration_seconds", "Seconds from the arrival of a batch until its acknowledgement is ready."
        )
        bounds = map(floatToGoString, (*self._bounds, INF))
        durations.add_metric([], list(zip(bounds, accumulate(self._took), strict=True)), self._seconds)
        return [batches, updates, rows, durations]
