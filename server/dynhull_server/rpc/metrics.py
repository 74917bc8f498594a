"""The metrics for Prometheus."""

import asyncio
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Gauge, PlatformCollector, ProcessCollector
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from ..engine.driver import Driver
from ..engine.fences import Fences
from .background import background_families
from .batch_counts import BatchCounts
from .call_counts import CallCounts
from .fence_families import fence_families
from .hull_families import HullFamilies
from .places import Unread

# Seconds, from the delay of a small batch to that of a batch that fills a message.
BUCKETS = (0.0001, 0.00025, 0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
# Seconds to wait for the event loop.
PATIENCE = 5.0


class Metrics:
    """Counters of one server, in a separate registry.

    Attributes:
        calls, batches: counts of calls and batches, which a StateCollector exports.
    """

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        PlatformCollector(registry=self.registry)
        self.calls = CallCounts(BUCKETS)
        self.batches = BatchCounts(BUCKETS)
        self._events = Counter(
            "dynhull_watch_events", "Events sent to watchers, by kind.", ["kind"], registry=self.registry
        )
        self._reads = Counter(
            "dynhull_query_reads",
            "Reads answered in Query calls, by method and status.",
            ["method", "code"],
            registry=self.registry,
        )
        self._verifications = Counter(
            "dynhull_verifications",
            "Hulls and fences compared with a recomputation, by origin of the request and outcome.",
            ["origin", "outcome"],
            registry=self.registry,
        )
        for origin in ("scrub", "call"):
            for outcome in ("equal", "different"):
                self._verifications.labels(origin, outcome)
        self._scrub_seconds = Counter(
            "dynhull_scrub_cpu_seconds", "Processor time of the background scrub.", registry=self.registry
        )
        self._scrubbed = Gauge(
            "dynhull_scrub_last_round_timestamp_seconds",
            "Time when the scrub last completed a round of all hulls.",
            registry=self.registry,
        )
        self._limits = Counter(
            "dynhull_limit_refusals",
            "Calls that a limit has refused or ended, by its name, which is that of a setting.",
            ["limit"],
            registry=self.registry,
        )
        self._watchers: dict[object, float | None] = {}

    def limited(self, limit: str) -> None:
        """Count a call that a limit has refused or ended."""
        self._limits.labels(limit).inc()

    def count_unread(self, unread: Unread) -> None:
        """Export what callers have not read."""
        help_of_bytes = "Bytes of messages of streams that were sent, and that callers have not received yet."
        Gauge("dynhull_unread_bytes", help_of_bytes, registry=self.registry).set_function(lambda: unread.total)

    def queried(self, counts: Mapping[tuple[str, str], int]) -> None:
        """Count reads of a Query call, by method and status."""
        for labels, count in counts.items():
            self._reads.labels(*labels).inc(count)

    def verified(self, origin: str, equal: bool, seconds: float = 0.0) -> None:
        """Count a verification."""
        self._verifications.labels(origin, "equal" if equal else "different").inc()
        self._scrub_seconds.inc(seconds)

    def scrub_round(self) -> None:
        """Record a completed round of the scrub."""
        self._scrubbed.set_to_current_time()

    @contextmanager
    def watcher(self) -> Iterator[object]:
        """Count a watcher during the block; yields its handle for `sending`."""
        watcher = object()
        self._watchers[watcher] = None
        try:
            yield watcher
        finally:
            del self._watchers[watcher]

    @contextmanager
    def sending(self, watcher: object, kind: str) -> Iterator[None]:
        """Count an event, and measure how long its watcher takes to receive it."""
        self._watchers[watcher] = time.monotonic()
        yield
        self._watchers[watcher] = None
        self._events.labels(kind).inc()

    def watch_families(self) -> list[GaugeMetricFamily]:
        """The watchers of now, for Prometheus."""
        now = time.monotonic()
        lag = max((now - since for since in self._watchers.values() if since is not None), default=0.0)
        help_of_lag = "Seconds since the slowest watcher was sent an event it has not received yet."
        return [
            GaugeMetricFamily("dynhull_watchers", "Watchers.", value=len(self._watchers)),
            GaugeMetricFamily("dynhull_watch_lag_seconds", help_of_lag, value=lag),
        ]


class CallCollector(Collector):
    """Collects the counts of calls and watchers on the event loop, for a process without hulls."""

    def __init__(self, metrics: Metrics, loop: asyncio.AbstractEventLoop) -> None:
        self._metrics = metrics
        self._loop = loop

    def collect(self) -> Iterator[Metric]:
        """The counts."""
        yield from _on(self._loop, lambda: [*self._metrics.calls.families(), *self._metrics.watch_families()])


class StateCollector(Collector):
    """Collects hulls, watchers and counts of calls and batches on the event loop, when called from another thread."""

    def __init__(
        self, driver: Driver, hulls: HullFamilies, fences: Fences, metrics: Metrics, loop: asyncio.AbstractEventLoop
    ) -> None:
        self._driver = driver
        self._hulls = hulls
        self._fences = fences
        self._metrics = metrics
        self._loop = loop

    def collect(self) -> Iterator[Metric]:
        """The gauges of the state, and the counts."""
        yield from asyncio.run_coroutine_threadsafe(self._hulls.look(), self._loop).result(PATIENCE)
        yield from _on(self._loop, self._counts)

    def _counts(self) -> list[Metric]:
        return [
            *self._metrics.watch_families(),
            *self._metrics.calls.families(),
            *self._metrics.batches.families(self._driver.expired),
            *background_families(self._driver.supervisor),
            *fence_families(self._fences, self._driver.time()),
        ]


def _on(loop: asyncio.AbstractEventLoop, function: Any) -> Any:
    future: Future[Any] = Future()
    loop.call_soon_threadsafe(lambda: future.set_result(function()))
    return future.result(PATIENCE)
