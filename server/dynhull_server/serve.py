"""`dynhull serve`: run the server until SIGTERM or SIGINT."""

import asyncio
import gc
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from . import logs
from .app import Server
from .flags import with_settings
from .malloc import return_large_blocks
from .progress import progress_bar
from .settings import Settings
from .storage.port import StorageError

SIGNALS = signal.SIGTERM, signal.SIGINT


@with_settings
def serve(settings: Settings, _: dict[str, str]) -> None:
    """Serve hulls over gRPC.

    The first line printed is "dynhull serving on HOST:PORT". SIGTERM ends the server: what it has acknowledged is
    applied, calls under way finish, everything else gets UNAVAILABLE.

    A setting is taken from its flag, else from the environment (DYNHULL_PORT for --port), else from the --config file.
    """
    logs.configure(settings.log_level, settings.log_format)
    return_large_blocks()
    try:
        asyncio.run(_serve(settings))
    except RuntimeError as error:
        sys.exit(f"cannot listen on {settings.host}:{settings.port}: {error}")
    except (OSError, ValueError, StorageError) as error:
        sys.exit(f"cannot serve: {error}")


async def _serve(settings: Settings) -> None:
    with _told_to_stop() as stop:
        server = Server(settings)
        try:
            with progress_bar("hulls read") as progress:
                await server.start(progress)
            gc.freeze()  # modules and what was read: to look through that again and again would make calls wait 50 ms
            print(f"dynhull serving on {server.address}", flush=True)  # noqa: T201  # the command's output
            if server.metrics_url:
                print(f"metrics on {server.metrics_url}", flush=True)  # noqa: T201  # likewise
            await stop.wait()
        finally:
            await server.drain()
    gc.unfreeze()


@contextmanager
def _told_to_stop() -> Iterator[asyncio.Event]:
    """Set by SIGTERM and SIGINT, which are ignored from the end of the block to the end of the process.

    The signal comes as a byte through a socket. Its handler alone could come too late: where the loop has just gone to
    sleep, or another thread was interrupted. The loop's own handlers do the same, but end with it, and then a second
    signal on the way out would kill.
    """
    loop = asyncio.get_running_loop()
    stop = asyncio.Event()
    wake, signalled = socket.socketpair()
    with wake, signalled:

        def received() -> None:
            wake.recv(64)
            stop.set()

        for end in (wake, signalled):
            end.setblocking(False)
        loop.add_reader(wake, received)
        signal.set_wakeup_fd(signalled.fileno())
        for number in SIGNALS:
            signal.signal(number, lambda *_: None)
        try:
            yield stop
        finally:
            for number in SIGNALS:
                signal.signal(number, signal.SIG_IGN)
            signal.set_wakeup_fd(-1)
            loop.remove_reader(wake)
