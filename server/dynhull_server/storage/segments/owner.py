"""Whose a place of the past is: of two databases in one, each would remove the files that the other one still needs.

Each claims it with a file of its own, and then looks whether there are others. So no store has to create a file only
where there is none: of two that claim at the same moment, at least one sees the other, and steps back.
"""

from dataclasses import dataclass
from hashlib import blake2b

from ..port import StorageError

CLAIMS = "dynhull.owners"  # the folder of the claims, in that of the past
ID_BYTES = 8


class OccupiedError(StorageError):
    """The past of another database is in this place."""


@dataclass(frozen=True, slots=True)
class Claimant:
    """A database that has a place for its past.

    Attributes:
        id: a name that no copy of it has.
        about: where it is, for people.
    """

    id: str
    about: str


def owner_of_database(secret: str, about: str) -> Claimant:
    """Who a database of a cluster is: its secret is its own, also beside its copies."""
    return Claimant(blake2b(secret.encode(), digest_size=ID_BYTES, person=b"history owner").hexdigest(), about)
