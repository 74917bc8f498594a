"""State shared by all viewers: one connection to the server, and one watch per hull and fence on view."""

import asyncio
from functools import partial

from dynhull_client import AsyncHullClient

from .alarm_list import AlarmList
from .feed import HullFeed
from .feeds import Feeds
from .fence_feed import FenceFeed
from .many_feed import ManyFeed
from .outliers import OutlierFeed
from .server_lists import FenceList, HullList
from .server_metrics import ServerMetrics
from .units import NO_UNITS, Units


class Hub:
    """The feeds, by hull and by fence.

    Args:
        client: the connection.
        prefix: only hulls and fences whose names begin with it can be picked.
        metrics_url: the server's metrics page for Prometheus; None for none.
        units: the units of the coordinates.

    Attributes:
        client: the connection.
        hull_list: the server's hulls.
        fence_list: the server's fences.
        alarms: the server's alarms.
        hulls: the feeds of the hulls on view.
        fences: the feeds of the fences on view.
        many: the feeds of all hulls of a prefix.
        outliers: the feeds of the outliers of hulls, for those viewers that look at them.
    """

    def __init__(
        self, client: AsyncHullClient, prefix: str = "", metrics_url: str | None = None, units: Units = NO_UNITS
    ) -> None:
        self.client = client
        self.address = client.address
        self.units = units
        self.hull_list = HullList(client, prefix)
        self.fence_list = FenceList(client, prefix)
        self.alarms = AlarmList(client, prefix)
        self.metrics = None if metrics_url is None else ServerMetrics(metrics_url)
        self.hulls = Feeds(partial(HullFeed, client))
        self.fences = Feeds(partial(FenceFeed, client))
        self.many = Feeds(partial(ManyFeed, client))
        self.outliers = Feeds(partial(OutlierFeed, client, self.hulls, units.area))

    async def close(self) -> None:
        """Stop all background tasks."""
        await self.outliers.close()  # they use hulls
        feeds = self.hulls, self.fences, self.many
        lists = self.hull_list, self.fence_list, self.alarms
        await asyncio.gather(*(each.close() for each in (*lists, *feeds)))
        if self.metrics is not None:
            await self.metrics.close()
