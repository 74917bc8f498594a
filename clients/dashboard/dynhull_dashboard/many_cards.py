"""The table of the hulls of prefixes: those that have changed last."""

import math
import time
from collections.abc import Iterable
from html import escape

from .cards import key, number
from .degrees import SQUARE_KILOMETRE
from .looks import Look
from .many_feed import ManyFeed, Outlined

MOST_ROWS = 12
HEADINGS = "Revision", "Points", "Vertices", "Area{area}", "Changed"


def many_table(shown: Iterable[tuple[ManyFeed, Look]], *, connected: bool, area_unit: str) -> str:
    """A table for each prefix as HTML, the last changed first. On a narrow page its rows are cards."""
    return "".join(_table(feed, look, connected, area_unit) for feed, look in shown)


def about_many(feed: ManyFeed) -> str | None:
    """Why the hulls of a prefix cannot be followed; None where they can."""
    if feed.trouble is not None:
        return str(feed.trouble)
    return None if feed.complete else "Waiting for the server"


def _table(feed: ManyFeed, look: Look, connected: bool, area_unit: str) -> str:
    problem = about_many(feed) if connected else "Connection lost"
    count = f"{len(feed):,} hulls" if len(feed) != 1 else "1 hull"
    words = (
        f"the last {MOST_ROWS} that changed of {count}" if len(feed) > MOST_ROWS else f"{count}, the last changed first"
    )
    state = f'<span class="bad">✗ {escape(problem)}</span>' if problem else words
    rows = feed.newest(MOST_ROWS)
    plane = any(row.state is not None and row.state.center is None for row in rows)
    headings = [heading.format(area=f" ({escape(area_unit)})" if area_unit and plane else "") for heading in HEADINGS]
    head = "".join(f'<th scope="col">{heading}</th>' for heading in ("Hull", *headings))
    body = "".join(_row(row, headings) for row in rows)
    caption = f"<caption>{key(look)} {escape(feed.prefix)}*: {state}</caption>"
    return f'<table class="many">{caption}<thead><tr>{head}</tr></thead>{body}</table>'


def _row(row: Outlined, headings: Iterable[str]) -> str:
    state = row.state
    assert state is not None  # it is one of those that are there
    area = math.nan if state.measures is None else state.measures.area
    shown = number(area) if state.center is None else f"{number(area / SQUARE_KILOMETRE)} km²"
    figures = f"{state.revision:,}", f"{state.points:,}", f"{state.vertex_count:,}", shown, _ago(row)
    cells = "".join(
        f'<td data-heading="{heading}">{figure}</td>' for heading, figure in zip(headings, figures, strict=True)
    )
    return f'<tr><th scope="row">{escape(state.hull)}</th>{cells}</tr>'


def _ago(row: Outlined) -> str:
    """How long ago it changed, by the clock of the server."""
    state = row.state
    if state is None or state.changed is None:
        return "-"
    seconds = max(time.time() - state.changed.timestamp(), 0)
    for unit, length in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= length:
            return f"{seconds / length:.0f} {unit} ago"
    return f"{seconds:.0f} s ago"
