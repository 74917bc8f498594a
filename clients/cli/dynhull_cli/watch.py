"""`dynhull watch`: the changes of a hull, live."""

from collections import deque
from dataclasses import asdict
from itertools import islice
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from dynhull_client import Change, Event, HullClient, HullCopy, Measures, Points, Snapshot, Watch

from .connected import AsJson, HullName, connected
from .json_lines import json_line

SHOWN_EVENTS = 12
NOTHING = np.empty((0, 2))


@connected
def watch(
    client: HullClient,
    name: HullName,
    as_json: AsJson = False,
    max_rate: Annotated[float, typer.Option(min=0, help="At most this many events per second; 0 for all.")] = 10.0,
    events: Annotated[int | None, typer.Option(min=1, help="End after this many events.")] = None,
) -> None:
    """Follow the changes of a hull: a live table on a terminal, one line per event elsewhere.

        dynhull watch fleet/north --json | jq -c .added

    With --json, each event has the revision, the number of points, the measures, and the vertices added and removed
    since the event before. The first event has "snapshot": true and adds all vertices. After a lost connection the
    watch resumes by itself, with the changes it missed or, if the server no longer has them, with a new snapshot.
    """
    copy = HullCopy()
    console = Console(highlight=False)
    with client.watch(name, max_rate=max_rate, measures=True, copy=copy) as stream:
        if as_json:
            for event in islice(stream, events):
                typer.echo(_json(event))
        elif console.is_terminal:
            _show(console, name, stream, copy, events)
        else:
            for event in islice(stream, events):
                typer.echo("  ".join(_cells(event, copy)))


def _show(console: Console, name: str, stream: Watch, copy: HullCopy, events: int | None) -> None:
    recent: deque[list[str]] = deque(maxlen=SHOWN_EVENTS)

    def table() -> Table:
        lost = Text(f"connection lost, trying again: {stream.lost}", "red") if stream.lost else None
        shown = Table(title=f"{name} at revision {copy.revision:,}", caption=lost)
        for heading in ("revision", "points", "vertices", "change", "area", "perimeter"):
            shown.add_column(heading, justify="right")
        for cells in recent:
            shown.add_row(*cells)
        return shown

    with Live(get_renderable=table, console=console):
        for event in islice(stream, events):
            recent.append(_cells(event, copy))


def _cells(event: Event, copy: HullCopy) -> list[str]:
    added, removed = _difference(event)
    measures = _measures(event)
    return [
        f"{event.revision:,}",
        f"{event.points:,}",
        f"{len(copy.vertices):,}",
        f"+{len(added):,} -{len(removed):,}",
        *([f"{measures.area:.6g}", f"{measures.perimeter:.6g}"] if measures else []),
    ]


def _json(event: Event) -> str:
    added, removed = _difference(event)
    measures = _measures(event)
    return json_line(
        revision=event.revision,
        points=event.points,
        snapshot=isinstance(event, Snapshot),
        added=added,
        removed=removed,
        **({} if measures is None else asdict(measures)),
    )


def _difference(event: Event) -> tuple[Points, Points]:
    """Vertices added, vertices removed."""
    if isinstance(event, Snapshot):
        return event.vertices, NOTHING
    return (event.added, event.removed) if isinstance(event, Change) else (NOTHING, NOTHING)


def _measures(event: Event) -> Measures | None:
    return event.measures if isinstance(event, Snapshot | Change) else None
