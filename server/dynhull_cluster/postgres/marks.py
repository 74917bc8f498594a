"""What tells a database from a copy of its files, for the past that both would keep in one place."""

from .database import Database, as_storage_errors

TABLE = b"CREATE TABLE IF NOT EXISTS marks (mark text PRIMARY KEY)"


class DatabaseMarks:
    """The marks of a database, which all of its workers add.

    Args:
        database: the database.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def known(self) -> set[str]:
        """The marks."""
        with as_storage_errors(), self._database.connect("dynhull history") as connection:
            connection.execute(TABLE)
            return {mark for (mark,) in connection.execute("SELECT mark FROM marks").fetchall()}

    def add(self, mark: str) -> None:
        """Add one, durably."""
        with as_storage_errors(), self._database.connect("dynhull history") as connection, connection.transaction():
            connection.execute(TABLE)
            connection.execute("INSERT INTO marks VALUES (%s)", [mark])
