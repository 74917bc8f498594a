"""The server's fences to pick from."""

import asyncio

from dynhull_client import AsyncHullClient, DynhullError, Fence

from .repeating import repeat

POLL_SECONDS = 1.0
TIMEOUT_SECONDS = 2.0
# Too many to pick from; --prefix narrows the list.
MOST_LISTED = 300


class FenceList:
    """The server's list of fences, polled.

    Attributes:
        prefix: only fences whose names begin with it are listed.
        fences: the first `MOST_LISTED` of them, by name.
        listed: whether the list has arrived once.
        error: why the server did not list its fences; None where it did. A server that does not answer at all is the
            business of `ServerState`.
    """

    def __init__(self, client: AsyncHullClient, prefix: str) -> None:
        self.prefix = prefix
        self.fences: dict[str, Fence] = {}
        self.listed = False
        self.error: DynhullError | None = None
        self._client = client
        self._task = asyncio.create_task(repeat("fences", self._poll, lambda: POLL_SECONDS))

    async def close(self) -> None:
        """Stop polling."""
        self._task.cancel()
        await asyncio.wait([self._task])

    async def _poll(self) -> None:
        try:
            self.fences = await self._list()
            self.listed, self.error = True, None
        except DynhullError as error:
            self.error = error

    async def _list(self) -> dict[str, Fence]:
        fences: dict[str, Fence] = {}
        async for fence in self._client.list_fences(self.prefix, timeout=TIMEOUT_SECONDS):
            if len(fences) == MOST_LISTED:
                break
            fences[fence.name] = fence
        return fences
