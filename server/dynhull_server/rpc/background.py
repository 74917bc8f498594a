"""Background work for Prometheus: what fails, how often, and whether it makes the server unwell."""

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric

from ..engine.supervisor import Supervisor


def background_families(supervisor: Supervisor) -> list[Metric]:
    """Of each work: its failures, and since how many seconds it has been failing."""
    failures = CounterMetricFamily(
        "dynhull_background_failures", "How often background work has failed, to be tried again.", labels=["work"]
    )
    failing = GaugeMetricFamily(
        "dynhull_background_failing_seconds",
        "For how long background work has been failing; 0 while it succeeds.",
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
