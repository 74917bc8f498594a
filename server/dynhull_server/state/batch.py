"""A batch: changes that are applied together or not at all."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from dynhull.arrays import Points

from .records import Accuracies, Condition, Keys, QuarantineRules, Times


@dataclass(slots=True)
class Batch:
    """Points as (n, 2) arrays. The last `moves` of each are the origins and the destinations of moves.

    With `count_missing`, deletes of missing points are counted instead of refused. `times` are the event times of the
    inserts without those of the moves, or None.
    """

    inserts: Points
    deletes: Points
    moves: int
    count_missing: bool
    times: Times | None = None

    @property
    def growth(self) -> int:
        """The largest increase in the number of points."""
        return len(self.inserts) if self.count_missing else len(self.inserts) - len(self.deletes)


@dataclass(slots=True)
class KeyedBatch:
    """Positions of keys, and keys to remove; all keys are of the kind `kind`.

    Attributes:
        kind: whether the keys are strings or integers.
        keys: n keys to put.
        points: (n, 2) their positions.
        removes: keys to remove.
        times: (n,) event times of the puts, or None.
        condition: which keys to put: all, or only those that are absent or present.
        ttl: the microseconds after which the puts leave, or None.
        deadlines: (n,) the times at which the puts leave, or None.
        refuse_missing: whether a missing key among the removes refuses the batch, rather than being counted.
        releases: keys whose held position is let in. A batch with this or one of the next two has no puts or removes.
        drops: keys whose held position is dropped.
        rules: the rules of the quarantine from now on; None for the same as before.
        accuracies: (n,) the errors of the positions, or None: 0 for all.
    """

    kind: Literal["str", "int"]
    keys: Keys
    points: Points
    removes: Keys
    times: Times | None = None
    condition: Condition | None = None
    ttl: int | None = None
    deadlines: Times | None = None
    refuse_missing: bool = False
    releases: Keys | None = None
    drops: Keys | None = None
    rules: QuarantineRules | None = None
    accuracies: Accuracies | None = None

    @property
    def field(self) -> str:
        """The path of its keys in the batch."""
        if len(self.keys):
            return "puts.keys"
        return "releases" if self.releases is not None else "drops" if self.drops is not None else "removes"

    @property
    def of_quarantine(self) -> bool:
        """Whether it is about the quarantine, and not about positions."""
        return self.releases is not None or self.drops is not None or self.rules is not None


class Write(NamedTuple):
    """A batch as its caller has sent it to a hull.

    Attributes:
        name: the name of the hull.
        content: the batch; or the error that refuses it in its turn, because it cannot be decoded.
        arrived: the time of its arrival by the server's clock, in microseconds since 1970.
        rows: the approximate number of its points.
        producer: the producer that numbers it; empty where it is not numbered.
        sequence: its number.
        owner: the caller that the producer belongs to.
        may_skip: whether numbers may be skipped.
        after: the number of the batch that must be the producer's last one; None for any.
    """

    name: str
    content: Batch | KeyedBatch | Exception
    arrived: int
    rows: int = 0
    producer: str = ""
    sequence: int = 0
    owner: str = ""
    may_skip: bool = False
    after: int | None = None

    @property
    def batch(self) -> Batch | KeyedBatch:
        """The batch, or raise the error that refuses it."""
        if isinstance(self.content, Exception):
            raise self.content
        return self.content


@dataclass(slots=True)
class Applied:
    """The effect of a batch, and the counts after it. For a `duplicate`, `revision` is one that includes it.

    Attributes:
        revision: the revision after the batch.
        inserted: points inserted; in a keyed hull, new keys.
        deleted: points deleted; in a keyed hull, keys removed.
        missing: deletes and removes ignored because the point or the key was missing.
        hull_changed: whether the vertices have changed.
        points: the number of points.
        duplicate: whether the batch had already been applied.
        moved: known keys whose position was written.
        stale: puts that changed nothing because the stored position has a later event time.
        late: rows that changed nothing because they are too old.
        skipped: puts that changed nothing because of their condition.
        clamped: rows whose event time was reduced.
        evicted: the oldest points, removed because the window has room for no more.
        clock: the clock of the hull, None for a hull without a clock.
        expired: points that left before the batch because of its time, as a revision of their own.
        held: the rows of the puts that are held in quarantine.
        released: keys that have left the quarantine and were let in.
        dropped: keys whose held position was dropped: removed, contradicted by one that was let in, or by request.
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
    clock: int | None = None
    expired: int = 0
    held: Sequence[int] = ()
    released: int = 0
    dropped: int = 0

    @property
    def plain(self) -> bool:
        """Whether it counts only points inserted, deleted and missing, and nothing of keys and times."""
        return self.clock is None and not (  # without a clock nothing is late, clamped, evicted or expired
            self.moved or self.stale or self.skipped or self.held or self.released or self.dropped
        )


NO_POINTS: Points = np.empty((0, 2))
