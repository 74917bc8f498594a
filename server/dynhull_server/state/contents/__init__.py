"""The points of hulls: multisets, keyed hulls, and windows."""

from ..records import DEFAULT, HullSettings, Kept
from .keyed import Keyed
from .live import LiveContents
from .multiset import Multiset
from .windowed import Windowed

UNLIMITED = 2**63


def replayed(kept: Kept, settings: HullSettings = DEFAULT, most_points: int = UNLIMITED) -> LiveContents:
    """The contents of a hull with these settings: those of a snapshot, and the changes after it. O(n log² n)."""
    contents: LiveContents
    if settings.identity == "multiset" and settings.window is None:
        contents = Multiset(kept.contents, most_points)
    elif settings.identity == "multiset":
        contents = Windowed(settings, kept.contents, kept.clock, most_points)
    else:
        contents = Keyed(settings, kept.contents, kept.clock, most_points)
    contents.replay(kept.records)
    return contents
