"""The dashboard's HTTP server."""

import asyncio
import errno
import signal
import socket
from collections.abc import Sequence

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import StaticFileHandler

from .hub import Hub
from .known_hosts import KnownHosts
from .live_socket import LiveSocket
from .page import VENDOR, PageHandler, page, policy
from .tiles import Tiles

LOOPBACK = "127.0.0.1", "localhost", "[::1]"


async def serve(hub: Hub, host: str, port: int, origins: Sequence[str], tiles: Tiles | None) -> None:
    """Serve the page until SIGTERM or SIGINT.

    Args:
        hub: the source of the hulls.
        host: the address to listen on.
        port: the port to listen on; 0 for a free one.
        origins: further names of the page, as for `KnownHosts`.
        tiles: those of the map; None for none.

    Raises:
        ValueError: if one of `origins` is not a name.
        OSError: it cannot listen there.
    """
    stop = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, stop.set)
    sockets = _listen(host, port)
    port = sockets[0].getsockname()[1]
    name = f"[{host}]" if ":" in host else host
    hosts = [f"{each}:{port}" for each in (name, *LOOPBACK)]
    html, version = page(hub, tiles)
    handlers = [
        ("/", PageHandler, {"html": html, "policy": policy(html, tiles)}),
        ("/live", LiveSocket, {"hub": hub, "version": version}),
        ("/vendor/(.*)", StaticFileHandler, {"path": VENDOR}),
    ]
    http = HTTPServer(KnownHosts(handlers, [*hosts, *origins], compress_response=True))
    http.add_sockets(sockets)
    print(f"dynhull dashboard on http://{name}:{port}", flush=True)  # noqa: T201  # the address is the command's output
    await stop.wait()
    http.stop()
    await http.close_all_connections()
    await hub.close()


def _listen(host: str, port: int) -> list[socket.socket]:
    try:
        return bind_sockets(port, host)
    except OSError as error:
        reason = error.strerror or str(error)
        if error.errno == errno.EADDRINUSE:
            reason = "another program uses this port: choose another with --port"
        raise OSError(f"cannot listen on {host}:{port}: {reason}") from None
