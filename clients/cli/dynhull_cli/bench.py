"""`dynhull bench`: the speed of a server, measured by one client."""

from typing import TYPE_CHECKING, Annotated
from uuid import uuid4

import typer

from .connected import AsJson, connected
from .json_lines import json_line

if TYPE_CHECKING:
    from dynhull_client import HullClient


@connected
def bench(
    client: "HullClient",
    seconds: Annotated[float, typer.Option(min=0.1, help="Seconds of writing, and seconds of reading.")] = 5.0,
    points: Annotated[int, typer.Option(min=1, help="Points in the hull.")] = 100_000,
    batch: Annotated[int, typer.Option(min=1, help="Points that each batch moves.")] = 1000,
    in_flight: Annotated[int, typer.Option(min=1, help="Batches under way at the same time.")] = 32,
    as_json: AsJson = False,
) -> None:
    """Measure the speed of a server with a hull that the command creates and deletes.

        dynhull bench --batch 1 --in-flight 256

    First it writes: points from a normal distribution move, the oldest first; a move counts as two updates. The delay
    of a batch lasts from its sending to its acknowledgement, while other batches are under way. Then it reads: single
    points are located, one after the other.
    """
    from .speed import read_speed, write_speed

    name = f"bench-{uuid4().hex}"
    client.create_hull(name)
    try:
        figures = write_speed(client, name, seconds, max(points, batch), batch, in_flight)
        figures |= read_speed(client, name, seconds)
    finally:
        client.delete_hull(name)
    if as_json:
        typer.echo(json_line(points=points, batch=batch, in_flight=in_flight, **figures))
        return
    typer.echo(f"{figures['updates_per_second']:,.0f} updates per second")
    for what in ("acknowledgement", "locate"):
        median, tail = figures[f"{what}_ms_median"], figures[f"{what}_ms_p99"]
        typer.echo(f"{what}: median {median:.2f} ms, 99th percentile {tail:.2f} ms")
