"""An application that answers only to the names it is configured with.

A page of another site can have its own name lead to the dashboard's address (DNS rebinding). Its requests then have the
same origin as the dashboard, for the browser: only the name in them differs.
"""

import re
from collections.abc import Iterable
from http import HTTPStatus
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

HOST = re.compile(r"([a-z0-9._-]+|\[[0-9a-f:.]+\])(:[0-9]{1,5})?")
PORTS = {"http": 80, "https": 443}


def names_of(hosts: Iterable[str]) -> frozenset[str]:
    """The names, each with its port.

    Args:
        hosts: HOST, HOST:PORT or an origin such as https://HOST, as browsers name the page. Without a port, the ports
            of HTTP and HTTPS.

    Raises:
        ValueError: if one of them is none of these.
    """
    return frozenset(name for host in hosts for name in _configured(host))


class KnownNames:
    """Refuses requests whose Host or Origin is not among some names, and says which one is at fault.

    Args:
        app: the application.
        names: as from `names_of`.
    """

    def __init__(self, app: ASGIApp, names: frozenset[str]) -> None:
        self._app = app
        self._names = names

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        unknown = self._unknown(Headers(scope=scope)) if scope["type"] == "http" else None
        if unknown is None:
            await self._app(scope, receive, send)
            return
        refusal = PlainTextResponse(
            f"This dashboard does not answer to {unknown}. If that is its name, start it with "
            f"dynhull dashboard --origin {unknown}\n",
            HTTPStatus.FORBIDDEN,
        )
        await refusal(scope, receive, send)

    def _unknown(self, headers: Headers) -> str | None:
        """The name at fault; None if all are known."""
        host = ", ".join(headers.getlist("host"))  # more than one is none of the names
        if self._names.isdisjoint(_with_port(host)):
            return host
        for origin in headers.getlist("origin"):
            if self._names.isdisjoint(_with_port(_netloc(origin))):
                return origin
        return None


def _netloc(origin: str) -> str:
    try:
        return urlsplit(origin).netloc
    except ValueError:
        return ""


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
