"""Examination of a database: its format, its structure and its rows."""

import sqlite3
from pathlib import Path

from ..port import DamagedError, FormatError, Progress, StorageError
from ..refusals import Meaning
from ..rows.examine import Findings
from ..rows.examine import examine as examine_rows
from ..rows.ledger import Ledger
from ..rows.tables import FORMAT, UnreadableError
from ..rows.totals import Totals
from .readers import SQLiteReader
from .refusals import meaning_of
from .schema import APPLICATION_ID, PAGE_BYTES, SCHEMAS, found

MOST_MESSAGES = 5  # of SQLite's checks


def format_of(connection: sqlite3.Connection, database: Path) -> int:
    """The format of a database, 0 if it is empty.

    Raises:
        FormatError: it was written by another program, or by a newer version.
    """
    application, version, tables = found(connection)
    if not tables and application == version == 0:
        return 0
    if application != APPLICATION_ID:
        raise FormatError(f"{database} belongs to another program: choose another folder")
    if version not in SCHEMAS:
        raise FormatError(
            f"{database} has format {version}, this version reads formats 1 to {FORMAT}: run the newer version of "
            "dynhull that wrote it"
        )
    return version


def examine(connection: sqlite3.Connection, version: int, own: Totals | None, progress: Progress) -> Findings:
    """Compare all data of a database with its checksums and totals.

    Args:
        connection: a connection with an open transaction, so that all data is of one moment.
        version: the format.
        own: the totals in the database file, without its log; None if unknown.
        progress: called with the rows examined so far and the total.

    Raises:
        StorageError: it is in use, or there is no memory.
    """
    findings = Findings()
    try:
        if not _has_tables(connection, version, findings):
            return findings
        _check_structure(connection, version, findings)
        examine_rows(SQLiteReader(connection, version), version, findings, progress)
        if own is not None and own.commits > findings.ledger.totals.commits:
            findings.fatal.append(
                "log and database do not belong together: the database has later commits than its log"
            )
    except (sqlite3.Error, UnreadableError) as error:
        if meaning_of(error) is Meaning.PASSES:
            raise StorageError(
                f"the database cannot be examined at present: {error}", meaning=Meaning.PASSES
            ) from error
        findings.fatal.append(f"a part of the database cannot be read ({error})")
    return findings


def load(connection: sqlite3.Connection, version: int = FORMAT) -> Ledger:
    """The ledger of a database that was intact when it was opened.

    Raises:
        DamagedError: it is damaged.
    """
    return loaded(connection, version).ledger


def loaded(connection: sqlite3.Connection, version: int = FORMAT) -> Findings:
    """The same, with the repairs of what has been damaged since, but can be put right."""
    findings = Findings()
    if _has_tables(connection, version, findings):
        examine_rows(SQLiteReader(connection, version), version, findings, lambda *_: None, contents=False)
    if findings.fatal:
        raise DamagedError("; ".join(findings.fatal))
    return findings


def _has_tables(connection: sqlite3.Connection, version: int, findings: Findings) -> bool:
    """Whether the tables are those of the format; if not, nothing can be read."""
    *_, tables = found(connection)
    if tables != SCHEMAS[version]:
        findings.fatal.append("the tables are not those of this format")
    return tables == SCHEMAS[version]


def _check_structure(connection: sqlite3.Connection, version: int, findings: Findings) -> None:
    """Have SQLite check the structure of pages and cells."""
    settings = {"page_size": PAGE_BYTES, "auto_vacuum": 0, "encoding": "UTF-8"}
    for name, expected in settings.items():
        if connection.execute(f"PRAGMA {name}").fetchone() != (expected,):
            findings.fatal.append(f"the database's header is damaged ({name})")
    # Format 1 is read through its indexes, which must agree with the tables.
    check = "integrity_check" if version == 1 else "quick_check"
    messages = [text for (text,) in connection.execute(f"PRAGMA {check}({MOST_MESSAGES})")]
    if messages != ["ok"]:
        findings.fatal.append("; ".join(" ".join(text.split()) for text in messages))
