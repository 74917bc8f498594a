"""`dynhull dashboard`: the gateway with its page, which only reads."""

from typing import Annotated

import typer

from dynhull_cli.connected import Connect, connecting

from .command import Host, Port
from .tiles import LARGEST_ZOOM, Tiles

LOOPBACK = "127.0.0.1", "localhost", "[::1]"
# How long the server may take to verify a large hull.
TIMEOUT_SECONDS = 600.0


@connecting
def dashboard(
    connect: Connect,
    metrics: Annotated[
        str | None,
        typer.Option(help="URL of the server's metrics page, for updates per second and acknowledgement delay."),
    ] = None,
    prefix: Annotated[str, typer.Option(help="Offer only hulls and fences whose names begin with this.")] = "",
    host: Host = "127.0.0.1",
    port: Port = 5006,
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
    Anyone who can reach the page can see what the token may read, and acknowledge and mute the alarms that it may
    write.

    dynhull dashboard --metrics http://127.0.0.1:9464/metrics  # with dynhull serve --metrics-port 9464
    """
    from dynhull_client import AsyncHullClient

    from .known_names import names_of
    from .page import PageSettings
    from .page.metrics import Metrics
    from .serve import in_url, listener, run
    from .settings import Settings

    ground = None if tiles is None else Tiles(tiles, tiles_attribution, tiles_zoom)
    further = names_of(origin or ())
    with listener(host, port) as listening:
        port = listening.getsockname()[1]
        names = further | names_of(f"{each}:{port}" for each in (in_url(host), *LOOPBACK))
        measured = None if metrics is None else Metrics(metrics)
        page = PageSettings(prefix=prefix, x_unit=x_unit, y_unit=y_unit, tiles=ground, metrics=measured)
        settings = Settings(names=names, page=page, read_only=True)
        run(lambda: connect(AsyncHullClient, retries=0, timeout=TIMEOUT_SECONDS), listening, settings)
