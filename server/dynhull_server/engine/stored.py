"""Hulls on the disk, without a server: to look at, or to check a copy."""

from dataclasses import dataclass
from pathlib import Path

from dynhull.arrays import Points

from ..storage.sqlite import copies
from ..storage.sqlite.errors import JournalError
from .storage import replayed


@dataclass(frozen=True, slots=True)
class StoredHull:
    """A hull as of the last commit; what was lost at its end in `notes`."""

    name: str
    revision: int
    points: Points
    notes: list[str]


def read_hull(folder: Path, name: str) -> StoredHull:
    """Read one hull of a data folder or a backup, or raise JournalError."""
    for row in copies.hulls(folder):
        if row.name == name:
            recovered = copies.look(folder, row.number)
            restored = replayed(recovered)
            return StoredHull(name, restored.revision, restored.hull.points(), recovered.notes)
    raise JournalError(f"there is no hull {name!r} in {folder}")
