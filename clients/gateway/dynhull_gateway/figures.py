"""The metrics of a gateway, as a page for Prometheus."""

from collections import Counter as Tally
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from time import perf_counter

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, start_http_server
from starlette.types import ASGIApp, Message, Receive, Scope, Send

UNKNOWN = "unknown"
SHORT = "dynhull.route"  # of requests that are answered before the framework has found a route


class Figures:
    """Counts of what the gateway has answered, and what it is doing."""

    def __init__(self) -> None:
        self._registry = registry = CollectorRegistry()
        route = ["method", "route"]
        self.requests = Counter(
            "dynhull_gateway_requests", "Requests that were answered.", [*route, "status"], registry=registry
        )
        self.seconds = Histogram(
            "dynhull_gateway_request_seconds",
            "Time from a request to the end of its answer; streams of events are left out.",
            route,
            registry=registry,
        )
        self.rows = Counter("dynhull_gateway_rows", "Rows of bodies that were applied.", registry=registry)
        self.open_streams = 0
        streams = Gauge(
            "dynhull_gateway_streams",
            "Streams of events that are open, those that are joined to one included.",
            registry=registry,
        )
        streams.set_function(lambda: self.open_streams)
        self.refused_streams = Counter(
            "dynhull_gateway_refused_streams",
            "Streams that a limit has refused, by its name.",
            ["limit"],
            registry=registry,
        )
        self.many_streams: Tally[str] = Tally()
        self.waiting_bytes = 0
        waiting = Gauge(
            "dynhull_gateway_waiting_bytes",
            "Bytes of events that wait for their readers; those that wait for many readers are held once.",
            registry=registry,
        )
        waiting.set_function(lambda: self.waiting_bytes)
        self.events = Counter("dynhull_gateway_events", "Events that were sent.", registry=registry)
        self.skipped = Counter(
            "dynhull_gateway_snapshots_for_slow_readers",
            "Snapshots sent in place of changes that a reader was too slow for.",
            registry=registry,
        )
        self.late_heads = Counter(
            "dynhull_gateway_late_requests",
            "Connections that were closed because no complete request came in time.",
            registry=registry,
        )
        self.deaf_readers = Counter(
            "dynhull_gateway_deaf_readers",
            "Connections that were closed because nothing was read of what waited for the caller.",
            registry=registry,
        )

    @contextmanager
    def stream(self) -> Iterator[None]:
        """Count an open stream of events during the block."""
        self.open_streams += 1
        try:
            yield
        finally:
            self.open_streams -= 1

    @contextmanager
    def many_stream(self, caller: str) -> Iterator[None]:
        """Count a stream of many hulls of a caller during the block."""
        self.many_streams[caller] += 1
        try:
            yield
        finally:
            self.many_streams[caller] -= 1
            if not self.many_streams[caller]:
                del self.many_streams[caller]

    def serve(self, host: str, port: int) -> int:
        """Serve the page from another thread, and return its port."""
        server, _ = start_http_server(port, host, self._registry)
        return int(server.server_port)


class Measured:
    """Counts requests by route, method and status."""

    def __init__(self, app: ASGIApp, figures: Figures) -> None:
        self._app = app
        # Finding the figures of a route takes as long as counting.
        self._of = lru_cache(1024)(
            lambda method, route, status: (
                figures.requests.labels(method, route, status),
                figures.seconds.labels(method, route),
            )
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and count its answer."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        begun, status, streamed = perf_counter(), 0, False

        async def noting(message: Message) -> None:
            nonlocal status, streamed
            if message["type"] == "http.response.start":
                status = message["status"]
                streamed = (b"content-type", b"text/event-stream; charset=utf-8") in message["headers"]
            await send(message)

        try:
            await self._app(scope, receive, noting)
        finally:
            route = getattr(scope.get("route"), "path", scope.get(SHORT, UNKNOWN))
            requests, seconds = self._of(scope["method"], route, status)
            requests.inc()
            if not streamed:
                seconds.observe(perf_counter() - begun)
