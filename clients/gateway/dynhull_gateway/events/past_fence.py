"""The events that a fence would have made, as text."""

import asyncio
from collections.abc import AsyncGenerator
from typing import Any

from dynhull_cli.fences.shown import event_members
from dynhull_client import AsyncFenceEvents, DynhullError, FenceEvent

from .messages import COMMENT, message, problem


class PastEvents:
    """The events of a fence after the fact. `begin` comes before the events.

    Args:
        stream: the events.
    """

    def __init__(self, stream: AsyncFenceEvents) -> None:
        self._stream = stream
        self._coming: asyncio.Task[Any] = asyncio.ensure_future(_following(stream))

    async def begin(self, seconds: float) -> None:
        """Wait for the first event for so long; raises what refuses the request until then."""
        try:
            done, _ = await asyncio.wait([self._coming], timeout=seconds)
            if done and self._coming.exception() is not None:
                self._coming.result()
        except BaseException:
            await self._close()
            raise

    async def texts(self, keepalive: float) -> AsyncGenerator[bytes, None]:
        """The events, and "complete" after the last; a comment when there is none for long."""
        sent = 0
        try:
            while True:
                done, _ = await asyncio.wait([self._coming], timeout=keepalive)
                if not done:
                    yield COMMENT
                    continue
                event = self._coming.result()
                if event is None:
                    yield message("complete", "", {"events": sent})
                    return
                sent += 1
                yield message(event.type, "", event_members(event))
                self._coming = asyncio.ensure_future(_following(self._stream))
        except DynhullError as error:
            yield problem(error)
        finally:
            await self._close()

    async def _close(self) -> None:
        self._coming.cancel()
        await asyncio.gather(self._coming, return_exceptions=True)
        await self._stream.close()


async def _following(stream: AsyncFenceEvents) -> FenceEvent | None:
    """The next event; None after the last."""
    return await anext(stream, None)
