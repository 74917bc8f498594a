"""Metrics of the background work: its failures, and whether they make the server unhealthy."""

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric

from ..engine.supervisor import Supervisor


def background_families(supervisor: Supervisor) -> list[Metric]:
    """For each kind of work: the number of failures, and the seconds since it began to fail."""
    failures = CounterMetricFamily(
        "dynhull_background_failures", "Failures of background work, which is retried.", labels=["work"]
    )
    failing = GaugeMetricFamily(
        "dynhull_background_failing_seconds",
        "Seconds since background work began to fail; 0 while it succeeds.",
        labels=["work"],
    )
    unwell = GaugeMetricFamily(
        "dynhull_background_unwell", "1 where background work makes the server NOT_SERVING.", labels=["work"]
    )
    for name, health in supervisor.works.items():
        failures.add_metric([name], health.failures)
        failing.add_metric([name], supervisor.failing_seconds(health))
        unwell.add_metric([name], health.unwell is not None)
    return [failures, failing, unwell]
