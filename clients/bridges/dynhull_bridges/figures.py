"""The metrics of a relay, as a page for Prometheus."""

import time

from prometheus_client import CollectorRegistry, Counter, Gauge

from dynhull_client import FenceConsumer

from .metrics_page import serve_page
from .sources import Source


def labels(source: Source) -> tuple[str, str]:
    """Its labels, fence and alarm, of which one is empty: to Prometheus that is none."""
    return (source.name, "") if source.kind == "fence" else ("", source.name)


class Figures:
    """Counts of what the relay has done, and how far it is behind."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        names = ["fence", "alarm"]

        def counter(name: str, text: str) -> Counter:
            return Counter(f"dynhull_relay_{name}", text, names, registry=self._registry)

        self.delivered = counter("delivered", "Events that the receiver has.")
        self.failed = counter("failed", "Deliveries that failed and are repeated.")
        self.dead = counter("dead", "Events that became dead letters.")
        self.lost = counter("lost", "Events that the server dropped before they could be delivered.")
        self._lost: float | None = None
        without = Gauge(
            "dynhull_relay_seconds_without_server",
            "How long there has been no connection to the server; 0 with one.",
            registry=self._registry,
        )
        without.set_function(lambda: self.seconds_without_server)
        self._backlog = Gauge(
            "dynhull_relay_backlog", "Events that are not acknowledged.", names, registry=self._registry
        )
        self._oldest = Gauge(
            "dynhull_relay_oldest_seconds", "Age of the oldest of them; 0 without any.", names, registry=self._registry
        )

    @property
    def seconds_without_server(self) -> float:
        """How long there has been no connection to the server; 0 with one."""
        lost = self._lost
        return 0.0 if lost is None else time.monotonic() - lost

    def note_presence(self, connected: bool) -> None:
        """Note whether there is a connection to the server."""
        self._lost = None if connected else time.monotonic()

    def add(self, source: Source) -> None:
        """Show a fence or an alarm from the start, not only after its first event."""
        for each in (self.delivered, self.failed, self.dead, self.lost):
            each.labels(*labels(source))

    def behind(self, source: Source, consumer: FenceConsumer) -> None:
        """Note what the server says about the consumer."""
        oldest = consumer.oldest
        self._backlog.labels(*labels(source)).set(consumer.backlog)
        self._oldest.labels(*labels(source)).set_function(
            lambda: 0.0 if oldest is None else max(0.0, time.time() - oldest.timestamp())
        )

    def serve(self, host: str, port: int) -> int:
        """Serve the page from another thread, and return its port."""
        return serve_page(self._registry, host, port)
