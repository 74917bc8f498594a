"""State shared by all viewers: one connection to the server, and one watch per hull on view."""

import asyncio
from collections import Counter

from dynhull_client import AsyncHullClient

from .feed import HullFeed
from .server_metrics import ServerMetrics
from .server_state import ServerState
from .units import NO_UNITS, Units


class Hub:
    """The feeds, by hull.

    Args:
        client: the connection.
        prefix: only hulls whose names begin with it can be picked.
        metrics_url: the server's metrics page for Prometheus; None for none.
        units: the units of the coordinates.
    """

    def __init__(
        self, client: AsyncHullClient, prefix: str = "", metrics_url: str | None = None, units: Units = NO_UNITS
    ) -> None:
        self.address = client.address
        self.units = units
        self.server = ServerState(client, prefix)
        self.metrics = None if metrics_url is None else ServerMetrics(metrics_url)
        self._client = client
        self._feeds: dict[str, HullFeed] = {}
        self._viewers: Counter[str] = Counter()
        self._closing: set[asyncio.Task[None]] = set()

    def open_feed(self, name: str) -> HullFeed:
        """The feed of a hull, shared with its other viewers. Release it once for each call."""
        if name not in self._feeds:
            self._feeds[name] = HullFeed(self._client, name)
        self._viewers[name] += 1
        return self._feeds[name]

    def release_feed(self, name: str) -> None:
        """End one viewer's use of a feed; the last one closes it."""
        self._viewers[name] -= 1
        if not self._viewers[name]:
            task = asyncio.create_task(self._feeds.pop(name).close())
            self._closing.add(task)
            task.add_done_callback(self._closing.discard)

    async def close(self) -> None:
        """Stop all background tasks."""
        await asyncio.gather(self.server.close(), *(feed.close() for feed in self._feeds.values()), *self._closing)
        if self.metrics is not None:
            await self.metrics.close()
