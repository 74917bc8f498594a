"""The command: `dynhull dashboard`."""

import asyncio
from typing import Annotated

import typer

from dynhull_cli.connected import Connect, connecting
from dynhull_client import AsyncHullClient

from .hub import Hub


@connecting
def dashboard(
    connect: Connect,
    metrics: Annotated[
        str | None,
        typer.Option(help="The server's page for Prometheus, for updates a second and acknowledgement delay."),
    ] = None,
    prefix: Annotated[str, typer.Option(help="Offer only hulls whose names begin so.")] = "",
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for a free one.")] = 5006,
    origin: Annotated[
        list[str] | None,
        typer.Option(
            help="HOST:PORT as browsers on other machines call the page; no other name is answered. May be repeated."
        ),
    ] = None,
) -> None:
    """Show live hulls in the browser.

    The first line printed is "dynhull dashboard on http://HOST:PORT". Add ?hull=NAME to that to begin with a hull.
    Whoever reaches the page sees what the token may read.

    dynhull dashboard --metrics http://127.0.0.1:9464/metrics  # of dynhull serve --metrics-port 9464
    """
    from .serve import serve  # imports Bokeh, which --help does not need

    async def show() -> None:
        async with connect(AsyncHullClient, retries=0) as client:
            await serve(Hub(client, prefix, metrics), host, port, origin or [])

    asyncio.run(show())
