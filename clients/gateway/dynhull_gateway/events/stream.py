"""A response that lasts: events while there are any, until the reader leaves or the gateway ends."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AbstractContextManager, nullcontext

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from ..figures import Figures
from ..health import State
from .messages import AVAILABLE, FIRST, UNAVAILABLE

# In the scope of a subscription: what takes the texts of its stream, which is joined to others.
TAKE = "dynhull.take"
# Bytes that are sent at a time: a reader that does not read has no more of an event in its buffer than this.
PIECE = 2**16
HEADERS = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}  # nginx passes on what it does not buffer


class EventStream(Response):
    """Sends texts as they come. A reader that does not read holds back its own stream alone, and is closed at last.

    Args:
        texts: events as text; closed with the stream.
        health: says when the gateway ends. Browsers then connect again, to the next gateway, and resume.
        figures: counts streams and events.
        counted: a block within which the stream is open.
    """

    media_type = "text/event-stream"

    def __init__(
        self,
        texts: AsyncIterator[bytes],
        health: State,
        figures: Figures,
        counted: AbstractContextManager[None] | None = None,
    ) -> None:
        super().__init__(headers=HEADERS)
        del self.headers["content-length"]
        self._texts = texts
        self._health = health
        self._figures = figures
        self._counted = nullcontext() if counted is None else counted
        self._turn = asyncio.Lock()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send until the first of: no more events, the reader has left, the gateway ends."""
        with self._counted, self._figures.stream():
            if TAKE in scope:
                await self._join(scope[TAKE], send)
            else:
                await self._until_an_end(receive, send)

    async def _join(self, take: Callable[[bytes], Awaitable[None]], send: Send) -> None:
        """Give all texts to a joined stream, which cancels this when it is read no more."""
        await self._begin(send)
        try:
            async for text in self._texts:
                await take(text)
        finally:
            await self._texts.aclose()  # type: ignore[attr-defined]  # an async generator

    async def _begin(self, send: Send) -> None:
        await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})

    async def _until_an_end(self, receive: Receive, send: Send) -> None:
        sending = asyncio.create_task(self._send(send))
        ends = [sending, asyncio.create_task(_left(receive)), asyncio.create_task(self._health.draining.wait())]
        try:
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        finally:
            finished = sending.done()
            for each in ends:
                each.cancel()
            await asyncio.gather(*ends, return_exceptions=True)
            await self._texts.aclose()  # type: ignore[attr-defined]  # an async generator
        if finished:
            await sending
        await send({"type": "http.response.body", "body": b"", "more_body": False})

    async def _send(self, send: Send) -> None:
        await self._begin(send)
        await send({"type": "http.response.body", "body": FIRST, "more_body": True})
        reporting = asyncio.create_task(self._report_presence(send))
        try:
            async for text in self._texts:
                await self._write(send, text)
                self._figures.events.inc()
        finally:
            reporting.cancel()
            await asyncio.gather(reporting, return_exceptions=True)

    async def _report_presence(self, send: Send) -> None:
        """Tell the reader when the gateway has lost its server, and when it has it again."""
        reported = True
        while True:
            changed = self._health.changed
            if self._health.connected is not reported:
                reported = self._health.connected
                await self._write(send, AVAILABLE if reported else UNAVAILABLE)
            await changed.wait()

    async def _write(self, send: Send, text: bytes) -> None:
        async with self._turn:  # no event within another one
            left = len(text)
            self._figures.waiting_bytes += left
            try:
                for begin in range(0, len(text), PIECE):
                    piece = text[begin : begin + PIECE]
                    await send({"type": "http.response.body", "body": piece, "more_body": True})
                    left -= len(piece)
                    self._figures.waiting_bytes -= len(piece)
            finally:
                self._figures.waiting_bytes -= left


async def _left(receive: Receive) -> None:
    """Return when the reader has closed the connection."""
    while (await receive())["type"] != "http.disconnect":
        pass
