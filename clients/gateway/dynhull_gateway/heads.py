"""HEAD: the headers of what GET would answer."""

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

GET, HEAD = "GET", "HEAD"


class HeadAsGet:
    """Answers HEAD as GET without the body, which the server leaves out: it knows the method that was sent."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; once its headers are sent its reader counts as gone, which ends a stream of events."""
        if scope["type"] != "http" or scope["method"] != HEAD:
            await self._app(scope, receive, send)
            return
        answered = asyncio.Event()

        async def gone() -> Message:
            await answered.wait()
            return {"type": "http.disconnect"}

        async def noting(message: Message) -> None:
            await send(message)
            answered.set()

        await self._app({**scope, "method": GET}, gone, noting)
