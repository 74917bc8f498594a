"""The metrics of an ingest, as a page for Prometheus."""

from prometheus_client import CollectorRegistry, Counter, Gauge

from dynhull_client import Applied
from dynhull_surface.counts import COUNTS

from ..metrics_page import serve_page


class IngestFigures:
    """Counts of what the ingest has done, and how far it is behind, by feed."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()

        def counter(name: str, text: str) -> Counter:
            return Counter(f"dynhull_ingest_{name}", text, ["feed"], registry=self._registry)

        self.messages = counter("messages", "Messages read.")
        self.points = counter("points", "Points acknowledged by the server.")
        self.counts = {name: counter(name, f"Of the points, {each.meaning}.") for name, each in COUNTS.items()}
        self.bad = counter("bad", "Messages that could not be taken.")
        self.lost = counter("lost", "Messages, at most, that the broker removed before they were read.")
        self.restarts = counter("restarts", "Times that the feed began again after an error of the broker.")
        self.lag = Gauge("dynhull_ingest_lag", "Messages that are not taken.", ["feed"], registry=self._registry)

    def add(self, feed: str) -> None:
        """Show a feed from the start, not only after its first message."""
        for each in (self.messages, self.points, *self.counts.values(), self.bad, self.lost, self.restarts):
            each.labels(feed)

    def add_counts(self, feed: str, applied: Applied) -> None:
        """Add those of a batch."""
        for name, counter in self.counts.items():
            if count := getattr(applied, name):
                counter.labels(feed).inc(count)

    def serve(self, host: str, port: int) -> int:
        """Serve the page from another thread, and return its port."""
        return serve_page(self._registry, host, port)
