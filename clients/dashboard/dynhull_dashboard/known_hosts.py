"""An application that answers only to the names it is configured with.

A page of another site can have its own name lead to the dashboard's address (DNS rebinding). Its requests then have the
same origin as the dashboard, for the browser and for Tornado: only the name in them differs.
"""

import re
from collections.abc import Iterable
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

from tornado.httputil import HTTPServerRequest
from tornado.web import Application, RequestHandler

HOST = re.compile(r"([a-z0-9._-]+|\[[0-9a-f:.]+\])(:[0-9]{1,5})?")
PORTS = {"http": 80, "https": 443}


class KnownHosts(Application):
    """An application restricted to requests whose Host and Origin are among the given names.

    Args:
        handlers: as for `Application`.
        hosts: HOST, HOST:PORT or an origin such as https://HOST, as browsers name the page. Without a port, the ports
            of HTTP and HTTPS.
        settings: as for `Application`.

    Raises:
        ValueError: if one of the names is none of these.
    """

    def __init__(self, handlers: Any, hosts: Iterable[str], **settings: Any) -> None:
        self._hosts = {name for host in hosts for name in _configured(host)}
        super().__init__(handlers, **settings)

    def find_handler(self, request: HTTPServerRequest, **_: Any) -> Any:
        """Tornado's handler, or a refusal that names the host or the origin at fault."""
        origin = request.headers.get("Origin")
        if self._hosts.isdisjoint(_with_port(request.host)):
            unknown = request.host
        elif origin is not None and self._hosts.isdisjoint(_with_port(urlsplit(origin).netloc)):
            unknown = origin
        else:
            return super().find_handler(request)
        return self.get_handler_delegate(request, Refusal, {"unknown": unknown})


class Refusal(RequestHandler):
    """Answers 403 to any request."""

    def initialize(self, unknown: str) -> None:
        """Tornado passes the name at fault."""
        self._unknown = unknown

    def prepare(self) -> None:
        """Answer before any method is called."""
        self.set_status(HTTPStatus.FORBIDDEN)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(
            f"This dashboard does not answer to {self._unknown}. If that is its name, start it with "
            f"dynhull dashboard --origin {self._unknown}\n"
        )


def _configured(host: str) -> set[str]:
    scheme, separator, name = host.lower().rstrip("/").rpartition("://")
    if not HOST.fullmatch(name) or (separator and scheme not in PORTS):
        raise ValueError(f"--origin is {host!r}: expected HOST or HOST:PORT, alone or after http:// or https://")
    return {f"{name}:{PORTS[scheme]}"} if separator and _portless(name) else _with_port(name)


def _with_port(host: str) -> set[str]:
    host = host.lower()
    return {f"{host}:{port}" for port in PORTS.values()} if _portless(host) else {host}


def _portless(host: str) -> bool:
    return not host.rpartition(":")[2].isdigit()
