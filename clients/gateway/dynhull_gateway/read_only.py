"""A gateway that changes nothing of the server, whatever the token."""

import re
from http import HTTPStatus

from starlette.types import ASGIApp, Receive, Scope, Send

from .problems import problem

READING = frozenset({"GET", "HEAD", "OPTIONS"})
# Questions with a body, what a stream follows, and that somebody takes care of an alarm, which is what pages are for.
ALLOWED = re.compile(
    r"POST /(hulls/[^/]+/(locate|distance|count|support|tangents|intersect-lines|positions|phase-diagram|frontier)"
    r"|streams|fences/between|alarms/[^/]+/(acknowledge|mute))"
    r"|(PUT|DELETE) /streams/[^/]+/subscriptions/[^/]+"
)


class ReadOnly:
    """Refuses what changes something with 403.

    Args:
        app: the application.
        root_path: the path below which a proxy shows the gateway.
    """

    def __init__(self, app: ASGIApp, root_path: str) -> None:
        self._app = app
        self._root = root_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] == "http" and scope["method"] not in READING:
            path = scope["raw_path"].decode("latin-1").partition("?")[0].removeprefix(self._root)
            if not ALLOWED.fullmatch(f"{scope['method']} {path}"):
                detail = "the dashboard only reads; dynhull gateway has all calls"
                await problem(HTTPStatus.FORBIDDEN, detail, reason="READ_ONLY")(scope, receive, send)
                return
        await self._app(scope, receive, send)
