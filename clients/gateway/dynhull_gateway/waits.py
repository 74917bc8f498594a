"""Reads that wait for a revision, while their callers wait for them."""

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .bodies import again

WAITING = b"min_revision"  # in a query, or in a body


class WaitsForCallers:
    """Ends a read that may wait for a revision when its caller has gone, and with it the call to the server."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; nothing is answered to a caller that has gone."""
        if scope["type"] != "http" or scope["method"] not in ("GET", "POST"):
            await self._app(scope, receive, send)
            return
        waits = WAITING in scope["query_string"]
        running, gone = _task(), False
        watching: asyncio.Task[None] | None = None

        async def watch() -> None:
            nonlocal gone
            while (await receive())["type"] != "http.disconnect":
                continue
            gone = True
            running.cancel()

        async def noting() -> Message:
            """What comes; after the body nothing comes any more but that the caller has gone."""
            nonlocal waits, watching
            message = await receive()
            waits = waits or WAITING in message.get("body", b"")
            if waits and watching is None and not message.get("more_body"):
                watching = asyncio.create_task(watch())
            return message

        received: Receive = noting
        if waits and scope["method"] == "GET":  # whose handler asks for no body
            received = again(await noting(), receive)
        try:
            await self._app(scope, received, send)
        except asyncio.CancelledError:
            if not gone:
                raise
            running.uncancel()
        finally:
            if watching is not None:
                watching.cancel()


def _task() -> asyncio.Task[object]:
    task = asyncio.current_task()
    assert task is not None
    return task
