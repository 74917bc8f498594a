"""The changes of a hull as a live table, as lines of text or as lines of JSON."""

from collections import deque
from dataclasses import dataclass
from datetime import datetime
from itertools import islice
from typing import Any

import numpy as np
import typer
from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from dynhull_client import (
    Change,
    Deleted,
    Event,
    HullClient,
    HullCopy,
    Measures,
    Points,
    Replay,
    Sketch,
    Snapshot,
    Watch,
)

from .closed_pipe import when_pipe_closes
from .json_lines import json_line, members
from .tab_lines import printable, tab_line

SHOWN_EVENTS = 12
NOTHING = np.empty((0, 2))


@dataclass(frozen=True, slots=True)
class Shown:
    """What to follow of a hull.

    Attributes:
        max_rate: the most events a second, 0 for all.
        keys: whether to name the vertices.
        layer: the convex layer, from 1.
        max_vertices: the most vertices of an event, None for all.
    """

    max_rate: float
    keys: bool
    layer: int
    max_vertices: int | None

    def watch(self, client: HullClient, name: str, copy: HullCopy) -> Watch:
        """The watch, which updates the copy. An event with few of the vertices has all of these."""
        return client.watch(name, copy=copy, **self._options())

    def replay(self, client: HullClient, name: str, copy: HullCopy, played: "Played") -> Replay:
        """The same of the past."""
        return client.replay(
            name, played.start, played.end, speed=played.speed, every=played.every, copy=copy, **self._options()
        )

    def _options(self) -> dict[str, Any]:
        return {
            "max_rate": self.max_rate,
            "measures": True,
            "keys": self.keys,
            "outline": self.max_vertices is not None,
            "layer": self.layer,
            "max_vertices": self.max_vertices,
        }


@dataclass(frozen=True, slots=True)
class Played:
    """What to play of the past of a hull: where it begins and ends, how fast, and the seconds between events."""

    start: int | str | None
    end: int | str | None
    speed: float
    every: float | None


class Corners:
    """The keys of the vertices, and their difference to those before."""

    def __init__(self, copy: HullCopy) -> None:
        self.joined: list[str | int] = []
        self.left: list[str | int] = []
        self._copy = copy
        self._keys: tuple[str, ...] | tuple[int, ...] = ()

    def update(self, event: Event) -> None:
        """Compare the keys after an event with those after the one before."""
        before, self._keys = self._keys, (event.keys if isinstance(event, Sketch) else self._copy.vertex_keys) or ()
        self.joined = [key for key in self._keys if key not in set(before)]
        self.left = [key for key in before if key not in set(self._keys)]

    def difference(self) -> str:
        """The keys that came and went, for people."""
        return printable(" ".join([*(f"+{key}" for key in self.joined), *(f"-{key}" for key in self.left)]))


def follow(
    client: HullClient, name: str, shown: Shown, *, played: Played | None = None, events: int | None, as_json: bool
) -> None:
    """Print the changes of a hull, or of its past: lines of JSON, a live table on a terminal, or else lines of text.

    It returns after that number of events; None for never.
    """
    copy = HullCopy()
    corners = Corners(copy) if shown.keys else None
    console = Console(highlight=False, markup=False)
    stream = shown.watch(client, name, copy) if played is None else shown.replay(client, name, copy, played)
    with stream:
        if not as_json and console.is_terminal:
            _show(console, name, stream, copy, corners, events)
            return
        if not console.is_terminal:
            when_pipe_closes(stream.close)
        for event in islice(stream, events):
            if corners is not None:
                corners.update(event)
            typer.echo(_json(event, corners) if as_json else _line(event, copy, corners, timed=played is not None))


def _show(
    console: Console, name: str, stream: Watch | Replay, copy: HullCopy, corners: Corners | None, events: int | None
) -> None:
    recent: deque[list[str]] = deque(maxlen=SHOWN_EVENTS)
    changed: datetime | None = None

    def table() -> Table:
        lost = Text(f"connection lost, trying again: {stream.lost}", "red") if stream.lost else None
        shown = Table(title=f"{name} at revision {copy.revision:,}{_of(changed)}", caption=lost)
        for heading in ("revision", "points", "vertices", "change", "area", "perimeter"):
            shown.add_column(heading, justify="right")
        if corners is not None:
            shown.add_column("keys")
        for cells in recent:
            shown.add_row(*cells)
        return shown

    with Live(get_renderable=table, console=console):
        for event in islice(stream, events):
            if corners is not None:
                corners.update(event)
            recent.append(_cells(event, copy, corners))
            changed = _changed(event)


def _cells(event: Event, copy: HullCopy, corners: Corners | None) -> list[str]:
    measures = _measures(event)
    areas = [f"{measures.area:.6g}", f"{measures.perimeter:.6g}"] if measures else []
    names = [] if corners is None else [corners.difference()]
    return [
        f"{event.revision:,}",
        f"{event.points:,}",
        f"{len(event.vertices if isinstance(event, Sketch) else copy.vertices):,}",
        _change(event),
        *(areas or ([""] * 2 if names else [])),
        *names,
    ]


def _change(event: Event) -> str:
    """The change of the vertices for people; of few of the vertices, how far the hull reaches beyond them."""
    if isinstance(event, Sketch):
        return f"within {event.error:.3g}"
    added, removed = _difference(event)
    return f"+{len(added):,} -{len(removed):,}"


def _of(changed: datetime | None) -> str:
    """When a revision was committed, for people."""
    return "" if changed is None else f" of {changed:%Y-%m-%d %H:%M:%S} UTC"


def _changed(event: Event) -> datetime | None:
    return None if isinstance(event, Deleted) else event.changed


def _line(event: Event, copy: HullCopy, corners: Corners | None, *, timed: bool) -> str:
    measures = _measures(event)
    sizes = ("", "") if measures is None else (measures.area, measures.perimeter)
    named = () if corners is None else (corners.difference(),)
    changed = _changed(event)
    head = [event.revision, *(["" if changed is None else changed.isoformat()] if timed else []), event.points]
    if isinstance(event, Sketch):
        return tab_line(*head, len(event.vertices), *sizes, event.error, *named)
    added, removed = _difference(event)
    return tab_line(*head, len(copy.vertices), len(added), len(removed), *sizes, *named)


def _json(event: Event, corners: Corners | None) -> str:
    added, removed = _difference(event)
    measures = _measures(event)
    vertices: dict[str, Points | float] = {"added": added, "removed": removed}
    if isinstance(event, Sketch):
        vertices = {"vertices": event.vertices, "error": event.error}
    return json_line(
        revision=event.revision,
        points=event.points,
        snapshot=isinstance(event, Snapshot),
        **vertices,
        changed=_changed(event),
        **({"erased": True} if not isinstance(event, Deleted) and event.erased else {}),
        **({} if measures is None else members(measures)),
        **({} if corners is None else {"joined": corners.joined, "left": corners.left}),
    )


def _difference(event: Event) -> tuple[Points, Points]:
    """Vertices added, vertices removed."""
    if isinstance(event, Snapshot):
        return event.vertices, NOTHING
    return (event.added, event.removed) if isinstance(event, Change) else (NOTHING, NOTHING)


def _measures(event: Event) -> Measures | None:
    return event.measures if isinstance(event, Snapshot | Change | Sketch) else None
