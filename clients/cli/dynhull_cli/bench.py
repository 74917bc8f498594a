"""`dynhull bench`: the speed of a server, measured by one client."""

from functools import partial
from time import perf_counter
from typing import Annotated
from uuid import uuid4

import numpy as np
import typer

from dynhull_client import HullClient

from .connected import AsJson, connected
from .json_lines import json_line

Milliseconds = list[float]


@connected
def bench(
    client: HullClient,
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
    name = f"bench-{uuid4().hex}"
    client.create_hull(name)
    try:
        figures = _write(client, name, seconds, max(points, batch), batch, in_flight) | _read(client, name, seconds)
    finally:
        client.delete_hull(name)
    if as_json:
        typer.echo(json_line(points=points, batch=batch, in_flight=in_flight, **figures))
        return
    typer.echo(f"{figures['updates_per_second']:,.0f} updates per second")
    for what in ("acknowledgement", "locate"):
        median, tail = figures[f"{what}_ms_median"], figures[f"{what}_ms_p99"]
        typer.echo(f"{what}: median {median:.2f} ms, 99th percentile {tail:.2f} ms")


def _write(client: HullClient, name: str, seconds: float, points: int, batch: int, in_flight: int) -> dict[str, float]:
    rng = np.random.default_rng(0)
    there = rng.normal(size=(points, 2))
    delays: Milliseconds = []

    def delayed(sent: float, _: object) -> None:
        delays.append(1e3 * (perf_counter() - sent))

    with client.writer(name, batch_points=1, in_flight=in_flight) as writer:
        for part in np.array_split(there, -(-points // 8192)):
            writer.put(insert=part)
        writer.flush()
        begun, moved, first = perf_counter(), 0, 0
        while perf_counter() - begun < seconds:
            rows = np.arange(first, first + batch) % points
            fresh = rng.normal(size=(batch, 2))
            writer.put(move=(there[rows], fresh)).add_done_callback(partial(delayed, perf_counter()))
            there[rows] = fresh
            first, moved = (first + batch) % points, moved + batch
        writer.flush()
        passed = perf_counter() - begun
    return {"updates_per_second": 2 * moved / passed, **_summary("acknowledgement", delays)}


def _read(client: HullClient, name: str, seconds: float) -> dict[str, float]:
    rng = np.random.default_rng(1)
    delays: Milliseconds = []
    begun = perf_counter()
    while perf_counter() - begun < seconds:
        sent = perf_counter()
        client.locate(name, rng.normal(size=(1, 2)) * 4)
        delays.append(1e3 * (perf_counter() - sent))
    return _summary("locate", delays)


def _summary(what: str, delays: Milliseconds) -> dict[str, float]:
    median, tail = np.quantile(delays, [0.5, 0.99]).tolist()
    return {f"{what}_ms_median": median, f"{what}_ms_p99": tail}
