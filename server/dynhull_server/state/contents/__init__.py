"""The points of hulls: multisets, keyed hulls, and windows."""

from ..frames import Globe
from ..records import DEFAULT, HullSettings, Kept, Parts
from .joining import in_one
from .keyed import Keyed
from .live import LiveContents
from .multiset import Multiset
from .windowed import Windowed

UNLIMITED = 2**63


def begun(
    kept: Kept, settings: HullSettings = DEFAULT, most_points: int = UNLIMITED, parts: Parts | None = None
) -> LiveContents:
    """The contents of a hull with these settings as a snapshot has them, for `replayed`. O(n log n).

    `parts` are its points, unless the snapshot has these itself. The root of a hull over shards has vertices in place
    of points: they leave when their shard says so.
    """
    if parts is None:
        parts = Parts(len(kept.contents), [kept.contents])
    if settings.divided:
        settings = HullSettings(settings.identity)
    globe = Globe(kept.center or settings.center) if settings.geographic else None
    if settings.identity == "multiset" and settings.window is None:
        return Multiset(in_one(parts.parts), most_points, globe)
    if settings.identity == "multiset":
        return Windowed(settings, in_one(parts.parts), kept.clock, most_points, globe)
    return Keyed(settings, parts, kept.clock, most_points, globe, kept.rules)


def replayed(
    kept: Kept, settings: HullSettings = DEFAULT, most_points: int = UNLIMITED, contents: LiveContents | None = None
) -> LiveContents:
    """The contents of a hull with these settings: those of a snapshot, and the changes after it. O(n log² n).

    The first of these may have begun before.
    """
    if contents is None:
        contents = begun(kept, settings, most_points)
    contents.replay(kept.records)
    if isinstance(contents, Keyed):
        contents.build()
    return contents
