"""The storage that the settings ask for, if it is a database."""

from typing import TYPE_CHECKING

from dynhull_server.app import end_process
from dynhull_server.settings import Settings
from dynhull_server.storage.port import Storage

if TYPE_CHECKING:
    from .postgres.database import Database


def storage_of(settings: Settings) -> Storage | None:
    """What keeps the hulls of a server of one process in a database; None if the settings name none.

    Raises:
        ValueError: the address is invalid, or the package for PostgreSQL is missing.
    """
    if settings.journal is None:
        return None
    database = database_of(settings)
    from .postgres.storage import PostgresStorage

    return PostgresStorage(
        database,
        end_process,
        settings.durability,
        address=f"{settings.host}:{settings.port}",
    )


def database_of(settings: Settings) -> "Database":
    """The database of the settings.

    Raises:
        ValueError: the address is invalid, or the package for PostgreSQL is missing.
    """
    assert settings.journal is not None
    try:
        from .postgres.database import Database
    except ImportError as error:
        raise ValueError(f"--journal needs {error.name}: pip install 'dynhull[postgresql]'") from None
    try:
        return Database(settings.journal)
    except ValueError as error:
        raise ValueError(f"--journal: {error}") from None
