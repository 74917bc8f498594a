"""Requests that are cut off when the gateway ends."""

import asyncio
from http import HTTPStatus

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .health import State
from .problems import problem


class AnsweredAtTheEnd:
    """Answers the requests that are cancelled because they take longer than the gateway waits for them at its end."""

    def __init__(self, app: ASGIApp, health: State) -> None:
        self._app = app
        self._health = health

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; 503 in place of an answer if it is cancelled."""
        begun = False

        async def noting(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            await self._app(scope, receive, noting)
        except asyncio.CancelledError:
            if not self._health.draining.is_set():
                raise
            if not begun:
                stops = problem(HTTPStatus.SERVICE_UNAVAILABLE, "the gateway stops", reason="DRAINING")
                await stops(scope, receive, send)
