"""The table of hulls."""

import math
import time
from collections.abc import Callable, Iterable
from html import escape
from typing import TypeVar

from dynhull_client import Verification

from .advice import about_hull, about_past
from .feed import HullFeed, Verified
from .hull_state import HullState
from .looks import Look
from .past_play import PastHull

MARKERS = {
    "circle": '<circle cx="20" cy="8" r="5"/>',
    "square": '<rect x="15.5" y="3.5" width="9" height="9"/>',
    "triangle": '<path d="M20 2.5l5.5 10h-11z"/>',
    "diamond": '<path d="M20 2l4.5 6-4.5 6-4.5-6z"/>',
    "inverted_triangle": '<path d="M20 13.5l5.5-10h-11z"/>',
    "star": '<path d="M20 1.5l1.9 4.3 4.7.5-3.5 3.1 1 4.6-4.1-2.4-4.1 2.4 1-4.6-3.5-3.1 4.7-.5z"/>',
    "hex": '<path d="M20 2.5l5 2.8v5.4l-5 2.8-5-2.8V5.3z"/>',
}
HEADINGS = ("Revision", "Points", "Vertices", "Area{area}", "Batches/s")
LAST_HEADING = "Live hull against Chan's algorithm"
PAST_HEADING, AS_IT_WAS = "The past", "As it was"
UNKNOWN = "-"
DIGITS, RATE_DIGITS = 6, 3
NOW_SECONDS, SECONDS_UP_TO = 2.0, 120.0


State = TypeVar("State", HullFeed, PastHull)


def table(shown: Iterable[tuple[HullFeed, Look]], connected: bool, area_unit: str) -> str:
    """A table of the hulls as HTML, empty without hulls. On a narrow page its rows are cards.

    `area_unit`: of hulls in a plane; areas on the globe have their own.
    """

    def live(feed: HullFeed) -> str:
        problem = about_hull(feed) if connected else "Connection lost"
        return _verified(feed.verified) if problem is None else _bad(problem)

    return _table(shown, area_unit, LAST_HEADING, live)


def past_table(shown: Iterable[tuple[PastHull, Look]], area_unit: str) -> str:
    """The same table of hulls as they were."""

    def past(hull: PastHull) -> str:
        problem = about_past(hull)
        return AS_IT_WAS if problem is None else _bad(problem)

    return _table(shown, area_unit, PAST_HEADING, past)


def _table(shown: Iterable[tuple[State, Look]], area_unit: str, last: str, state: Callable[[State], str]) -> str:
    shown = list(shown)
    area = f" ({escape(area_unit)})" if any(feed.center is None for feed, _ in shown) else ""
    names: list[str] = [heading.format(area=area) for heading in HEADINGS]
    headings = "".join(f'<th scope="col">{heading}</th>' for heading in ("Hull", *names, last))
    rows = "".join(_row(feed, look, names, state(feed)) for feed, look in shown)
    return f"<table><thead><tr>{headings}</tr></thead>{rows}</table>" if rows else ""


def _row(feed: HullState, look: Look, headings: Iterable[str], state: str) -> str:
    cells = "".join(
        f'<td data-heading="{heading}">{figure}</td>' for heading, figure in zip(headings, _figures(feed), strict=True)
    )
    return f'<tr><th scope="row">{key(look)}{escape(feed.name)}</th>{cells}<td class="state">{state}</td></tr>'


def _bad(problem: str) -> str:
    return f'<span class="bad">✗ {escape(problem)}</span>'


def _figures(feed: HullState) -> tuple[str, ...]:
    if not feed.followed:
        return (UNKNOWN,) * len(HEADINGS)
    outline, _ = feed.drawings()
    drawn = len(outline.points)
    vertices = f"{feed.vertices:,}" if drawn == feed.vertices else f"{feed.vertices:,} ({drawn:,} drawn)"
    return f"{feed.revision:,}", f"{feed.points:,}", vertices, _area(feed), number(feed.rate, RATE_DIGITS)


def _area(feed: HullState) -> str:
    """The area; of a geographic hull with its own unit, whatever that of the others."""
    return number(feed.shown_area) + ("" if feed.center is None else " km²")


def symbol(look: Look) -> str:
    """The marker alone as SVG."""
    marker = MARKERS[look.marker]
    return f'<svg width="16" height="16" viewBox="12 0 16 16" fill="{look.colour}" aria-hidden="true">{marker}</svg>'


def key(look: Look) -> str:
    """The line and marker of a hull as SVG, for a legend."""
    marker = MARKERS.get(look.marker, "")
    dash = " ".join(map(str, look.dash))
    return (
        f'<svg width="40" height="16" fill="{look.colour}" aria-hidden="true"><path d="M0 8h40" stroke="{look.colour}" '
        f'stroke-width="2" stroke-dasharray="{dash}"/>{marker}</svg>'
    )


def _verified(verified: Verified | None) -> str:
    if verified is None:
        return "… not verified yet"
    when = _ago(time.monotonic() - verified.at)
    outcome = verified.outcome
    if outcome.whole:
        return f'<span class="good">✓ equal</span> at revision {outcome.revision:,}, {when}'
    return f'<span class="bad">✗ different</span> at revision {outcome.revision:,}: {_difference(outcome)}'


def _difference(outcome: Verification) -> str:
    if outcome.difference is not None:
        vertex = outcome.difference
        return f"vertex {vertex.row} is {vertex.live}, recomputed {vertex.recomputed}"
    if not outcome.keys_equal:
        return "the points are not the positions of the keys"
    return f"the fence {escape(outcome.fence_differences[0].fence)}"


def _ago(seconds: float) -> str:
    if seconds < NOW_SECONDS:
        return "just now"
    return f"{seconds:.0f} s ago" if seconds < SECONDS_UP_TO else f"{seconds / 60:.0f} min ago"


def number(value: float, digits: int = DIGITS) -> str:
    """A figure as the page shows it."""
    if math.isnan(value):
        return UNKNOWN
    return f"{value:,.0f}" if 1000 <= abs(value) < 1e15 else f"{value:.{digits}g}"
