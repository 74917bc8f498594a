"""One hull: its points, its revision, its producers, and the vertices that were sent."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from .batch import NO_POINTS, Applied, Batch, Write
from .contents import replayed
from .contents.keyed import Keyed
from .contents.live import AnyKeyedHull, LiveContents, layer_of
from .contents.multiset import Multiset
from .contents.places import GeographicHull
from .contents.quarantine import Quarantine
from .errors import HullUnsuitableError, MisfitError, RefusedError
from .limits import Limits
from .outline import GlobeOutline, Outline
from .producers import Producers
from .records import Cause, Center, Contents, Expiry, HullSettings, Kept, QuarantineRules, Record
from .sent_vertices import SentVertices

if TYPE_CHECKING:
    from .contents.live import AnyHull

# So many points are needed again after a tenth of a millisecond.
PUT_AWAY_POINTS = 1024


@dataclass(slots=True)
class Counts:
    """The counts of a hull at a revision.

    Attributes:
        revision: the revision.
        points: the number of points, with multiplicity.
        distinct: the number of distinct points.
        clock: the clock of the hull, None for a hull without a clock so far.
        cause: what made the revision; None for revision 0, and where that is no longer known.
        center: the centre of a geographic hull; None for a hull without one.
        outlined: the revision at which the vertices or the centre changed last, or a later one.
        held: the number of keys in quarantine.
        rules: the rules of the quarantine; None for a hull that has never had any.
        shards: the number of shards that the points are divided among; 0 for a hull that is not divided.
    """

    revision: int
    points: int
    distinct: int
    clock: int | None = None
    cause: Cause | None = None
    center: Center | None = None
    outlined: int = 0
    held: int = 0
    rules: QuarantineRules | None = None
    shards: int = 0


# The keys of vertices: an array of str, or of uint64.
VertexKeys = npt.NDArray[Any]


class HullState:
    """The points of a hull, and the values derived from them.

    Attributes:
        contents: the points, and the times at which they leave.
        counts: the counts after the last batch.
        committed: the commit of the last revision that was read from the storage.
        torn: whether a batch has been applied in part, because memory ran out in the middle of it.

    Args:
        limits: the limits on it.
        settings: the settings of the hull.
        kept: the hull as stored.
        now: the time by the server's monotonic clock.
        contents: what `replayed` has made of `kept`, which then belongs to this; None to do that here.
        counts: the counts after it, so that the contents need not be asked; None to do so.
    """

    __slots__ = (
        "_changed_at",
        "_keys_as_of",
        "_layers",
        "_limits",
        "_outline",
        "_producers",
        "_sent",
        "_vertex_keys",
        "_vertices",
        "_vertices_as_of",
        "committed",
        "contents",
        "counts",
        "hull",
        "torn",
    )

    def __init__(
        self,
        limits: Limits,
        settings: HullSettings,
        kept: Kept,
        now: float,
        contents: LiveContents | None = None,
        counts: Counts | None = None,
    ) -> None:
        self.torn = False
        if contents is None:
            contents = replayed(kept, settings, limits.points_of(settings))
        self.contents = contents
        self.hull: AnyHull = contents.hull
        self._limits = limits
        self._producers: Producers | None = None  # most of ten thousand hulls have none
        if sequences := last_sequences(kept):
            self._producers = self._new_producers(sequences, skipping_of(kept), now)
        self._stand_at(kept, counts)

    def _stand_at(self, kept: Kept, counts: Counts | None = None) -> None:
        """Derive what follows from the points, as of the last revision: what was before it is not known."""
        last = kept.last_revision
        self.committed = kept.records[-1].committed if kept.records else kept.committed
        self._follow_center()
        self.counts = counts or self._counted(last, len(self.hull), last_cause(kept), self.center, last)
        self._vertices = self.hull.vertices().copy()  # a copy of a few vertices takes a third of the memory
        self._vertices.setflags(write=False)
        self._vertices_as_of = self.hull.changes
        self._changed_at = last
        self._layers: dict[int, tuple[int, Points]] | None = None  # those that fences ask for
        self._vertex_keys: VertexKeys | None = None
        self._keys_as_of = -1
        self._sent: SentVertices | None = None  # the vertices since `_changed_at`, and no others
        self._outline: tuple[Points, Center | None, GlobeOutline] | None = None

    @property
    def follows_server(self) -> bool:
        """Whether the clock, if any, follows the server's, rather than event times."""
        return self.contents.follows_server

    @property
    def next_due(self) -> int | None:
        """The time by the server's clock before which no point leaves; None if that clock makes none leave."""
        return self.contents.due

    @property
    def center(self) -> Center | None:
        """The centre of a geographic hull; None for a plane, and for a hull without points that has none so far."""
        globe = self.contents.globe
        return None if globe is None else globe.center

    @property
    def quarantine(self) -> Quarantine | None:
        """The positions of a keyed hull that break its rules; None for a hull that has never had any rule."""
        return self.contents.quarantine if isinstance(self.contents, Keyed) else None

    @property
    def vertex_count(self) -> int:
        """The number of vertices when they were last read."""
        return len(self._vertices)

    @property
    def known_vertices(self) -> Points:
        """The vertices when they were last read."""
        return self._vertices

    # Changes

    def catch_up(self, records: Sequence[Record], now: float) -> None:
        """Apply the next revisions, which another server has committed, as if the hull had been read after them."""
        self.torn = True
        self.contents.replay(records)
        for record in records:
            if record.producer:
                if self._producers is None:
                    self._producers = self._new_producers({}, frozenset(), now)
                self._producers.applied(record.producer, record.sequence, "", now, may_skip=record.may_skip)
        self._stand_at(Kept(records=list(records)))
        self.torn = False

    def repeat(self, record: Record) -> None:
        """Apply the next revision again, as when it was made, or what several ones come to. Producers do not matter."""
        changes = self.hull.changes
        self.torn = True
        self.contents.replay((record,))
        self._follow_center()
        cause, hull_changed = _cause_of(record), self.hull.changes != changes
        self._applied(len(self.hull), cause, hull_changed=hull_changed, revision=record.revision)
        self.committed = record.committed
        self.torn = False

    def apply(
        self,
        write: Write,
        now: float,
        records: list[Record] | None,
        expired: Callable[[], None] | None = None,
    ) -> Applied:
        """Apply a batch as the next revision, and append it to `records` unless that is None.

        Points that leave at the time of the batch do so before it, as a revision of their own, followed by a call of
        `expired`.

        Raises:
            Exception: the batch is refused; nothing has changed.
        """
        if write.producer and not self.is_new(write, now):
            return self.duplicate()
        return self.apply_decoded(write, self.decoded(write), now, records, expired)

    def apply_points(self, batch: Batch) -> Applied | None:
        """Apply a batch to a hull whose points have neither keys nor times nor a globe, and record nothing.

        None for another hull, or one without room. Raises as `apply` does; then nothing has changed.
        """
        contents = self.contents
        if type(contents) is not Multiset or contents.globe is not None:
            return None
        if contents.points + len(batch.inserts) > contents.most_points:  # perhaps it is refused
            return None
        applied = self._tear(batch)
        revision = applied.revision
        outlined = self._changed(revision) if applied.hull_changed else self.counts.outlined
        self.counts = Counts(revision, applied.points, self.hull.distinct, None, "batch", None, outlined)
        self.torn = False
        return applied

    def _tear(self, batch: Any) -> Applied:
        """Apply an admitted batch to the contents; the hull is torn until the rest follows, unless it is refused."""
        self.torn = True
        try:
            return self.contents.apply(batch, self.counts.revision + 1)
        except RefusedError:
            self.torn = False
            raise

    def is_new(self, write: Write, now: float) -> bool:
        """Whether a batch is the next one of its producer, or not numbered; False where it has already been applied.

        Raises:
            SequenceGapError: batches before it are missing.
            LimitExceededError: the hull has too many producers to add one.
        """
        if not write.producer:
            return True
        if self._producers is None:
            self._producers = self._new_producers({}, frozenset(), now)
        return self._producers.is_new(
            write.producer, write.sequence, write.owner, now, may_skip=write.may_skip, after=write.after
        )

    def duplicate(self) -> Applied:
        """The result of a batch that has already been applied."""
        counts = self.counts
        return Applied(counts.revision, 0, 0, 0, False, counts.points, duplicate=True, clock=counts.clock)

    def decoded(self, write: Write) -> Any:
        """The batch, admitted; raises the error that refuses it, unless that depends on the points of the hull."""
        content = write.content
        if isinstance(content, Exception):
            raise content
        try:
            return self.contents.admit(content, write.arrived)
        except MisfitError as misfit:
            raise HullUnsuitableError(write.name, str(misfit), field=f"batch.{misfit.field}") from None

    def checked(self, write: Write) -> Any:
        """The batch, if it can be applied; raises the error that refuses it. O(k log n)."""
        batch = self.decoded(write)
        self.contents.check(batch)
        return batch

    def apply_decoded(
        self,
        write: Write,
        batch: Any,
        now: float,
        records: list[Record] | None,
        expired: Callable[[], None] | None = None,
    ) -> Applied:
        """Apply a new batch as the next revision, and append it to `records` unless that is None.

        Raises:
            Exception: the batch is refused; nothing has changed.
        """
        contents = self.contents
        gone = 0
        if contents.clock is not None:
            clock = contents.expires_before(batch)
            if clock is not None:
                contents.check(batch)  # a refused batch makes no points leave
                gone = self.expire(clock, records)
                if gone and expired is not None:
                    expired()
        applied = self._tear(batch)
        if write.producer:
            assert self._producers is not None  # `is_new` has asked them
            self._producers.applied(write.producer, write.sequence, write.owner, now, may_skip=write.may_skip)
        if gone:
            applied.expired = gone
        chosen = self.center if contents.globe is not None and self._follow_center() else None
        cause = contents.cause(batch)
        self._applied(applied.points, cause, hull_changed=applied.hull_changed)
        if records is not None:
            rows = contents.rows(batch, applied)
            numbered = write.producer, write.sequence
            records.append(
                Record(applied.revision, rows, *numbered, contents.clock, chosen, may_skip=write.may_skip, cause=cause)
            )
        self.torn = False
        return applied

    def expire(self, clock: int, records: list[Record] | None) -> int:
        """Advance the hull's clock, and remove the points that leave then as a revision of its own.

        Returns their number; if it is 0, nothing has changed.
        """
        changes = self.hull.changes
        self.torn = True
        rows = self.contents.expire(clock)
        if rows is not None:
            self._applied(len(self.hull), "expiry", hull_changed=self.hull.changes != changes)
            if records is not None:
                records.append(Record(self.counts.revision, rows, clock=self.contents.clock, cause="expiry"))
        self.torn = False
        return 0 if rows is None else rows.points

    def recenter(self, center: Center | None, records: list[Record] | None) -> bool:
        """Move the centre as a revision of its own, by default to the mean direction of the points.

        Returns whether the vertices have changed.

        Raises:
            MisfitError: the hull is a plane, or cannot have this centre; nothing has changed.
        """
        changes = self.hull.changes
        rows = self.contents.recenter(center)
        self._follow_center()
        hull_changed = self.hull.changes != changes
        self._applied(len(self.hull), "recenter", hull_changed=hull_changed)
        if records is not None:
            clock, center = self.contents.clock, self.center
            records.append(Record(self.counts.revision, rows, clock=clock, center=center, cause="recenter"))
        return hull_changed

    def stand_at(self, center: Center) -> None:
        """Have a centre that no revision has given: of a hull that has neither points nor a centre so far."""
        self.contents.recenter(center)
        self._follow_center()
        cause = self.counts.cause
        self.counts = self._counted(self.counts.revision, len(self.hull), cause, center, self.counts.outlined)

    def _follow_center(self) -> bool:
        """Take over the centre of the hull. Returns whether it is a new one."""
        globe = self.contents.globe
        if globe is None:
            return False
        assert isinstance(self.hull, GeographicHull)  # it has a frame
        return globe.follow(self.hull.center)

    def _applied(self, points: int, cause: Cause, *, hull_changed: bool, revision: int | None = None) -> None:
        """Update the counts and what was sent after a change, by default that of the next revision."""
        before = self.counts
        globe = self.contents.globe
        center = None if globe is None else globe.center
        revision, outlined = before.revision + 1 if revision is None else revision, before.outlined
        if hull_changed:
            outlined = self._changed(revision)
        if center is not before.center and center != before.center:
            outlined = revision
        self.counts = self._counted(revision, points, cause, center, outlined)

    def _changed(self, revision: int) -> int:
        """Note that a revision, which is returned, has other vertices than those before."""
        self._sent_vertices().changed(revision)
        self._changed_at = revision
        return revision

    def _counted(self, revision: int, points: int, cause: Cause | None, center: Center | None, outlined: int) -> Counts:
        contents = self.contents
        distinct, clock = self.hull.distinct, contents.clock
        quarantine = contents.quarantine if isinstance(contents, Keyed) else None
        if quarantine is None:
            return Counts(revision, points, distinct, clock, cause, center, outlined)
        held, rules = len(quarantine), quarantine.rules
        return Counts(revision, points, distinct, clock, cause, center, outlined, held, rules)

    def put_away(self, *, idle: bool) -> None:
        """Hold the keys of a small hull in less memory until they are needed.

        Args:
            idle: only if nobody has used them since the last call.
        """
        if isinstance(self.hull, AnyKeyedHull) and self.counts.points <= PUT_AWAY_POINTS:
            self.hull.pack(idle=idle)

    # Reads

    def vertices(self) -> Points:
        """The vertices; the same array object while the hull has not changed."""
        if self._vertices_as_of != self.hull.changes:
            sent = self._sent_vertices()
            self._vertices = self.hull.vertices()
            self._vertices.setflags(write=False)
            self._vertices_as_of = self.hull.changes
            sent.record(self._changed_at, self._vertices)
        return self._vertices

    def layer(self, number: int) -> Points:
        """The vertices of a convex layer, from 1; none if the points run out. The same array until they change."""
        if number == 1:
            return self.vertices()
        if self._layers is None:
            self._layers = {}
        revision, vertices = self._layers.get(number, (-1, NO_POINTS))
        if revision != self.counts.revision:
            found = layer_of(self.hull, number)
            if revision < 0 or not np.array_equal(found, vertices):
                vertices = found
            self._layers[number] = self.counts.revision, vertices
        return vertices

    def outline(self) -> Outline:
        """What answers queries that depend on the vertices alone: the hull itself or, on the globe, its outline."""
        if isinstance(self.hull, GeographicHull):
            vertices, center = self.vertices(), self.center
            if self._outline is None or self._outline[0] is not vertices or self._outline[1] != center:
                self._outline = vertices, center, GlobeOutline(vertices, center)
            return self._outline[2]
        return self.hull

    def vertex_keys(self) -> VertexKeys:
        """The key at each vertex of a keyed hull; the same array object while no vertex has changed its key."""
        revision = self.counts.revision
        if self._keys_as_of != revision:
            keys = key_array(self._keyed, self._keyed.vertex_keys())
            if self._vertex_keys is None or not np.array_equal(self._vertex_keys, keys):
                self._vertex_keys = keys
            self._keys_as_of = revision
        assert self._vertex_keys is not None  # set above
        return self._vertex_keys

    def entities(self) -> Contents | None:
        """The keys of a keyed hull with their positions, None for a hull without keys. O(n log n)."""
        return self.contents.stored() if isinstance(self.hull, AnyKeyedHull) else None

    def keys_at(self, places: Points) -> VertexKeys:
        """The key at each of some places of a keyed hull, all of which have one."""
        return key_array(self._keyed, self._keyed.keys_at(places))

    @property
    def _keyed(self) -> AnyKeyedHull:
        assert isinstance(self.hull, AnyKeyedHull)  # nobody asks others for keys
        return self.hull

    def earlier_vertices(self, revision: int) -> Points | None:
        """The vertices at an earlier revision, None where they were never sent; raises RevisionForgottenError."""
        return self._sent_vertices().at(revision, self.counts.revision)

    def _sent_vertices(self) -> SentVertices:
        if self._sent is None:
            self._sent = SentVertices(self._limits.resume_bytes, self._vertices, self._changed_at)
        return self._sent

    def last_sequence(self, producer: str) -> int:
        """The last sequence number applied of a producer, 0 where there is none."""
        return 0 if self._producers is None else self._producers.last(producer)

    def kept(self) -> Kept:
        """The hull at this revision, for a snapshot. O(n)."""
        return Kept(
            self.counts.revision,
            self.contents.stored(),
            {} if self._producers is None else self._producers.state(),
            clock=self.contents.clock,
            center=self.center,
            skipping=frozenset() if self._producers is None else self._producers.skipping(),
            rules=None if self.quarantine is None else self.quarantine.rules,
        )

    def _new_producers(self, last: dict[str, int], skipping: frozenset[str], now: float) -> Producers:
        limits = self._limits
        return Producers(limits.max_producers, limits.max_producers_per_caller, last, skipping, now)


def key_array(hull: AnyKeyedHull, keys: Sequence[str | int | None]) -> VertexKeys:
    """The keys of a hull as an array."""
    return np.array(keys, object if hull.key_type == "str" else np.uint64)


def last_cause(kept: Kept) -> Cause | None:
    """What made the last revision; None where that is not known."""
    return _cause_of(kept.records[-1]) if kept.records else None


def _cause_of(record: Record) -> Cause:
    """What made a revision, by its rows where formats before 11 did not say."""
    if record.cause is not None:
        return record.cause
    if record.shares is not None:
        return "expiry" if record.shares.expiry else "batch"
    if record.center is not None and not len(record.rows):
        return "recenter"
    return "expiry" if isinstance(record.rows, Expiry) else "batch"


def last_sequences(kept: Kept) -> dict[str, int]:
    """The last number of each producer."""
    last = dict(kept.producers)
    for record in kept.records:
        if record.producer:
            last[record.producer] = record.sequence
    return last


def skipping_of(kept: Kept) -> frozenset[str]:
    """The producers that may skip numbers."""
    return kept.skipping | {record.producer for record in kept.records if record.may_skip}
