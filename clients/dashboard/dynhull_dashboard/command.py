"""The command: `dynhull dashboard`."""

import asyncio
import sys
from pathlib import Path
from typing import Annotated

import grpc
import typer

from dynhull_client import AsyncHullClient

from .hub import Hub
from .serve import serve


def dashboard(
    address: Annotated[str, typer.Option(envvar="DYNHULL_ADDRESS", help="The server.")] = "127.0.0.1:50051",
    token: Annotated[
        str | None, typer.Option(envvar="DYNHULL_TOKEN", help="The bearer token to show it; may only read.")
    ] = None,
    tls_ca: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, help="PEM file: talk TLS, to a server certified by it."),
    ] = None,
    metrics: Annotated[
        str | None,
        typer.Option(help="The server's page for Prometheus: updates a second, acknowledgement delay."),
    ] = None,
    prefix: Annotated[str, typer.Option(help="Offer only hulls whose names begin so.")] = "",
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for a free one.")] = 5006,
    origin: Annotated[
        list[str] | None,
        typer.Option(help="HOST:PORT as browsers on other machines call the page. May be repeated."),
    ] = None,
) -> None:
    """Show live hulls in the browser.

    The first line printed is "dynhull dashboard on http://HOST:PORT". Add ?hull=NAME to that to begin with a hull.
    Whoever reaches the page sees what the token may read.

    With everything: dynhull serve --metrics-port 9464, then dynhull dashboard --metrics http://127.0.0.1:9464/metrics
    """
    try:
        asyncio.run(_run(address, token, tls_ca, metrics, prefix, host, port, origin or []))
    except OSError as error:
        sys.exit(f"cannot listen on {host}:{port}: {error}")


async def _run(
    address: str,
    token: str | None,
    tls_ca: Path | None,
    metrics: str | None,
    prefix: str,
    host: str,
    port: int,
    origins: list[str],
) -> None:
    tls = None if tls_ca is None else grpc.ssl_channel_credentials(tls_ca.read_bytes())
    async with AsyncHullClient(address, token=token, tls=tls, retries=0) as client:
        await serve(Hub(client, prefix, metrics), host, port, origins)
