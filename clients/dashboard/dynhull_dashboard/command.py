"""The command `dynhull dashboard`."""

from typing import Annotated

import typer

from dynhull_cli.connected import Connect, connecting

from .tiles import LARGEST_ZOOM, Tiles


@connecting
def dashboard(
    connect: Connect,
    metrics: Annotated[
        str | None,
        typer.Option(help="URL of the server's metrics page, for updates per second and acknowledgement delay."),
    ] = None,
    prefix: Annotated[str, typer.Option(help="Offer only hulls and fences whose names begin with this.")] = "",
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for a free one.")] = 5006,
    origin: Annotated[
        list[str] | None,
        typer.Option(
            help="Name of the page in browsers on other machines, such as HOST:PORT or https://HOST. Requests under "
            "other names are refused. May be repeated."
        ),
    ] = None,
    x_unit: Annotated[
        str, typer.Option(help="Unit of x. If it differs from that of y, each axis has its own scale.")
    ] = "",
    y_unit: Annotated[str, typer.Option(help="Unit of y.")] = "",
    tiles: Annotated[
        str | None,
        typer.Option(
            help="URL of the tiles of a map, such as https://HOST/{z}/{x}/{y}.png, to draw under hulls on the globe. "
            "Browsers request them there; without, they ask no other host."
        ),
    ] = None,
    tiles_attribution: Annotated[str, typer.Option(help="What the provider of the tiles wants to be shown.")] = "",
    tiles_zoom: Annotated[int, typer.Option(min=2, max=LARGEST_ZOOM, help="The largest zoom of the tiles.")] = 19,
) -> None:
    """Show live hulls and fences in the browser.

    The first line printed is "dynhull dashboard on http://HOST:PORT". Add ?hull=NAME, ?fence=NAME or ?prefix=fleet/ to
    open the page with that hull or fence, or with all hulls whose names begin with fleet/.
    Anyone who can reach the page can see what the token may read.

    dynhull dashboard --metrics http://127.0.0.1:9464/metrics  # with dynhull serve --metrics-port 9464
    """
    import asyncio

    from dynhull_client import AsyncHullClient

    from .hub import Hub
    from .serve import serve  # imports Bokeh, which --help does not need
    from .units import Units

    ground = None if tiles is None else Tiles(tiles, tiles_attribution, tiles_zoom)

    async def show() -> None:
        async with connect(AsyncHullClient, retries=0) as client:
            await serve(Hub(client, prefix, metrics, Units(x_unit, y_unit)), host, port, origin or [], ground)

    asyncio.run(show())
