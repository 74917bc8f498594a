"""The table of fences."""

from collections.abc import Collection, Iterable
from html import escape

from dynhull_cli.fences.shown import area_text, settings_text, subjects_text
from dynhull_client import Fence, FenceConsumer

from .advice import about_fence
from .cards import UNKNOWN, key
from .fence_drawing import area_hulls
from .fence_feed import FenceFeed
from .looks import Look

# Columns of words, and of figures.
HEADINGS = {"Area": "words", "Subjects": "words", "Inside": "", "Events": "", "Consumers": "words"}
LAST_HEADING = "Settings"
MOST_CONSUMERS = 3


def fence_table(shown: Iterable[tuple[FenceFeed, Look]], hulls: Collection[str], connected: bool) -> str:
    """A table of the fences as HTML, empty without fences. On a narrow page its rows are cards.

    Args:
        shown: the fences and their looks.
        hulls: the hulls in the picture.
        connected: whether the server answers.
    """
    classes = {"Fence": "words", **HEADINGS, LAST_HEADING: "words"}
    headings = "".join(f'<th scope="col" class="{kind}">{heading}</th>' for heading, kind in classes.items())
    rows = "".join(_row(feed, look, hulls, connected) for feed, look in shown)
    return f"<table><thead><tr>{headings}</tr></thead>{rows}</table>" if rows else ""


def _row(feed: FenceFeed, look: Look, hulls: Collection[str], connected: bool) -> str:
    fence = feed.fence
    figures = (UNKNOWN,) * len(HEADINGS) if fence is None else _figures(feed, fence)
    cells = "".join(
        f'<td data-heading="{heading}" class="{kind}">{escape(figure)}</td>'
        for (heading, kind), figure in zip(HEADINGS.items(), figures, strict=True)
    )
    problem = about_fence(feed) if connected else "Connection lost"
    if problem is not None or fence is None:
        state = f'<span class="bad">✗ {escape(problem or "Connection lost")}</span>'
    else:
        state = escape(". ".join(filter(None, (settings_text(fence), _hidden(fence, hulls)))))
    return f'<tr><th scope="row">{key(look)}{escape(feed.name)}</th>{cells}<td class="state">{state}</td></tr>'


def _figures(feed: FenceFeed, fence: Fence) -> tuple[str, ...]:
    area = area_text(fence, feed.unit)
    if feed.area.drawn < feed.area.corners:
        area += f" ({feed.area.drawn:,} drawn)"
    consumers = [_consumer(each) for each in fence.consumers[:MOST_CONSUMERS]]
    if more := len(fence.consumers) - len(consumers):
        consumers.append(f"{more:,} more")
    return area, subjects_text(fence), _inside(feed, fence), f"{fence.last_sequence:,}", ", ".join(consumers) or "none"


def _inside(feed: FenceFeed, fence: Fence) -> str:
    if fence.other_hull is not None:
        near = ("apart", "near") if fence.near else ("apart", "intersecting")
        return near[fence.inside > 0]
    inside = f"{feed.inside_count:,} of {fence.subject_count:,}"
    marked = min(len(feed.marks), feed.inside_count)
    return inside if marked >= feed.inside_count else f"{inside} ({marked:,} drawn)"


def _consumer(consumer: FenceConsumer) -> str:
    lost = f", {consumer.lost:,} lost" if consumer.lost else ""
    return f"{consumer.name}: {consumer.backlog:,} waiting{lost}"


def _hidden(fence: Fence, hulls: Collection[str]) -> str:
    """Which hulls to pick to see the area; empty where it is in the picture."""
    hidden = [name for name in area_hulls(fence) if name not in hulls]
    return f"Pick {' and '.join(hidden)} above to see the area" if hidden else ""
