"""The gateway as a process: listen, serve, and end in order."""

import asyncio
import errno
import os
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import typer
import uvicorn

from dynhull_client import AsyncHullClient

from .app import application
from .protocol import Protocol
from .settings import Settings

BACKLOG = 2048
LONGEST_HEAD = 65536


class Server(uvicorn.Server):
    """uvicorn without its own handlers of signals, which would end the process with the signal."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave the signals to the caller."""
        yield


def run(connect: Callable[[], AsyncHullClient], listening: socket.socket, settings: Settings) -> None:
    """Serve until SIGTERM or SIGINT; the first line printed has the address."""
    config = uvicorn.Config("", log_config=None)  # for its choice of an event loop
    with asyncio.Runner(loop_factory=config.get_loop_factory()) as runner:
        runner.run(serve(connect, listening, settings))


def in_url(host: str) -> str:
    """A host as it is written before a port."""
    return f"[{host}]" if ":" in host else host


async def serve(connect: Callable[[], AsyncHullClient], listening: socket.socket, settings: Settings) -> None:
    """Serve on a listening socket."""
    async with connect() as client:
        app = application(client, settings)
        config = uvicorn.Config(
            app,
            http=Protocol,
            log_config=None,
            log_level="error",  # bad requests are answered, not logged
            access_log=False,
            lifespan="off",
            server_header=False,
            ws="none",
            forwarded_allow_ips=settings.forwarded_from,
            timeout_graceful_shutdown=round(settings.grace_seconds),
            h11_max_incomplete_event_size=LONGEST_HEAD,
        )
        if settings.metrics is not None:
            with explained(*settings.metrics):
                app.state.figures.serve(*settings.metrics)
        server = Server(config)

        def stop() -> None:
            app.state.health.drain()  # streams of events have no end of their own
            server.should_exit = True

        for number in (signal.SIGTERM, signal.SIGINT):
            asyncio.get_running_loop().add_signal_handler(number, stop)
        serving = asyncio.create_task(server.serve([listening]))
        host, port = listening.getsockname()[:2]
        kind = "dashboard" if settings.read_only else "gateway"
        typer.echo(f"dynhull {kind} on http://{in_url(host)}:{port}{settings.root_path}")
        following = asyncio.create_task(app.state.health.follow(client.presence()))
        try:
            await serving
        finally:
            following.cancel()


def listener(host: str, port: int) -> socket.socket:
    """A listening socket; OSError in words if the port is in use."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with explained(host, port):
        listening = socket.create_server((host, port), family=family, backlog=BACKLOG)
    listening.setblocking(False)
    return listening


@contextmanager
def explained(host: str, port: int) -> Iterator[None]:
    """Raise an OSError about listening with the reason in words."""
    try:
        yield
    except OSError as error:
        number = error.errno or 0
        if number == errno.EADDRINUSE:
            why = "another program uses this port: stop it, or choose another port"
        else:
            why = os.strerror(number) if number in errno.errorcode else error.strerror or str(error)
        place = f"{in_url(host)}:{port}"
        raise OSError(f"cannot serve: cannot listen on {place}: {why}") from None
