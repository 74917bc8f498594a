"""The counts of batches, and the answers that have them."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import NamedTuple

from .described import documenting


class Count(NamedTuple):
    """A count.

    Attributes:
        meaning: what it counts.
        number: its number in BatchResult, on the wire.
        sum_number: the number of its sum in IngestResponse.
    """

    meaning: str
    number: int
    sum_number: int


# Each is a field of both messages on the wire, of both classes below, and of the answers over HTTP; commands say those
# that are not 0.
COUNTS: Mapping[str, Count] = {
    "inserted": Count("points inserted, with the destinations of moves; in a keyed hull, new keys", 2, 3),
    "deleted": Count("points deleted, with the origins of moves; in a keyed hull, keys removed", 3, 4),
    "missing": Count("points to delete or keys to remove that were skipped because the hull did not hold them", 4, 5),
    "moved": Count("known keys whose position was written", 8, 8),
    "stale": Count("positions left out because the stored one has a later event time", 9, 9),
    "late": Count("rows left out because they are too old for the window", 10, 10),
    "skipped": Count("positions left out because of their condition, `only`", 11, 11),
    "clamped": Count("rows whose event time was too far ahead and was reduced", 12, 12),
    "evicted": Count("the oldest points, removed because the window has room for no more", 13, 13),
    "held": Count("positions put into quarantine, because they break a rule of the hull", 15, 14),
    "released": Count(
        "keys that left the quarantine and were let in: by request, or because their position was confirmed", 17, 15
    ),
    "dropped": Count(
        "keys whose held position was dropped: by request, contradicted by one that was let in, or removed", 18, 16
    ),
}

# What a command names before the others, in words of its own: "3 points inserted", "3 keys new, 2 moved".
OF_CHANGES = ("inserted", "deleted", "missing", "moved")


@documenting("COUNTS", {name: count.meaning for name, count in COUNTS.items()})
@dataclass(frozen=True, slots=True)
class Applied:
    """The effect of a batch.

    Attributes:
        revision: the hull's revision after it.
        hull_changed: whether the vertices changed.
        points: the number of points after it.
        duplicate: whether it had been applied before: its counts are 0, and the revision is one that includes it.
        clock: the hull's clock after it; None for a hull without one.
        held_rows: the rows of the batch that are held, ascending.
        COUNTS
    """

    revision: int
    inserted: int
    deleted: int
    missing: int
    hull_changed: bool
    points: int
    duplicate: bool = False
    moved: int = 0
    stale: int = 0
    late: int = 0
    skipped: int = 0
    clamped: int = 0
    evicted: int = 0
    clock: datetime | None = None
    held: int = 0
    held_rows: tuple[int, ...] = ()
    released: int = 0
    dropped: int = 0


@dataclass(frozen=True, slots=True)
class Ingested:
    """The effect of all `batches` of an ingest, and the hull's revision and number of points after the last one.

    `duplicates` counts the batches that an earlier call of the same producer had applied before. The other counts are
    sums of those in `Applied`.
    """

    batches: int
    revision: int
    inserted: int
    deleted: int
    missing: int
    points: int
    duplicates: int = 0
    moved: int = 0
    stale: int = 0
    late: int = 0
    skipped: int = 0
    clamped: int = 0
    evicted: int = 0
    held: int = 0
    released: int = 0
    dropped: int = 0


def text_of(counts: Mapping[str, int]) -> str:
    """Counts as the continuation of a sentence, ", 5 late, 2 held", without those that are 0."""
    return "".join(f", {count:,} {name}" for name, count in counts.items() if count)
