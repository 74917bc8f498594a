"""Names under which the gateway answers.

A page of another site can have its own name lead to the gateway's address (DNS rebinding). Its requests then have the
same origin as the gateway, for the browser: only the name in them differs.
"""

from collections.abc import Iterable
from functools import lru_cache
from http import HTTPStatus
from urllib.parse import urlsplit

from starlette.types import ASGIApp, Receive, Scope, Send

from .problems import cut, problem

LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})
ANY = "*"


def hosts_of(allowed: Iterable[str] | None, listening: str) -> frozenset[str]:
    """The names to answer to, for a gateway that listens on an address; none for any."""
    given = frozenset(each.lower() for each in allowed or ())
    if ANY in given or (not given and listening not in LOOPBACK):
        return frozenset()
    return given | LOOPBACK


class KnownHosts:
    """Refuses requests under other names with 421, which names the option that allows them."""

    def __init__(self, app: ASGIApp, hosts: frozenset[str]) -> None:
        self._app = app
        self._hosts = hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] == "http":
            # More than one is refused below: their names, with a comma between, are no name.
            given = b", ".join(value for name, value in scope["headers"] if name == b"host").decode("latin-1")
            name = _name(given)
            if name not in self._hosts:
                refused = problem(
                    HTTPStatus.MISDIRECTED_REQUEST,
                    f"this gateway does not answer to {cut(given) or 'requests without a name'}; "
                    f"dynhull gateway --allow-host {cut(name or 'NAME')} allows it",
                    reason="UNKNOWN_HOST",
                    field="Host",
                    value=cut(given),
                )
                await refused(scope, receive, send)
                return
        await self._app(scope, receive, send)


@lru_cache(16)  # nearly all requests come under one name
def _name(host: str) -> str | None:
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None
