"""The calls under way: their refusals become statuses, and a draining server ends those that wait."""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import grpc
from grpc_status import rpc_status

from ..engine.errors import RefusedError
from .codec import InvalidFieldError
from .status import DrainingError, refusal_status

log = logging.getLogger(__name__)


class Progress:
    """How many batches a call has applied."""

    batches: int | None = None


class Calls:
    """Every call runs inside `short` or `waiting`."""

    def __init__(self) -> None:
        self._draining = False
        self._waiting: set[asyncio.Timeout] = set()

    def drain(self) -> None:
        """End the calls that wait, and refuse new ones. Short calls finish."""
        self._draining = True
        for cutoff in self._waiting:
            cutoff.reschedule(asyncio.get_running_loop().time())

    @asynccontextmanager
    async def short(self, context: grpc.aio.ServicerContext[Any, Any]) -> AsyncIterator[Progress]:
        """A call that ends by itself."""
        progress = Progress()
        try:
            if self._draining:
                raise DrainingError
            yield progress
        except (RefusedError, InvalidFieldError, DrainingError) as error:
            await _abort(context, error, progress)
        except (grpc.aio.AbortError, asyncio.CancelledError):
            raise
        except Exception:
            log.exception("a call failed; this is a bug")
            await context.abort(grpc.StatusCode.INTERNAL, "internal error, see the server's log")

    @asynccontextmanager
    async def waiting(self, context: grpc.aio.ServicerContext[Any, Any]) -> AsyncIterator[Progress]:
        """A call that may wait for others: for a revision, or for its client's next message."""
        async with self.short(context) as progress:
            try:
                async with asyncio.timeout(None) as cutoff:
                    self._waiting.add(cutoff)
                    try:
                        yield progress
                    finally:
                        self._waiting.discard(cutoff)
            except TimeoutError:
                raise DrainingError from None


async def _abort(
    context: grpc.aio.ServicerContext[Any, Any],
    error: RefusedError | InvalidFieldError | DrainingError,
    progress: Progress,
) -> None:
    status = rpc_status.to_status(refusal_status(error, progress.batches))
    await context.abort(status.code, status.details, status.trailing_metadata)
