"""The storage that the settings ask for, if it is a database."""

from dynhull_server.app import end_process
from dynhull_server.settings import Settings
from dynhull_server.storage.port import Storage


def storage_of(settings: Settings, partition: int = 0) -> Storage | None:
    """What keeps the hulls of a worker in a database; None if the settings name none.

    Raises:
        ValueError: the address is invalid, or the package for PostgreSQL is missing.
    """
    if settings.journal is None:
        return None
    try:
        from .postgres.database import Database
        from .postgres.storage import PostgresStorage
    except ImportError as error:
        raise ValueError(f"--journal needs {error.name}: pip install 'dynhull[postgresql]'") from None
    try:
        database = Database(settings.journal)
    except ValueError as error:
        raise ValueError(f"--journal: {error}") from None
    return PostgresStorage(
        database,
        end_process,
        settings.durability,
        partition=partition,
        partitions=settings.workers or 1,
        address=f"{settings.host}:{settings.port}",
    )
