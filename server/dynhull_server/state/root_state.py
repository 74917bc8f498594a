"""The root of a hull over shards as its readers see it: the vertices of all shards, and the counts of all points.

It follows what its shards have done, and decides nothing.
"""

from collections.abc import Sequence

from .contents import replayed
from .contents.live import LiveContents
from .hull_state import Counts, HullState
from .limits import Limits
from .records import Cause, HullSettings, Kept, Record, Tally


class RootState(HullState):
    """The vertices of all shards in place of the points of a hull. Questions about all points are for the shards.

    Attributes:
        division: how the points are divided.
        tallies: what is known of each shard.
        due: the time by the server's clock before which no point leaves; None if that clock makes none leave, and
            before the shards have said so.
    """

    def __init__(self, limits: Limits, settings: HullSettings, kept: Kept, now: float) -> None:
        assert settings.divided
        self.division, tallies = kept.divided(settings)
        self.tallies = [tallies.get(shard, Tally()) for shard in range(self.division.shards)]
        self.due: int | None = None
        self._keyed_shards = settings.identity != "multiset"
        self._by_data = settings.window is not None and settings.window.clock == "data"
        self._clock = kept.records[-1].clock if kept.records else kept.clock
        super().__init__(limits, settings, kept, now)
        self._max_producers = limits.max_producers

    @property
    def follows_server(self) -> bool:
        """Whether the clock, if any, follows the server's, rather than event times."""
        return not self._by_data

    @property
    def next_due(self) -> int | None:
        """The time by the server's clock before which no point leaves; None if that clock makes none leave."""
        return self.due

    @property
    def clock(self) -> int | None:
        """The clock of the hull, None for a hull without a clock so far."""
        return self._clock

    @property
    def producers(self) -> dict[str, int]:
        """The last sequence number of each producer."""
        return {} if self._producers is None else self._producers.state()

    @property
    def skipping(self) -> frozenset[str]:
        """The producers whose numbers may be skipped."""
        return frozenset() if self._producers is None else self._producers.skipping()

    def follow(self, decided: Sequence[Record], now: float, records: list[Record] | None) -> None:
        """Apply revisions, which the shards have, and append them to `records` unless that is None."""
        self.torn = True
        for record in decided:
            assert record.revision == self.counts.revision + 1  # the root has numbered them
            assert record.shares is not None
            divides = record.shares.division is not None
            if divides:
                self.vertices()
            changes = self.hull.changes
            self.contents.replay([record])
            if divides:  # other vertices of shards, but the same hull
                changes = self._vertices_as_of = self.hull.changes
            self._count(record)
            if record.producer:
                if self._producers is None:
                    self._producers = self._new_producers({}, frozenset(), now)
                self._producers.applied(record.producer, record.sequence, "", now, may_skip=record.may_skip)
                self._producers.forget_beyond(self._max_producers)
            assert record.cause is not None  # its log has written it
            self._applied(0, record.cause, hull_changed=self.hull.changes != changes)
            if records is not None:
                records.append(record)
        self.torn = False

    def catch_up(self, records: Sequence[Record], now: float) -> None:
        """Apply the next revisions, which another server has committed."""
        for record in records:
            self._count(record)
        super().catch_up(records, now)

    def kept(self) -> Kept:
        """The root at this revision, for a snapshot. O(number of vertices of all shards)."""
        kept = super().kept()
        kept.clock = self._clock
        kept.tallies = dict(enumerate(self.tallies))
        kept.division = self.division
        return kept

    def _count(self, record: Record) -> None:
        assert record.shares is not None  # it is a revision of a root
        self._clock = record.clock
        if record.shares.division is not None:
            self.division = record.shares.division
            self.tallies = [Tally()] * self.division.shards
        for shard, tally in record.shares.tallies.items():
            self.tallies[shard] = tally

    def _counted(self, revision: int, _: int, cause: Cause | None, __: object, outlined: int) -> Counts:
        """The counts of all points. Keys of two shards may be at one place: how many places there are is not known."""
        points = sum(each.points for each in self.tallies)
        distinct = 0 if self._keyed_shards else sum(each.distinct for each in self.tallies)
        return Counts(revision, points, distinct, self._clock, cause, outlined=outlined, shards=self.division.shards)


def state_of(
    limits: Limits, settings: HullSettings, kept: Kept, now: float, contents: LiveContents | None = None
) -> HullState:
    """A hull with these settings as stored; its contents may have begun before, unless it is divided."""
    if settings.divided:
        return RootState(limits, settings, kept, now)
    contents = replayed(kept, settings, limits.points_of(settings), contents)
    return HullState(limits, settings, kept, now, contents)
