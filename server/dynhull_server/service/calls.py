"""The calls under way: their refusals become statuses, and a draining server ends those that wait."""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import grpc
from google.protobuf.message import DecodeError
from grpc_status import rpc_status

from .status import ANSWERED, DrainingError, error_status

Context = grpc.aio.ServicerContext[Any, Any]

log = logging.getLogger(__name__)


class Progress:
    """How many batches a call has applied; None for calls that apply none or one."""

    batches: int | None = None


class Calls:
    """Every call runs inside `short`, `waiting` or `streaming`, which take its request to see whether it is one."""

    def __init__(self) -> None:
        self._draining = False
        self._short: set[asyncio.Task[Any]] = set()
        self._cutoffs: set[asyncio.Timeout] = set()

    async def drain(self, grace: float) -> None:
        """End the calls that wait, refuse new ones, and let the short ones finish for up to `grace` seconds."""
        self._draining = True
        for cutoff in self._cutoffs:
            cutoff.reschedule(asyncio.get_running_loop().time())
        if self._short:
            await asyncio.wait(self._short, timeout=grace)

    @asynccontextmanager
    async def short(self, context: Context, request: object) -> AsyncIterator[None]:
        """A call that ends by itself, and that a draining server finishes."""
        async with self.streaming(context, request):
            task = asyncio.current_task()
            assert task is not None  # gRPC runs each call in a task
            self._short.add(task)
            task.add_done_callback(self._short.discard)
            yield

    @asynccontextmanager
    async def waiting(self, context: Context, request: object) -> AsyncIterator[Progress]:
        """A call that may wait for others: for a revision, or for its client's next message."""
        async with self.streaming(context, request) as progress, self.cutoff():
            yield progress

    @asynccontextmanager
    async def streaming(self, context: Context, request: object) -> AsyncIterator[Progress]:
        """A call that waits inside `cutoff` only.

        A generator must not yield inside it: what is cut off would be gRPC's sending.
        """
        progress = Progress()
        try:
            if self._draining:
                raise DrainingError
            if isinstance(request, DecodeError):
                raise request
            yield progress
        except ANSWERED as error:
            status = rpc_status.to_status(error_status(error, progress.batches))
            await context.abort(status.code, status.details, status.trailing_metadata)
        except grpc.aio.AbortError:
            raise
        except Exception:
            log.exception("a call failed; this is a bug")
            await context.abort(grpc.StatusCode.INTERNAL, "internal error, see the server's log")

    @asynccontextmanager
    async def cutoff(self) -> AsyncIterator[None]:
        """Whatever happens inside ends with DrainingError when the server drains."""
        if self._draining:
            raise DrainingError
        try:
            async with asyncio.timeout(None) as cutoff:
                self._cutoffs.add(cutoff)
                try:
                    yield
                finally:
                    self._cutoffs.discard(cutoff)
        except TimeoutError:
            raise DrainingError from None
