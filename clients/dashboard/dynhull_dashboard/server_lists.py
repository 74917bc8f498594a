"""The server's hulls and fences to pick from, and whether it answers."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable
from typing import Generic, TypeVar

from dynhull_client import AsyncHullClient, DynhullError, Fence, HullInfo

from .repeating import repeat

POLL_SECONDS = 1.0
TIMEOUT_SECONDS = 2.0
# Too many to pick from; --prefix narrows the list.
MOST_LISTED = 300

Item = TypeVar("Item", HullInfo, Fence)


class ServerList(Generic[Item]):
    """A list of the server, polled.

    Attributes:
        prefix: only names that begin with it are listed.
        by_name: the first `MOST_LISTED`, by name.
        listed: whether the list has arrived once.
        error: why the server did not answer the last request; None where it did.
    """

    def __init__(self, ask: Callable[..., AsyncIterator[Item]], prefix: str) -> None:
        self.prefix = prefix
        self.by_name: dict[str, Item] = {}
        self.listed = False
        self.error: DynhullError | None = None
        self._ask: Callable[..., AsyncIterator[Item]] = ask
        self._task = asyncio.create_task(self._run())

    async def close(self) -> None:
        """Stop polling."""
        self._task.cancel()
        await asyncio.wait([self._task])

    async def _run(self) -> None:
        while True:
            await self._poll()
            await asyncio.sleep(POLL_SECONDS)

    async def _poll(self) -> None:
        found: dict[str, Item] = {}
        try:
            async for item in self._ask(self.prefix, timeout=TIMEOUT_SECONDS):
                if len(found) == MOST_LISTED:
                    break
                found[item.name] = item
            self.by_name, self.listed, self.error = found, True, None
        except DynhullError as error:
            self.error = error


class HullList(ServerList[HullInfo]):
    """The server's hulls. Its error is that of the server: it is asked as often while the server is away."""

    def __init__(self, client: AsyncHullClient, prefix: str) -> None:
        super().__init__(client.list_hulls, prefix)

    def largest(self) -> list[str]:
        """The hull with the most points, in a list; an empty list where there are no hulls."""
        return [hull.name for hull in sorted(self.by_name.values(), key=lambda hull: -hull.points)[:1]]

    def prefixes(self) -> list[str]:
        """What the names of several hulls begin with, up to one of their slashes."""
        counts = Counter(each[: end + 1] for each in self.by_name for end, letter in enumerate(each) if letter == "/")
        return sorted(prefix for prefix, count in counts.items() if count > 1)


class FenceList(ServerList[Fence]):
    """The server's fences, asked for less often where that takes long."""

    def __init__(self, client: AsyncHullClient, prefix: str) -> None:
        super().__init__(client.list_fences, prefix)

    async def _run(self) -> None:
        await repeat("fences", self._poll, lambda: POLL_SECONDS)
