"""`dynhull top`: the hulls of a server, the busiest first."""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from dynhull_client import HullClient, HullInfo

from .connected import AsJson, connected
from .json_lines import json_line
from .listing import below, listed
from .tab_lines import tab_line


@dataclass(frozen=True, slots=True)
class Row:
    """A hull with its rates, each per second: batches applied, and growth in points."""

    info: "HullInfo"
    batches: float
    growth: float


@connected
def top(
    client: "HullClient",
    prefix: Annotated[str, typer.Argument(metavar="PREFIX", help="Show only hulls whose names begin with this.")] = "",
    interval: Annotated[float, typer.Option(min=0.01, max=86400, help="Seconds between two readings.")] = 1.0,
    looks: Annotated[
        int | None,
        typer.Option(min=1, max=sys.maxsize, help="End after this many readings. Default: 1; on a terminal, never."),
    ] = None,
    rows: Annotated[int, typer.Option(min=1, help="Show at most this many hulls.")] = 25,
    as_json: AsJson = False,
) -> None:
    """Show hulls with their sizes and rates, the busiest first.

        dynhull top fleet/ --interval 5

    A line has, between tabs: name, revision, points, distinct points, batches per second, and points gained per second.
    """
    from rich.console import Console
    from rich.live import Live

    console = Console(highlight=False)
    live = console.is_terminal and not as_json
    tables = islice(_readings(client, prefix, interval), looks if looks or live else 1)
    if live:
        with Live(console=console, auto_refresh=False) as screen:
            for table in tables:
                screen.update(_shown(table[:rows]), refresh=True)
        return
    for table in tables:
        for row in listed(table[:rows], below("hulls", prefix)):
            info = row.info
            if as_json:
                members = {"revision": info.revision, "points": info.points, "distinct": info.distinct}
                typer.echo(json_line(name=info.name, **members, batches=row.batches, growth=row.growth))
            else:
                typer.echo(tab_line(info.name, info.revision, info.points, info.distinct, row.batches, row.growth))


def _readings(client: "HullClient", prefix: str, interval: float) -> Iterator[list[Row]]:
    """All hulls after each interval, the busiest first, then the largest."""
    before, then = {info.uid: info for info in client.list_hulls(prefix)}, time.monotonic()
    while True:
        time.sleep(interval)
        infos, now = list(client.list_hulls(prefix)), time.monotonic()
        rows = []
        for info in infos:
            last = before.get(info.uid, info)
            passed = now - then
            rows.append(Row(info, (info.revision - last.revision) / passed, (info.points - last.points) / passed))
        yield sorted(rows, key=lambda row: (-row.batches, -row.info.points, row.info.name))
        before, then = {info.uid: info for info in infos}, now


def _shown(rows: list[Row]) -> "Table":
    from rich.table import Table

    table = Table()
    table.add_column("hull")
    for heading in ("revision", "points", "distinct", "batches/s", "points/s"):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(*_cells(row))
    return table


def _cells(row: Row) -> list[str]:
    info = row.info
    counts = [f"{each:,}" for each in (info.revision, info.points, info.distinct)]
    return [info.name, *counts, f"{row.batches:,.1f}", f"{row.growth:+,.0f}"]
