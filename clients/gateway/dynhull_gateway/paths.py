"""Names with slashes in paths, and the path below which a proxy shows the gateway."""

from starlette.types import ASGIApp, Receive, Scope, Send


class PathsAsSent:
    """Matches paths as they were sent, so that a name with a slash, written %2F, is one segment.

    Servers decode paths before they call an application, and a/b/points could then be the hull a/b or a. Parameters of
    paths are decoded one by one, see `schemas.unquoted`.

    Args:
        app: the application.
        root_path: the path below which a proxy shows the gateway, whether it removes it from paths or not.
    """

    def __init__(self, app: ASGIApp, root_path: str) -> None:
        self._app = app
        self._root = root_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, with its path as it was sent."""
        if scope["type"] == "http":
            path = scope["raw_path"].decode("latin-1")
            if not path.startswith(f"{self._root}/"):  # the proxy has removed it
                path = self._root + path
            scope = {**scope, "path": path, "root_path": self._root}
        await self._app(scope, receive, send)
