"""`dynhull gateway`."""

import re
from typing import Annotated

import typer

from dynhull_cli.connected import Connect, connecting
from dynhull_cli.durations import more_than_0

MIB = 2**20
# Bytes of a stream of the server that wait here for a caller who does not read.
READ_AHEAD = 2**17

Host = Annotated[str, typer.Option(help="Address to listen on.")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for a free one.")]


@connecting
def gateway(
    connect: Connect,
    host: Host = "127.0.0.1",
    port: Port = 8080,
    origin: Annotated[
        list[str] | None,
        typer.Option(
            help="Origin such as https://HOST whose pages may use the gateway from browsers (CORS); * for all. May be "
            "repeated. Without, no other origin may."
        ),
    ] = None,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(
            help="Name under which the gateway answers, as browsers and proxies send it in Host, without a port; * for "
            "any. May be repeated. Default: localhost, 127.0.0.1 and ::1 on a loopback address, any elsewhere."
        ),
    ] = None,
    root_path: Annotated[
        str, typer.Option(help="Path below which a proxy shows the gateway to the world, such as /dynhull.")
    ] = "",
    forwarded_from: Annotated[
        str,
        typer.Option(
            help="Addresses of proxies, with commas between, whose X-Forwarded-For and X-Forwarded-Proto are believed."
        ),
    ] = "127.0.0.1",
    timeout: Annotated[str, typer.Option(help="How long the server may take to answer a request.")] = "30s",
    max_body: Annotated[
        int, typer.Option(min=1, help="Largest body of JSON or GeoJSON, in MiB. Bodies of rows are not held in memory.")
    ] = 16,
    max_upload: Annotated[int, typer.Option(min=1, help="Largest body of rows, in MiB.")] = 1024,
    head_timeout: Annotated[
        str, typer.Option(help="How long a request may take to arrive, without its body; 408 after that.")
    ] = "10s",
    body_timeout: Annotated[str, typer.Option(help="How long a body may pause; 408 after that.")] = "30s",
    reader_timeout: Annotated[
        str,
        typer.Option(help="How long a caller may read nothing of what waits for it; its connection ends after that."),
    ] = "30s",
    keepalive: Annotated[
        str, typer.Option(help="Pause after which a stream of events sends a comment, for the sake of proxies.")
    ] = "15s",
    max_streams: Annotated[int, typer.Option(min=0, help="Most streams of events at a time; 503 for more.")] = 10_000,
    max_many_streams_per_caller: Annotated[
        int,
        typer.Option(min=0, help="Most of them of many hulls, per token, or without per address; 429 for more."),
    ] = 256,
    max_subscriptions: Annotated[
        int, typer.Option(min=0, help="Most streams that are joined to one, each of which counts as one; 429 for more.")
    ] = 1_000,
    grace: Annotated[str, typer.Option(help="How long requests may still take after SIGTERM.")] = "10s",
    metrics_port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port of the metrics page; 0 for a free one.")
    ] = None,
    metrics_host: Annotated[str, typer.Option(help="Address of the metrics page.")] = "127.0.0.1",
) -> None:
    """Serve hulls and fences over HTTP: JSON, server-sent events, and OGC API Features for maps.

    The first line printed is "dynhull gateway on http://HOST:PORT". With it running:

        curl http://127.0.0.1:8080/hulls -H 'Content-Type: application/json' -d '{"name": "fleet"}'
        curl http://127.0.0.1:8080/hulls/fleet/points -H 'Content-Type: application/json' -d '[[0, 0], [4, 0], [2, 3]]'
        curl http://127.0.0.1:8080/hulls/fleet
        curl -N http://127.0.0.1:8080/hulls/fleet/events
        ogrinfo OAPIF:http://127.0.0.1:8080

    /openapi.json describes every call. Callers' tokens (Authorization: Bearer) are passed on to the server. A request
    without one is made with the token of the gateway, --token, if it has one: anyone who can reach the gateway may then
    do what that token may do.

    Any number of gateways may serve the same server: they hold nothing. Behind a proxy, see --root-path and
    --forwarded-from.
    """
    from dynhull_client import AsyncHullClient

    from .hosts import hosts_of
    from .serve import listener, run
    from .settings import Settings

    settings = Settings(
        origins=tuple(map(_origin, origin or ())),
        hosts=hosts_of(allow_host, host),
        max_body=max_body * MIB,
        max_upload=max_upload * MIB,
        head_seconds=more_than_0(head_timeout, "--head-timeout"),
        body_seconds=more_than_0(body_timeout, "--body-timeout"),
        reader_seconds=more_than_0(reader_timeout, "--reader-timeout"),
        keepalive_seconds=more_than_0(keepalive, "--keepalive"),
        max_streams=max_streams,
        max_many_streams_per_caller=max_many_streams_per_caller,
        max_subscriptions=max_subscriptions,
        grace_seconds=more_than_0(grace, "--grace"),
        root_path=root_path.rstrip("/"),
        forwarded_from=forwarded_from,
        metrics=None if metrics_port is None else (metrics_host, metrics_port),
    )
    limit = more_than_0(timeout, "--timeout")
    with listener(host, port) as listening:
        run(lambda: connect(AsyncHullClient, timeout=limit, read_ahead=READ_AHEAD), listening, settings)


def _origin(text: str) -> str:
    """An origin as browsers send it. ValueError if it is none."""
    origin = text.lower()
    if origin == "*" or re.fullmatch(r"https?://(\[[0-9a-f:.]+\]|[^\s/?#@:\[\]]+)(:\d+)?", origin):
        return origin
    raise ValueError(
        f"--origin {text!r} must be * or an origin as browsers send it: scheme, host and port without a path, such as "
        "https://pages.example or http://127.0.0.1:8000"
    )
