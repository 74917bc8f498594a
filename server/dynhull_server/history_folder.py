"""Where a server keeps the past of its hulls, as its settings say."""

import logging
from pathlib import Path

from .settings import Settings
from .storage.segments.archive import HISTORY, Archive
from .storage.segments.objects import REST_SECONDS, ObjectArchive, archive_at
from .storage.segments.owner import Claimant

MICROSECONDS = 1_000_000

log = logging.getLogger(__name__)


def archive_of(settings: Settings, data: Path | None = None, owner: Claimant | None = None) -> Archive | None:
    """The past of the hulls of a process; None for one that keeps none.

    Args:
        settings: the settings.
        data: its data folder; None for one whose hulls are in a database.
        owner: whose past alone is in the place that the settings name.
    """
    place = settings.history_dir
    if place is None:
        if data is None:
            return None
        place, owner = str(data / HISTORY), None
    archive = archive_at(place, settings.max_history_bytes, round(settings.max_history_age * MICROSECONDS))
    archive.owner = owner
    if isinstance(archive, ObjectArchive):
        archive.rest = REST_SECONDS
    return archive


def claim_history(settings: Settings, owner: Claimant) -> None:
    """Have the place that the settings name for one database alone, before it is served.

    Raises:
        OccupiedError: another one has it.
    """
    archive = archive_of(settings, owner=owner)
    if archive is not None:
        try:
            archive.claim()
        except OSError as error:  # what is due stays in the journal
            log.warning("whose past is there is not known so far, so nothing is written: %s", error)
