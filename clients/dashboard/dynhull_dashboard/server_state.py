"""Whether the server answers, and its list of hulls."""

import asyncio
from collections import Counter

from dynhull_client import AsyncHullClient, DynhullError, HullInfo

POLL_SECONDS = 1.0
TIMEOUT_SECONDS = 2.0
# Too many to pick from; --prefix narrows the list.
MOST_LISTED = 300


class ServerState:
    """The server's list of hulls, polled.

    Attributes:
        prefix: only hulls whose names begin with it are listed.
        hulls: the first `MOST_LISTED` of them, by name.
        listed: whether the list has arrived once.
        error: why the server did not answer the last request; None where it did.
    """

    def __init__(self, client: AsyncHullClient, prefix: str) -> None:
        self.prefix = prefix
        self.hulls: dict[str, HullInfo] = {}
        self.listed = False
        self.error: DynhullError | None = None
        self._client = client
        self._task = asyncio.create_task(self._run())

    def largest(self) -> list[str]:
        """The hull with the most points, in a list; an empty list where there are no hulls."""
        return [hull.name for hull in sorted(self.hulls.values(), key=lambda hull: -hull.points)[:1]]

    def prefixes(self) -> list[str]:
        """What the names of several hulls begin with, up to one of their slashes."""
        counts = Counter(each[: end + 1] for each in self.hulls for end, letter in enumerate(each) if letter == "/")
        return sorted(prefix for prefix, count in counts.items() if count > 1)

    async def close(self) -> None:
        """Stop polling."""
        self._task.cancel()
        await asyncio.wait([self._task])

    async def _run(self) -> None:
        while True:
            try:
                self.hulls = await self._list()
                self.listed, self.error = True, None
            except DynhullError as error:
                self.error = error
            await asyncio.sleep(POLL_SECONDS)

    async def _list(self) -> dict[str, HullInfo]:
        hulls: dict[str, HullInfo] = {}
        async for hull in self._client.list_hulls(self.prefix, timeout=TIMEOUT_SECONDS):
            if len(hulls) == MOST_LISTED:
                break
            hulls[hull.name] = hull
        return hulls
