"""One hull: its points, its revision, its producers, and the history of its vertices."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from dynhull import DynamicHull, KeyedHull
from dynhull.arrays import Points

from .batch import Applied, Batch, apply_batch, check_batch
from .errors import LimitExceededError, PointMissingError
from .history import History
from .limits import Limits
from .producers import Producers
from .records import Contents, HullSettings, Kept, PointRows, Record

if TYPE_CHECKING:
    from .events import WriteBatch

# Batches are replayed as one set of up to this many points, which is many times faster.
REPLAYED_TOGETHER = 65_536


@dataclass(slots=True)
class Counts:
    """The counts of a hull at a revision; `points` with multiplicity."""

    revision: int
    points: int
    distinct: int


# The keys of vertices: an array of str, or of uint64.
VertexKeys = npt.NDArray[Any]


class HullState:
    """The points of a hull, and the values derived from them.

    Attributes:
        hull: the points.
        counts: the counts after the last batch.
        torn: whether a batch has been applied in part, because memory ran out in the middle of it.
    """

    def __init__(self, limits: Limits, settings: HullSettings, kept: Kept, now: float) -> None:
        self._most_points = min(settings.max_points or limits.max_points, limits.max_points)
        self.torn = False
        self.hull = replayed(kept)
        self.counts = Counts(kept.last_revision, len(self.hull), self.hull.distinct)
        self._producers = Producers(limits.max_producers, limits.max_producers_per_caller, _last_sequences(kept), now)
        self._vertices = self.hull.vertices()
        self._vertices.setflags(write=False)
        self._vertices_as_of = self.hull.changes
        self._changed_at = self.counts.revision
        self._vertex_keys: VertexKeys | None = None
        self._keys_as_of = -1
        self._history = History(limits.history_bytes, self._vertices, self.counts.revision)

    @property
    def vertex_count(self) -> int:
        """The number of vertices when they were last read."""
        return len(self._vertices)

    def apply(self, write: "WriteBatch", now: float, records: list[Record] | None) -> Applied:
        """Apply a batch as the next revision, and append it to `records` unless that is None.

        Raises:
            Exception: the batch is refused; nothing has changed.
        """
        if not self.is_new(write, now):
            return self.duplicate()
        return self.apply_decoded(write, self.decoded(write), now, records)

    def is_new(self, write: "WriteBatch", now: float) -> bool:
        """Whether a batch is the next one of its producer, or not numbered; False where it has already been applied.

        Raises:
            SequenceGapError: batches before it are missing.
            LimitExceededError: the hull has too many producers to add one.
        """
        return not write.producer or self._producers.is_new(write.producer, write.sequence, write.owner, now)

    def duplicate(self) -> Applied:
        """The result of a batch that has already been applied."""
        counts = self.counts
        return Applied(counts.revision, 0, 0, 0, False, counts.points, duplicate=True)

    def decoded(self, write: "WriteBatch") -> Batch:
        """The batch; raises the error that refuses it, unless that depends on the points of the hull."""
        batch = write.make()
        if self.counts.points + batch.growth > self._most_points:
            raise LimitExceededError("max_points", self._most_points)
        return batch

    def checked(self, write: "WriteBatch") -> Batch:
        """The batch, if it can be applied; raises the error that refuses it. O(k log n)."""
        batch = self.decoded(write)
        check_batch(self.hull, batch)
        return batch

    def apply_decoded(self, write: "WriteBatch", batch: Batch, now: float, records: list[Record] | None) -> Applied:
        """Apply a new batch as the next revision, and append it to `records` unless that is None.

        Raises:
            Exception: the batch is refused; nothing has changed.
        """
        counts = self.counts
        self.torn = True
        try:
            applied = apply_batch(self.hull, batch, counts.revision + 1)
        except PointMissingError:
            self.torn = False
            raise
        if applied.hull_changed:
            self._changed_at = applied.revision
            self._history.changed(applied.revision)
        if write.producer:
            self._producers.applied(write.producer, write.sequence, write.owner, now)
        self.counts = Counts(applied.revision, applied.points, self.hull.distinct)
        if records is not None:
            rows = PointRows(batch.inserts, batch.deletes, lenient=applied.missing > 0)
            records.append(Record(applied.revision, rows, write.producer, write.sequence))
        self.torn = False
        return applied

    def vertices(self) -> Points:
        """The vertices; the same array object while the hull has not changed."""
        if self._vertices_as_of != self.hull.changes:
            self._vertices = self.hull.vertices()
            self._vertices.setflags(write=False)
            self._vertices_as_of = self.hull.changes
            self._history.record(self._changed_at, self._vertices)
        return self._vertices

    def vertex_keys(self) -> VertexKeys:
        """The key at each vertex of a keyed hull; the same array object while no vertex has changed its key."""
        revision = self.counts.revision
        if self._keys_as_of != revision:
            keys = self._key_array(self._keyed.vertex_keys())
            if self._vertex_keys is None or not np.array_equal(self._vertex_keys, keys):
                self._vertex_keys = keys
            self._keys_as_of = revision
        assert self._vertex_keys is not None  # set above
        return self._vertex_keys

    def keys_at(self, places: Points) -> VertexKeys:
        """The key at each of some places of a keyed hull, all of which have one."""
        return self._key_array(self._keyed.keys_at(places))

    @property
    def _keyed(self) -> KeyedHull:
        assert isinstance(self.hull, KeyedHull)  # nobody asks others for keys
        return self.hull

    def _key_array(self, keys: Sequence[str | int | None]) -> VertexKeys:
        return np.array(keys, object if self._keyed.key_type == "str" else np.uint64)

    def earlier_vertices(self, revision: int) -> Points | None:
        """The vertices at an earlier revision, None where they were never sent; raises RevisionForgottenError."""
        return self._history.at(revision, self.counts.revision)

    def last_sequence(self, producer: str) -> int:
        """The last sequence number applied of a producer, 0 where there is none."""
        return self._producers.last(producer)

    def kept(self) -> Kept:
        """The hull at this revision, for a snapshot. O(n)."""
        return Kept(self.counts.revision, Contents(self.hull.points()), self._producers.state())


def replayed(kept: Kept) -> DynamicHull:
    """The hull of a snapshot and the batches after it. O(n log n)."""
    hull = DynamicHull(kept.contents.points)
    replay(hull, kept.records)
    return hull


def replay(hull: DynamicHull, records: Iterable[Record]) -> None:
    """Apply recorded batches, many at a time."""
    for group in _together(records):
        inserts = np.concatenate([rows.inserts for rows in group])
        deletes = np.concatenate([rows.deletes for rows in group])
        ops = np.repeat(np.array([1, -1], np.int8), [len(inserts), len(deletes)])
        hull.apply(ops, np.concatenate([inserts, deletes]), missing="ignore" if group[0].lenient else "raise")


def _last_sequences(kept: Kept) -> dict[str, int]:
    last = dict(kept.producers)
    for record in kept.records:
        if record.producer:
            last[record.producer] = record.sequence
    return last


def _together(records: Iterable[Record]) -> Iterable[list[PointRows]]:
    """Groups of batches to apply as one set. A lenient one stays alone: its deletes depend on the points before it."""
    group: list[PointRows] = []
    size = 0
    for record in records:
        rows = record.rows
        assert isinstance(rows, PointRows)
        if group and (rows.lenient or group[-1].lenient or size >= REPLAYED_TOGETHER):
            yield group
            group, size = [], 0
        group.append(rows)
        size += len(rows)
    if group:
        yield group
