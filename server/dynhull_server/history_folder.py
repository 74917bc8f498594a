"""Where a server keeps the past of its hulls, as its settings say."""

from pathlib import Path

from .settings import Settings
from .storage.segments.archive import HISTORY, Archive
from .storage.segments.objects import archive_at

MICROSECONDS = 1_000_000


def archive_of(settings: Settings, data: Path | None = None) -> Archive | None:
    """The past of the hulls of a process; None for one that keeps none.

    Args:
        settings: the settings.
        data: its data folder; None for one whose hulls are in a database.
    """
    place = settings.history_dir
    if place is None and data is not None:
        place = str(data / HISTORY)
    if place is None:
        return None
    return archive_at(place, settings.max_history_bytes, round(settings.max_history_age * MICROSECONDS))
