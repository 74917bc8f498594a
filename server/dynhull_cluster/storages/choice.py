"""Chooses the kind of storage by the settings."""

from pkgutil import resolve_name

from dynhull_server.settings import Settings
from dynhull_server.storage.databases import kind_of

from .kind import StorageKind


def storage_kind(settings: Settings) -> StorageKind:
    """What serves the hulls where the settings say. Raises ValueError if there is no such kind of database."""
    if settings.in_memory:
        from .memory import MemoryKind

        return MemoryKind(settings)
    if settings.journal is None:
        from .folder import FolderKind

        return FolderKind(settings)
    kind: StorageKind = resolve_name(kind_of(settings.journal).served_by)(settings)
    return kind
