"""Where a server keeps the past of its hulls, as its settings say."""

from pathlib import Path

from .settings import Settings
from .storage.segments.archive import HISTORY, Archive

MICROSECONDS = 1_000_000


def archive_of(settings: Settings, data: Path | None = None) -> Archive | None:
    """The past of the hulls of a process; None for one that keeps none.

    Args:
        settings: the settings.
        data: its data folder; None for one whose hulls are in a database.
    """
    path = settings.history_dir
    if path is None and data is not None:
        path = data / HISTORY
    if path is None:
        return None
    return Archive(path, settings.max_history_bytes, round(settings.max_history_age * MICROSECONDS))
