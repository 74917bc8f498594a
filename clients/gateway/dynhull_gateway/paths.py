"""Names with slashes in paths."""

from starlette.types import ASGIApp, Receive, Scope, Send


class PathsAsSent:
    """Matches paths as they were sent, so that a name with a slash, written %2F, is one segment.

    Servers decode paths before they call an application, and a/b/points could then be the hull a/b or a. Parameters of
    paths are decoded one by one, see `schemas.unquoted`.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, with its path as it was sent."""
        if scope["type"] == "http":
            scope = {**scope, "path": scope["raw_path"].decode("latin-1")}
        await self._app(scope, receive, send)
