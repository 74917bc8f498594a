"""The data that the storage keeps: hulls, and the batches applied to them."""

from dataclasses import dataclass

from dynhull.arrays import Points


@dataclass(frozen=True, slots=True)
class HullRow:
    """A hull as stored, without its points.

    Attributes:
        number: its number, never used for another hull.
        name: its name.
        uid: distinguishes it from other hulls of its name.
        created: seconds since 1970.
        max_points: the limit on its points, 0 for the server's own.
    """

    number: int
    name: str
    uid: str
    created: float
    max_points: int = 0


@dataclass(slots=True)
class Record:
    """One batch, as applied.

    Attributes:
        revision: the revision after it.
        inserts: (n, 2) points inserted.
        deletes: (m, 2) points deleted.
        producer: the producer that numbered it; empty where it has no number.
        sequence: its number.
        lenient: whether some of the deletes were ignored because the point was missing.
    """

    revision: int
    inserts: Points
    deletes: Points
    producer: str = ""
    sequence: int = 0
    lenient: bool = False


@dataclass(frozen=True, slots=True)
class Create:
    """A new hull."""

    row: HullRow


@dataclass(slots=True)
class Append:
    """Batches of consecutive revisions of one hull."""

    number: int
    records: list[Record]


@dataclass(frozen=True, slots=True)
class Delete:
    """The deletion of a hull with all its batches and snapshots."""

    number: int


Change = Create | Append | Delete


@dataclass(slots=True)
class Kept:
    """One hull as stored: a snapshot, and the batches after it.

    Attributes:
        revision: the revision of the points.
        points: (n, 2) points of the snapshot, with multiplicity.
        producers: the last sequence number of each producer at that revision.
        records: the batches after it, in order.
    """

    revision: int
    points: Points
    producers: dict[str, int]
    records: list[Record]

    @property
    def last_revision(self) -> int:
        """The revision after the last batch."""
        return self.records[-1].revision if self.records else self.revision
