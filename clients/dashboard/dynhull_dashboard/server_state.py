"""Whether the server is there, and which hulls it has."""

import asyncio
import time

from dynhull_client import AsyncHullClient, DynhullError, HullInfo

POLL_SECONDS = 1.0
PATIENCE = 2.0
# A longer list nobody picks from; a prefix narrows it.
MOST_LISTED = 300


class ServerState:
    """What the server last said.

    Attributes:
        hulls: the first hulls whose names begin with the prefix, by name.
        trouble: why it does not answer; None where it does.
        since: when by `time.monotonic` that began.
    """

    def __init__(self, client: AsyncHullClient, prefix: str) -> None:
        self.hulls: dict[str, HullInfo] = {}
        self.trouble: str | None = None
        self.since = time.monotonic()
        self._client = client
        self._prefix = prefix
        self._task = asyncio.create_task(self._run())

    def largest(self) -> list[str]:
        """The hull with the most points; none where there are no hulls."""
        return [hull.name for hull in sorted(self.hulls.values(), key=lambda hull: -hull.points)[:1]]

    async def close(self) -> None:
        """Ask no longer."""
        self._task.cancel()
        await asyncio.wait([self._task])

    async def _run(self) -> None:
        while True:
            try:
                self.hulls = await self._listed()
                self._tell(None)
            except DynhullError as error:
                self._tell(str(error))
            await asyncio.sleep(POLL_SECONDS)

    async def _listed(self) -> dict[str, HullInfo]:
        hulls: dict[str, HullInfo] = {}
        async for hull in self._client.list_hulls(self._prefix, timeout=PATIENCE):
            if len(hulls) == MOST_LISTED:
                break
            hulls[hull.name] = hull
        return hulls

    def _tell(self, trouble: str | None) -> None:
        if (trouble is None) != (self.trouble is None):
            self.since = time.monotonic()
        self.trouble = trouble
