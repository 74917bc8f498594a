"""The totals of all rows: stored twice, updated in each commit."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

from ..durability import Durability
from .encoding import checksum

COPIES = 2
SUM_BITS = 63

# Values of `Totals.mode`: no server uses the folder, or the durability of the server that does.
STOPPED = 0
MODES = {Durability.SYNC: 1, Durability.INTERVAL: 2, Durability.NONE: 3}


class Totals(NamedTuple):
    """The totals of all valid rows.

    Attributes:
        commits: the number of earlier commits, which is that of the last one; it only grows.
        hulls: the number of hulls.
        batches: the number of rows of batches, without those of deleted hulls.
        sum: the sum of the checksums of the hulls and of the weights of all other rows.
        next_number: a number greater than that of any hull ever created.
        mode: STOPPED or one of MODES. In the database file itself it is STOPPED only if the log has no acknowledged
            commits.
        fence_rows: the number of rows of fences: their own, and those of events, consumers and who is inside. And of
            consumers of feeds.
        committed: the time of the last commit, in microseconds since 1970; it never goes back.
    """

    commits: int = 0
    hulls: int = 0
    batches: int = 0
    sum: int = 0
    next_number: int = 1
    mode: int = STOPPED
    fence_rows: int = 0
    committed: int = 0

    def plus(self, hulls: int, batches: int, checksums: int, fence_rows: int = 0) -> Self:
        """The totals after adding rows or, with negative numbers, removing them."""
        total = (self.sum + checksums) % 2**SUM_BITS
        return type(self)(
            self.commits,
            self.hulls + hulls,
            self.batches + batches,
            total,
            self.next_number,
            self.mode,
            self.fence_rows + fence_rows,
            self.committed,
        )

    @property
    def row(self) -> tuple[int, ...]:
        """The values as stored, with their checksum."""
        return *self, checksum(b"", *self)


def totals_from(rows: Sequence[Sequence[Any]]) -> tuple[Totals | None, bool]:
    """The totals of all copies found, None if they are damaged; and whether both copies are intact."""
    whole = set()
    for *values, stored in rows:  # up to format 3 without fences, up to format 10 without a time
        if all(type(value) is int for value in values) and checksum(b"", *values) == stored:
            whole.add(Totals(*values))
    both = len(rows) == COPIES and all(row == rows[0] for row in rows)
    return whole.pop() if len(whole) == 1 else None, both
