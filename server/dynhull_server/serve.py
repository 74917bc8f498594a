"""`dynhull serve`: run the server until SIGTERM or SIGINT."""

import asyncio
import gc
import signal
import sys

from . import logs
from .flags import with_settings
from .journal.errors import JournalError
from .progress import progress_bar
from .service.server import Server
from .settings import Settings


@with_settings
def serve(settings: Settings, _: dict[str, str]) -> None:
    """Serve hulls over gRPC.

    The first line printed is "dynhull serving on HOST:PORT". SIGTERM ends the server: what it has acknowledged is
    applied, calls under way finish, everything else gets UNAVAILABLE.

    A setting is taken from its flag, else from the environment (DYNHULL_PORT for --port), else from the --config file.
    """
    logs.configure(settings.log_level, settings.log_format)
    try:
        asyncio.run(_serve(settings))
    except RuntimeError as error:
        sys.exit(f"cannot listen on {settings.host}:{settings.port}: {error}")
    except (OSError, ValueError, JournalError) as error:
        sys.exit(f"cannot serve: {error}")


async def _serve(settings: Settings) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    # Not the loop's own handlers: those end with it, and a second signal on the way out would kill.
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: None if loop.is_closed() else loop.call_soon_threadsafe(stop.set))
    server = Server(settings)
    try:
        with progress_bar("hulls read") as progress:
            await server.start(progress)
        gc.freeze()  # modules and what was read: to look through all that again and again would make calls wait 50 ms
        print(f"dynhull serving on {server.address}", flush=True)  # noqa: T201  # the address is the command's output
        if server.metrics_address:
            print(f"metrics on http://{server.metrics_address}/metrics", flush=True)  # noqa: T201  # likewise
        await stop.wait()
    finally:
        await server.drain()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)  # Python gives back its own handlers before the process ends
    gc.unfreeze()
