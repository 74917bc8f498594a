"""The changes of a hull as a live table, as lines of text or as lines of JSON."""

from collections import deque
from dataclasses import asdict
from itertools import islice

import numpy as np
import typer
from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from dynhull_client import Change, Event, HullClient, HullCopy, Measures, Points, Snapshot, Watch

from .closed_pipe import when_pipe_closes
from .json_lines import json_line
from .tab_lines import tab_line

SHOWN_EVENTS = 12
NOTHING = np.empty((0, 2))


def follow(client: HullClient, name: str, *, max_rate: float, events: int | None, as_json: bool) -> None:
    """Print the changes of a hull: lines of JSON, a live table on a terminal, or else lines of text.

    It returns after that number of events; None for never.
    """
    copy = HullCopy()
    console = Console(highlight=False)
    with client.watch(name, max_rate=max_rate, measures=True, copy=copy) as stream:
        if not console.is_terminal:
            when_pipe_closes(stream.close)
        if as_json:
            for event in islice(stream, events):
                typer.echo(_json(event))
        elif console.is_terminal:
            _show(console, name, stream, copy, events)
        else:
            for event in islice(stream, events):
                typer.echo(_line(event, copy))


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


def _line(event: Event, copy: HullCopy) -> str:
    added, removed = _difference(event)
    measures = _measures(event)
    sizes = ("", "") if measures is None else (measures.area, measures.perimeter)
    return tab_line(event.revision, event.points, len(copy.vertices), len(added), len(removed), *sizes)


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
