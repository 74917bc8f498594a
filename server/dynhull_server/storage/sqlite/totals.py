"""The row that says what there must be: kept twice, renewed in each commit."""

import sqlite3
from typing import NamedTuple, Self

from ..durability import Durability
from .encoding import checksum

COPIES = 2
SUM_BITS = 63

# What `Totals.mode` says: nobody has the folder open, or what those who have it promise to their callers.
STOPPED = 0
MODES = {Durability.SYNC: 1, Durability.INTERVAL: 2, Durability.NONE: 3}


class Totals(NamedTuple):
    """What there must be.

    Attributes:
        commits: how many there were before this one: it only grows.
        hulls: rows of hulls.
        batches: rows of batches, of hulls that were not deleted.
        sum: of the checksums of the former and the weights of the latter.
        next_number: greater than the number of every hull there has ever been.
        mode: STOPPED or one of MODES. In the database's own file it is STOPPED only where the log holds nothing that
            anybody was told of.
    """

    commits: int = 0
    hulls: int = 0
    batches: int = 0
    sum: int = 0
    next_number: int = 1
    mode: int = STOPPED

    def plus(self, hulls: int, batches: int, checksums: int) -> Self:
        """After rows have come or, with negative numbers, gone."""
        total = (self.sum + checksums) % 2**SUM_BITS
        return self._replace(hulls=self.hulls + hulls, batches=self.batches + batches, sum=total)

    @property
    def row(self) -> tuple[int, ...]:
        """As it is stored, with its checksum."""
        return *self, checksum(b"", *self)


def read_totals(connection: sqlite3.Connection) -> tuple[Totals | None, bool]:
    """The row, None where it is damaged; and whether both copies of it are whole.

    Raises:
        sqlite3.Error: there is no such table, or it cannot be read.
    """
    query = "SELECT commits, hulls, batches, sum, next_number, mode, checksum FROM totals"
    whole = set()
    rows = connection.execute(query).fetchall()
    for *values, stored in rows:
        if all(type(value) is int for value in values) and checksum(b"", *values) == stored:
            whole.add(Totals(*values))
    both = len(rows) == COPIES and len(set(rows)) == 1
    return whole.pop() if len(whole) == 1 else None, both


def renew_totals(connection: sqlite3.Connection, totals: Totals) -> None:
    """Write both copies anew."""
    columns = "commits, hulls, batches, sum, next_number, mode, checksum"
    connection.execute("DELETE FROM totals")
    sql = f"INSERT INTO totals ({columns}) VALUES (?, ?, ?, ?, ?, ?, ?)"  # noqa: S608  (ours)
    connection.executemany(sql, [totals.row] * COPIES)
