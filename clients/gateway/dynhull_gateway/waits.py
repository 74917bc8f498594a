"""Reads that wait for a revision, while their callers wait for them."""

import asyncio
from collections.abc import Iterable
from urllib.parse import parse_qsl

from fastapi.routing import APIRoute
from starlette.routing import BaseRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .bodies import again

REVISIONS = "min_revision", "other_min_revision", "keys_min_revision"


class WaitsForCallers:
    """Ends a read that may wait for a revision when its caller has gone, and with it the call to the server.

    Args:
        app: what the requests are passed on to.
        routes: those of the application: some questions have a revision in their bodies.
        root_path: the path below which a proxy shows the gateway.
    """

    def __init__(self, app: ASGIApp, routes: Iterable[BaseRoute], root_path: str) -> None:
        self._app = app
        self._root = root_path
        self._asking = [each.path_regex for each in routes if isinstance(each, APIRoute) and _asks(each)]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; nothing is answered to a caller that has gone."""
        if scope["type"] != "http" or not self._waits(scope):
            await self._app(scope, receive, send)
            return
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
            nonlocal watching
            message = await receive()
            if watching is None and not message.get("more_body"):
                watching = asyncio.create_task(watch())
            return message

        received: Receive = noting
        if scope["method"] == "GET":  # whose handler asks for no body
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

    def _waits(self, scope: Scope) -> bool:
        """Whether a request may wait: by its parameters, or as one of the questions. A write never does."""
        if scope["method"] == "GET":
            return _named(scope["query_string"])
        path = scope["path"].removeprefix(self._root)
        return scope["method"] == "POST" and (
            any(each.match(path) for each in self._asking) or _named(scope["query_string"])
        )


def _named(query: bytes) -> bool:
    """Whether a query has a revision to wait for."""
    return bool(query) and any(name in REVISIONS for name, _ in parse_qsl(query.decode("latin-1"), True))


def _asks(route: APIRoute) -> bool:
    """Whether the body of a route may name a revision to wait for."""
    body = route.body_field
    fields = getattr(body.field_info.annotation, "model_fields", {}) if body else {}
    return any(name in REVISIONS for name in fields)


def _task() -> asyncio.Task[object]:
    task = asyncio.current_task()
    assert task is not None
    return task
