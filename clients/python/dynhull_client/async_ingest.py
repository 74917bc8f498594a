"""Many batches in one call, with asyncio."""

import asyncio
from types import TracebackType
from typing import Self

import numpy.typing as npt

from .calls import Ingesting
from .connection import Connection
from .ingest import Ingest
from .messages import Ingested


class AsyncIngest:
    """`Ingest` for asyncio: an async context manager for one use, whose `apply` is awaited.

    It is an Ingest in threads, with a connection of its own: where the server refuses a batch while another is being
    sent, grpc.aio may report an internal error instead of the refusal.
    """

    def __init__(self, connection: Connection, ingesting: Ingesting) -> None:
        self._connection = connection.blocking()
        self._ingest = Ingest(self._connection, ingesting)

    @property
    def summary(self) -> Ingested | None:
        """What was done, once the context has been left without an error."""
        return self._ingest.summary

    async def apply(
        self,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    ) -> None:
        """Send a batch; arguments and errors as of `Ingest.apply`."""
        await asyncio.to_thread(self._ingest.apply, insert, delete, move)

    async def __aenter__(self) -> Self:
        await asyncio.to_thread(self._ingest.__enter__)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            await asyncio.to_thread(self._ingest.__exit__, kind, error, traceback)
        finally:
            self._connection.channel.close()
