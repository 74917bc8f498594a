"""What all viewers share: one connection to the server, one watch for each hull that somebody looks at."""

import asyncio
from collections import Counter

from dynhull_client import AsyncHullClient

from .feed import HullFeed
from .server_metrics import ServerMetrics
from .server_state import ServerState


class Hub:
    """Feeds by hull, shared.

    Args:
        client: the connection.
        prefix: only hulls whose names begin so can be picked.
        metrics_url: the server's page for Prometheus; None for none.
    """

    def __init__(self, client: AsyncHullClient, prefix: str = "", metrics_url: str | None = None) -> None:
        self.address = client.address
        self.server = ServerState(client, prefix)
        self.metrics = None if metrics_url is None else ServerMetrics(metrics_url)
        self._client = client
        self._feeds: dict[str, HullFeed] = {}
        self._viewers: Counter[str] = Counter()
        self._closing: set[asyncio.Task[None]] = set()

    def look(self, name: str) -> HullFeed:
        """The feed of a hull, for one more viewer."""
        if name not in self._feeds:
            self._feeds[name] = HullFeed(self._client, name)
        self._viewers[name] += 1
        return self._feeds[name]

    def look_away(self, name: str) -> None:
        """One viewer fewer; the feed ends with the last."""
        self._viewers[name] -= 1
        if not self._viewers[name]:
            task = asyncio.create_task(self._feeds.pop(name).close())
            self._closing.add(task)
            task.add_done_callback(self._closing.discard)

    async def close(self) -> None:
        """End all that runs."""
        await asyncio.gather(self.server.close(), *(feed.close() for feed in self._feeds.values()), *self._closing)
        if self.metrics is not None:
            await self.metrics.close()
