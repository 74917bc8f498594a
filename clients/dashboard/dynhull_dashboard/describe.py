"""The picture, and where a key is, in words."""

from collections.abc import Iterable

from dynhull_client import HullNotFoundError

from .feed import HullFeed
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


def describe(feeds: Iterable[HullFeed]) -> str:
    """One sentence for each hull."""
    return " ".join(_sentence(feed) for feed in feeds)


def _sentence(feed: HullFeed) -> str:
    if feed.bounds is None:
        return f"{feed.name}: nothing drawn."
    left, bottom, right, top = feed.bounds
    shape = SHAPES.get(feed.vertices, f"a convex polygon with {feed.vertices:,} vertices")
    return (
        f"{feed.name}: {shape} around {feed.points:,} points, x from {left:.6g} to {right:.6g}, "
        f"y from {bottom:.6g} to {top:.6g}, at revision {feed.revision:,}."
    )


def describe_key(key: str, feed: HullFeed, sighting: Sighting) -> list[str]:
    """Where a key is: a sentence, and the coordinates, which change more often."""
    if isinstance(feed.trouble, HullNotFoundError):
        return [f"There is no hull {feed.name}", ""]
    if not feed.keyed:
        return [f"The points of {feed.name} have no keys", ""]
    sentence = SENTENCES[sighting.state].format(key=key, hull=feed.name)
    at = f"x {sighting.x:.12g}, y {sighting.y:.12g}, revision {sighting.revision:,}"
    return [sentence, at if sighting.seen else ""]
