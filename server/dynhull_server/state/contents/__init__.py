"""The points of hulls: multisets, keyed hulls, and windows."""

from ..frames import Globe
from ..records import DEFAULT, HullSettings, Kept
from .keyed import Keyed
from .live import LiveContents
from .multiset import Multiset
from .windowed import Windowed

UNLIMITED = 2**63


def replayed(kept: Kept, settings: HullSettings = DEFAULT, most_points: int = UNLIMITED) -> LiveContents:
    """The contents of a hull with these settings: those of a snapshot, and the changes after it. O(n log² n).

    The root of a hull over shards has vertices in place of points: they leave when their shard says so.
    """
    contents: LiveContents
    if settings.divided:
        settings = HullSettings(settings.identity)
    globe = Globe(kept.center or settings.center) if settings.geographic else None
    if settings.identity == "multiset" and settings.window is None:
        contents = Multiset(kept.contents, most_points, globe)
    elif settings.identity == "multiset":
        contents = Windowed(settings, kept.contents, kept.clock, most_points, globe)
    else:
        contents = Keyed(settings, kept.contents, kept.clock, most_points, globe, kept.rules)
    contents.replay(kept.records)
    return contents
