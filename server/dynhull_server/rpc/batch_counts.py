"""Counts of batches, used only on the event loop."""

from prometheus_client.core import CounterMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric

from ..state.batch import Applied
from .durations import Durations


class BatchCounts:
    """Counts of batches and their rows, and a histogram of their delays.

    Args:
        buckets: the upper bounds in seconds; one more bucket has no bound.
    """

    def __init__(self, buckets: tuple[float, ...]) -> None:
        self._took = Durations(buckets)
        self._applied = self._duplicate = self._refused = 0
        self._inserted = self._deleted = self._missing = 0
        self._updates = dict.fromkeys(("move", "evict", "expire"), 0)
        self._quarantined = dict.fromkeys(("held", "released", "dropped"), 0)
        self._rows = dict.fromkeys(("stale", "late", "skipped", "clamped"), 0)

    def applied(self, applied: Applied, seconds: float) -> None:
        """Count a batch that was applied `seconds` after its arrival."""
        self._took.add(seconds)
        if applied.duplicate:
            self._duplicate += 1
            return
        self._applied += 1
        self._inserted += applied.inserted
        self._deleted += applied.deleted
        self._missing += applied.missing
        if not applied.plain:
            self._count_more(applied)

    def _count_more(self, applied: Applied) -> None:
        """Count what only hulls with keys or times do."""
        self._updates["move"] += applied.moved
        self._updates["evict"] += applied.evicted
        self._updates["expire"] += applied.expired
        self._rows["stale"] += applied.stale
        self._rows["late"] += applied.late
        self._rows["skipped"] += applied.skipped
        self._rows["clamped"] += applied.clamped
        if applied.held or applied.released or applied.dropped:
            self._quarantined["held"] += len(applied.held)
            self._quarantined["released"] += applied.released
            self._quarantined["dropped"] += applied.dropped

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
        quarantined = CounterMetricFamily(
            "dynhull_quarantine",
            "Positions held in quarantine; keys that left it, as released or dropped.",
            labels=["outcome"],
        )
        for outcome, count in self._quarantined.items():
            quarantined.add_metric([outcome], count)
        durations = HistogramMetricFamily(
            "dynhull_batch_duration_seconds", "Seconds from the arrival of a batch until its acknowledgement is ready."
        )
        durations.add_metric([], self._took.buckets(), self._took.seconds)
        return [batches, updates, rows, quarantined, durations]
