"""Many hulls as a live table, as lines of text or as lines of JSON."""

import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import islice

import typer
from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from dynhull_client import DynhullError, ManyChange, ManyWatch

from .closed_pipe import when_pipe_closes
from .json_lines import json_line, members
from .tab_lines import tab_line

HEADINGS = ("revision", "points", "vertices", "area", "perimeter", "diameter", "changed")
ABOUT_A_HULL = ("state", "gone", "unchanged")


class Followed:
    """The newest states of the hulls of a watch, which a thread follows.

    Args:
        watch: the watch.
    """

    def __init__(self, watch: ManyWatch) -> None:
        self._watch = watch
        self._states: dict[str, ManyChange] = {}
        self._complete = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def states(self) -> list[ManyChange]:
        """The states now, once there are all; raises what the watch has ended with."""
        self._complete.wait()
        if self._error is not None:
            raise self._error
        return list(self._states.copy().values())

    @property
    def lost(self) -> DynhullError | None:
        """Why the states may be old: the connection is lost. None while it is not."""
        return self._watch.lost

    def _run(self) -> None:
        try:
            for change in self._watch:
                if change.kind == "state":
                    self._states[change.hull] = change
                elif change.kind == "gone":
                    self._states.pop(change.hull, None)
                elif change.kind == "complete":
                    self._complete.set()
        except Exception as error:  # whatever it is, who asks for the states must not wait for ever
            self._error = error
        self._complete.set()


def follow_many(watch: ManyWatch, what: str, *, events: int | None, rows: int, as_json: bool) -> None:
    """Print what becomes of hulls: lines of JSON, a live table on a terminal, or else lines of text.

    It returns after that number of changes of hulls; None for never.
    """
    console = Console(highlight=False, markup=False)
    changes = islice((change for change in watch if as_json or change.kind in ABOUT_A_HULL), events)
    if not as_json and console.is_terminal:
        _show(console, what, watch, changes, rows)
        return
    if not console.is_terminal:
        when_pipe_closes(watch.close)
    for change in changes:
        typer.echo(_json(change) if as_json else _line(change))


def _show(console: Console, what: str, watch: ManyWatch, changes: Iterator[ManyChange], rows: int) -> None:
    states: dict[str, ManyChange] = {}

    def table() -> Table:
        shown = Table(title=f"{len(states):,} hulls {what}, the last changed first", caption=lost_caption(watch.lost))
        shown.add_column("hull")
        for heading in HEADINGS:
            shown.add_column(heading, justify="right")
        for state in islice(reversed(list(states.values())), rows):
            shown.add_row(state.hull, *_cells(state))
        return shown

    with Live(get_renderable=table, console=console):
        for change in changes:
            states.pop(change.hull, None)
            if change.kind == "state":
                states[change.hull] = change


def lost_caption(lost: DynhullError | None) -> Text | None:
    """What to say below a table while the connection of its watch is lost."""
    return Text(f"connection lost, trying again: {lost}", "red") if lost else None


def _cells(state: ManyChange) -> list[str]:
    counts = [f"{each:,}" for each in (state.revision, state.points, state.vertex_count)]
    measures = state.measures
    sizes = [measures.area, measures.perimeter, measures.diameter] if measures is not None else []
    shown = [f"{each:.6g}" for each in sizes] or ["", "", ""]
    return [*counts, *shown, "" if state.changed is None else _ago(state.changed)]


def _ago(time: datetime) -> str:
    """How long ago something was, by the clock of this machine."""
    seconds = max((datetime.now(UTC) - time).total_seconds(), 0.0)
    for unit, length in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} s"


def _line(change: ManyChange) -> str:
    measures = change.measures
    sizes = ("", "") if measures is None else (measures.area, measures.perimeter)
    if change.kind != "state":
        return tab_line(change.kind, change.hull)
    return tab_line(change.kind, change.hull, change.revision, change.points, change.vertex_count, *sizes)


def _json(change: ManyChange) -> str:
    """The members that mean something for the kind of change."""
    position = None if change.position is None else change.position.hex()
    if change.kind != "state":
        named = {"hull": change.hull} if change.hull else {}
        return json_line(kind=change.kind, **named, position=position)
    without = () if change.vertices is not None else ("vertices", "error")
    state = {name: value for name, value in members(change).items() if name not in without}
    return json_line(**state | {"position": position})
