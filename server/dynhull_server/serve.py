"""`dynhull serve`: run the server until SIGTERM or SIGINT."""

import asyncio
import signal
import sys
from typing import Annotated

import typer

from .service.server import Server, Settings

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")


def serve(
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen on; 0 for a free one.", min=0, max=65535)] = 50051,
    in_memory: Annotated[bool, typer.Option("--in-memory", help="Keep hulls in memory, and do not say so.")] = False,
    insecure: Annotated[bool, typer.Option("--insecure", help="Listen to other machines, without protection.")] = False,
    max_message_bytes: Annotated[int, typer.Option(help="Largest message.", min=1024, max=2**31 - 1)] = 64 * 2**20,
    max_hulls: Annotated[int, typer.Option(help="How many hulls there may be.", min=1)] = 100_000,
    grace: Annotated[float, typer.Option(help="Seconds that calls under way get at the end.", min=0)] = 30.0,
) -> None:
    """Serve hulls over gRPC.

    The first line printed is "dynhull serving on HOST:PORT". SIGTERM ends the server: what it has acknowledged is
    applied, calls under way finish, everything else gets UNAVAILABLE.
    """
    if host not in LOOPBACK and not insecure:
        sys.exit(
            f"{host} can be reached by other machines, without encryption or passwords: say --insecure to allow it"
        )
    if not in_memory:
        typer.echo("Hulls are kept in memory: they are gone when the server stops.", err=True)
    try:
        asyncio.run(_serve(Settings(host, port, max_message_bytes, max_hulls), grace))
    except RuntimeError as error:
        sys.exit(f"cannot listen on {host}:{port}: {error}")


async def _serve(settings: Settings, grace: float) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    server = Server(settings)
    await server.start()
    print(f"dynhull serving on {server.address}", flush=True)  # noqa: T201  # the address is the command's output
    await stop.wait()
    await server.drain(grace)
