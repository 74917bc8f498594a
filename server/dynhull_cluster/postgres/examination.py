"""Examination of the rows of a partition."""

from dynhull_server.storage.port import Progress
from dynhull_server.storage.rows.examine import Findings, examine
from dynhull_server.storage.rows.tables import FORMAT, UnreadableError

from .database import Connection
from .reader import PostgresReader


def examined(connection: Connection, partition: int, progress: Progress, *, contents: bool = True) -> Findings:
    """Compare the rows of a partition with their checksums and the totals, inside of a transaction."""
    findings = Findings()
    try:
        examine(PostgresReader(connection, partition), FORMAT, findings, progress, contents=contents)
    except UnreadableError as error:
        findings.fatal.append(f"a part of the database cannot be read ({error})")
    return findings
