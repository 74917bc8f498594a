"""The picture, fences, and where a key is, in words."""

from collections.abc import Iterable

from dynhull_cli.fences.shown import area_text, subjects_text
from dynhull_client import Fence, HullNotFoundError

from .degrees import axes, position_text
from .event_rows import shortened
from .feed import HullFeed
from .fence_feed import FenceFeed
from .hull_state import HullState
from .many_feed import ManyFeed
from .search import Sighting, State

SHAPES = {1: "a single point", 2: "a segment"}

SENTENCES = {
    State.PENDING: "Looking for {key} in {hull}",
    State.MISSING: "{hull} has no key {key}",
    State.LEFT: "{key} has left {hull}. Last position",
    State.INSIDE: "{key} is inside {hull}",
    State.BOUNDARY: "{key} is on the boundary of {hull}, between two vertices",
    State.VERTEX: "{key} is a vertex of {hull}",
}


EVENTS = {
    "enter": "{} entered",
    "exit": "{} left",
    "cross": "{} passed through",
    "dwell": "{} stayed",
    "missing": "{} is missing",
    "arrived": "{} arrived late",
    "transfer": "{} changed hulls",
}


def describe(hulls: Iterable[HullState], fences: Iterable[FenceFeed] = (), many: Iterable[ManyFeed] = ()) -> str:
    """One sentence for each hull and each prefix, up to three for each fence."""
    return " ".join([*map(_sentence, hulls), *map(_many, many), *map(_fence, fences)])


def _sentence(feed: HullState) -> str:
    if feed.bounds is None:
        return f"{feed.name}: nothing drawn."
    left, bottom, right, top = feed.bounds
    shape = SHAPES.get(feed.vertices, f"a convex polygon with {feed.vertices:,} vertices")
    x, y = axes(feed.center)
    pole = "".join(f" with the {pole} pole inside" for pole in feed.poles)
    return (
        f"{feed.name}: {shape}{pole} around {feed.points:,} points, {x} from {left:.6g} to {right:.6g}, "
        f"{y} from {bottom:.6g} to {top:.6g}, at revision {feed.revision:,}."
    )


def _many(feed: ManyFeed) -> str:
    return f"{feed.prefix}*: the outlines of {len(feed):,} hulls."


def _fence(feed: FenceFeed) -> str:
    if feed.fence is None:
        return f"Fence {feed.name}: {'deleted' if feed.deleted else 'nothing drawn'}."
    margin = f", margin {feed.fence.margin:g}{feed.unit}" if feed.fence.margin else ""
    area = f"Fence {feed.name}: {area_text(feed.fence, feed.unit)}{margin}. {_inside(feed, feed.fence)}."
    last = feed.events.last
    if last is None or last.type not in EVENTS:
        return area
    cause = f", since {last.cause}" if last.cause else ""
    return f"{area} Last event: {EVENTS[last.type].format(last.key)}{cause}."


def _inside(feed: FenceFeed, fence: Fence) -> str:
    if fence.other_hull is not None:
        together = "near each other" if fence.near else "intersecting"
        return f"{fence.area} and {fence.other_hull} are {together if fence.inside else 'apart'}"
    keys = [str(key) for each in feed.inside.subjects for key in each.keys] if feed.inside else []
    names = f": {shortened(keys)}" if keys else ""
    return f"{feed.inside_count:,} of {fence.subject_count:,} keys of {subjects_text(fence)} inside{names}"


def describe_key(key: str, feed: HullFeed, sighting: Sighting) -> list[str]:
    """Where a key is: a sentence, and the coordinates, which change more often."""
    if isinstance(feed.trouble, HullNotFoundError):
        return [f"There is no hull {feed.name}", ""]
    if not feed.keyed:
        return [f"The points of {feed.name} have no keys", ""]
    sentence = SENTENCES[sighting.state].format(key=key, hull=feed.name)
    within = f" ± {sighting.accuracy:.8g}{'' if feed.center is None else ' m'}" if sighting.accuracy else ""
    at = f"{position_text(sighting.x, sighting.y, feed.center)}{within}, revision {sighting.revision:,}"
    return [sentence, at if sighting.seen else ""]
