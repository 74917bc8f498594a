"""Many batches in one call, with asyncio."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from functools import partial, update_wrapper
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Self

from ._ingest import Ingest

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine
    from types import TracebackType

    from ._async_connection import AsyncConnection
    from ._calls import Ingesting
    from ._messages import Ingested


P = ParamSpec("P")


def _in_thread(
    method: Callable[Concatenate[Ingest, P], None],
) -> Callable[Concatenate[AsyncIngest, P], Coroutine[Any, Any, None]]:
    """A method of an Ingest, in the thread of an AsyncIngest."""

    async def run(self: AsyncIngest, /, *arguments: P.args, **named: P.kwargs) -> None:
        await self._in_thread(partial(method, self._ingest, *arguments, **named))

    update_wrapper(run, method)
    return run


class AsyncIngest:
    """`Ingest` for asyncio: an async context manager for one use. Await `apply`."""

    # An Ingest in threads with its own connection: when the server refuses a batch while another one is being sent,
    # grpc.aio may report an internal error instead of the refusal.

    def __init__(self, connection: AsyncConnection, ingesting: Ingesting) -> None:
        self._connection = connection.blocking()
        self._name = ingesting.name
        self._ingest = Ingest(self._connection, ingesting)
        # Of its own, as those that threads share could all wait for a server that does not read.
        self._thread = ThreadPoolExecutor(1, f"ingest to {ingesting.name}")
        self._left = False

    @property
    def summary(self) -> Ingested | None:
        """The effect of all batches; None until the context was left without an error."""
        return self._ingest.summary

    apply = _in_thread(Ingest.apply)

    def __repr__(self) -> str:
        return f"<AsyncIngest to {self._name!r}>"

    async def __aenter__(self) -> Self:
        self._ingest.__enter__()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        leave = partial(self._ingest.__exit__, kind, error, traceback)
        try:
            if error is None:
                await self._in_thread(leave)
            else:
                leave()
        finally:
            self._left = True
            self._connection.close()  # ends what waits in the thread
            self._thread.shutdown(wait=False)

    async def _in_thread(self, function: Callable[[], None]) -> None:
        if self._left:  # nothing waits any more
            function()
        else:
            await asyncio.get_running_loop().run_in_executor(self._thread, function)
