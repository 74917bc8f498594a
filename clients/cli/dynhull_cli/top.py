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

    from dynhull_client import DynhullError, HullClient, ManyChange

from .connected import AsJson, connected
from .json_lines import json_line
from .listing import below, listed
from .tab_lines import tab_line


@dataclass(frozen=True, slots=True)
class Row:
    """A hull with its rates, each per second: batches applied, and growth in points."""

    state: "ManyChange"
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
    readings = islice(_readings(client, prefix, interval), looks if looks or live else 1)
    if live:
        with Live(console=console, auto_refresh=False) as screen:
            for table, lost in readings:
                screen.update(_shown(table[:rows], lost), refresh=True)
        return
    for table, _ in readings:
        for row in listed(table[:rows], below("hulls", prefix)):
            state = row.state
            if as_json:
                members = {"revision": state.revision, "points": state.points, "distinct": state.distinct}
                typer.echo(json_line(name=state.hull, **members, batches=row.batches, growth=row.growth))
            else:
                typer.echo(tab_line(state.hull, state.revision, state.points, state.distinct, row.batches, row.growth))


def _readings(client: "HullClient", prefix: str, interval: float) -> Iterator[tuple[list[Row], "DynhullError | None"]]:
    """All hulls after each interval, the busiest first, then the largest; and why they may be old."""
    from .many import Followed

    with client.watch_many(prefix, max_rate=max(10.0, 2 / interval)) as watch:
        followed = Followed(watch)
        before, then = {state.uid: state for state in followed.states()}, time.monotonic()
        while True:
            time.sleep(interval)
            states, now = followed.states(), time.monotonic()
            rows = []
            for state in states:
                last = before.get(state.uid, state)
                passed = now - then
                grown = (state.points - last.points) / passed
                rows.append(Row(state, (state.revision - last.revision) / passed, grown))
            yield sorted(rows, key=lambda row: (-row.batches, -row.state.points, row.state.hull)), followed.lost
            before, then = {state.uid: state for state in states}, now


def _shown(rows: list[Row], lost: "DynhullError | None") -> "Table":
    from rich.table import Table

    from .many import lost_caption

    table = Table(caption=lost_caption(lost))
    table.add_column("hull")
    for heading in ("revision", "points", "distinct", "batches/s", "points/s"):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(*_cells(row))
    return table


def _cells(row: Row) -> list[str]:
    state = row.state
    counts = [f"{each:,}" for each in (state.revision, state.points, state.distinct)]
    return [state.hull, *counts, f"{row.batches:,.1f}", f"{row.growth:+,.0f}"]
