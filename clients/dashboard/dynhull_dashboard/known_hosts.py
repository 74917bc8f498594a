"""A dashboard that answers only to its own names.

A page of another site whose name is made to lead here (DNS rebinding) has the same origin as the dashboard, for the
browser and for Tornado: only the name tells it apart.
"""

from collections.abc import Iterable
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

from bokeh.server.tornado import BokehTornado
from tornado.httputil import HTTPServerRequest
from tornado.web import ErrorHandler

HTTP_PORT = 80


class KnownHosts(BokehTornado):
    """Bokeh's application, for requests that name it as it is called and come from its own pages.

    Args:
        hosts: HOST:PORT as browsers call the page.
        applications, options: as Bokeh takes them.
    """

    def __init__(self, applications: Any, hosts: Iterable[str], **options: Any) -> None:
        self._hosts = {_with_port(host) for host in hosts}
        super().__init__(applications, extra_websocket_origins=sorted(self._hosts), **options)

    def find_handler(self, request: HTTPServerRequest, **_: Any) -> Any:
        """Tornado's choice, or a refusal."""
        origin = request.headers.get("Origin")
        known = _with_port(request.host) in self._hosts
        if known and (origin is None or _with_port(urlsplit(origin).netloc) in self._hosts):
            return super().find_handler(request)
        return self.get_handler_delegate(request, ErrorHandler, {"status_code": HTTPStatus.FORBIDDEN})


def _with_port(host: str) -> str:
    host = host.lower()
    return host if host.rpartition(":")[2].isdigit() else f"{host}:{HTTP_PORT}"
