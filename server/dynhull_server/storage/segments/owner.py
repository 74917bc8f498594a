"""Whose a place of the past is: of two databases in one, each would remove the files that the other one still needs.

Each claims it with a file of its own, and then looks whether there are others. So no store has to create a file only
where there is none: of two that claim at the same moment, at least one sees the other, and steps back.

A copy of a disk, or of the files of PostgreSQL, has the same name. So each process that claims the place notes a random
mark in its database, and then puts it into the claim. The marks of a database and of its copy differ from then on: who
finds one in the claim that its database does not have is no longer alone, and writes and removes nothing: what it has
stays in its journal, where the other one would take a file that it does not know for nobody's, and remove it.
"""

from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Protocol

from ..port import StorageError

CLAIMS = "dynhull.owners"  # the folder of the claims, in that of the past
ID_BYTES = MARK_BYTES = 8


class OccupiedError(StorageError):
    """The past of another database is in this place."""


class Marks(Protocol):
    """The marks that a database has put into its claim, all of them: an object may arrive late."""

    def known(self) -> set[str]:
        """The marks. Raises OSError or StorageError if they cannot be read at present."""

    def add(self, mark: str) -> None:
        """Add one, durably, or raise OSError or StorageError."""


@dataclass(frozen=True, slots=True)
class Claimant:
    """A database that has a place for its past.

    Attributes:
        id: a name that no copy of it has.
        about: where it is, for people.
        marks: tell it from a copy that has the same name; None for one that has no such copies.
    """

    id: str
    about: str
    marks: Marks | None = field(default=None, compare=False)


def owner_of_database(secret: str, about: str, marks: Marks | None = None) -> Claimant:
    """Who a database of a cluster is: its secret is its own, also beside its copies, but those of files."""
    return Claimant(blake2b(secret.encode(), digest_size=ID_BYTES, person=b"history owner").hexdigest(), about, marks)
