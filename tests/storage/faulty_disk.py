"""A disk on which statements fail."""

import sqlite3

from dynhull_server.storage.sqlite.disk import Disk


def failure(code):
    """As SQLite fails."""
    error = sqlite3.OperationalError("injected")
    error.sqlite_errorcode = code
    return error


class FaultyDisk(Disk):
    """Fails once, at a chosen statement.

    Attributes:
        statement: how the statement begins that fails.
        error: what it fails with; None for not at all.
        late: whether it is carried out before it fails.
    """

    def __init__(self):
        self.statement, self.error, self.late = "", None, False
        self.no_sync = self.no_connection = False
        self.connections_left = 10**6

    def fail(self, statement, error, *, late=False):
        self.statement, self.error, self.late = statement, error, late

    def connect(self, database, access):
        self.connections_left -= 1
        if self.no_connection or self.connections_left < 0:
            raise failure(sqlite3.SQLITE_CANTOPEN)
        disk = self

        class Faulty(sqlite3.Connection):
            def execute(self, sql, *values):
                if disk.error is None or not sql.startswith(disk.statement):
                    return super().execute(sql, *values)
                error, disk.error = disk.error, None
                if disk.late:
                    super().execute(sql, *values)
                elif disk.statement == "COMMIT":
                    super().execute("ROLLBACK")
                raise error

        address = f"{database.absolute().as_uri()}?{access.value}"
        return sqlite3.connect(address, uri=True, isolation_level=None, check_same_thread=False, factory=Faulty)

    def sync(self, file):
        if self.no_sync:
            raise OSError(5, "injected")
        super().sync(file)
