"""The dashboard's HTTP server, which is Bokeh's."""

import asyncio
import errno
import logging
import signal
import socket
from collections.abc import Sequence
from functools import partial

from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.document import Document
from bokeh.server.contexts import BokehSessionContext
from bokeh.server.server import BaseServer
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.netutil import bind_sockets

from .hub import Hub
from .hull_socket import HullSocket
from .known_hosts import KnownHosts
from .page import Page

LOOPBACK = "127.0.0.1", "localhost", "[::1]"


async def serve(hub: Hub, host: str, port: int, origins: Sequence[str]) -> None:
    """Serve the page until SIGTERM or SIGINT.

    Args:
        hub: the source of the hulls.
        host: the address to listen on.
        port: the port to listen on; 0 for a free one.
        origins: further names of the page, as for `KnownHosts`.

    Raises:
        ValueError: if one of `origins` is not a name.
        OSError: it cannot listen there.
    """
    # Bokeh warns of each message that it could not send to a page that was closed, which is no fault.
    logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)
    stop = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, stop.set)
    sockets = _listen(host, port)
    port = sockets[0].getsockname()[1]
    name = f"[{host}]" if ":" in host else host
    hosts = [f"{each}:{port}" for each in (name, *LOOPBACK)]
    page = Application(FunctionHandler(partial(_show, hub)))
    hulls = ("/hulls", HullSocket, {"hub": hub})
    application = KnownHosts({"/": page}, [*hosts, *origins], extra_patterns=[hulls])
    http = HTTPServer(application)
    http.add_sockets(sockets)
    server = BaseServer(IOLoop.current(), application, http)
    server.start()
    print(f"dynhull dashboard on http://{name}:{port}", flush=True)  # noqa: T201  # the address is the command's output
    await stop.wait()
    server.stop()
    await hub.close()


def _listen(host: str, port: int) -> list[socket.socket]:
    try:
        return bind_sockets(port, host)
    except OSError as error:
        reason = error.strerror or str(error)
        if error.errno == errno.EADDRINUSE:
            reason = "another program uses this port: choose another with --port"
        raise OSError(f"cannot listen on {host}:{port}: {reason}") from None


def _show(hub: Hub, document: Document) -> None:
    context = document.session_context
    assert isinstance(context, BokehSessionContext)
    assert context.request is not None
    arguments = context.request.arguments
    hulls, fences, keys = (
        list(dict.fromkeys(each.decode(errors="replace") for each in arguments.get(name, [])))
        for name in ("hull", "fence", "key")
    )
    Page(document, hub, hulls, fences, keys[0] if keys else "")
