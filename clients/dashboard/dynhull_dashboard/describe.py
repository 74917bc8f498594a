"""The picture in words, for those who cannot see it."""

from collections.abc import Iterable

from .feed import HullFeed

SHAPES = {1: "a single point", 2: "a segment"}


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
