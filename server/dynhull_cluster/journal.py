"""The database that the settings name."""

from typing import TYPE_CHECKING

from dynhull_server.settings import Settings

if TYPE_CHECKING:
    from .postgres.database import Database


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
