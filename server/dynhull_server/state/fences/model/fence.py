"""A fence as clients see it: its committed state, and recent events."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dynhull.keys import key_list

from ...alarms.watched import WatchedHulls
from ...records import NO_TIME, Keys
from .delays import Delays
from .dwell import Dwelling, dwelling_after
from .expected import Expectations, expectations_of
from .records import Consumer, FenceEvent, FenceRow, KeptFence, Key
from .tallies import Column, Tallies

if TYPE_CHECKING:
    from ...hull import Hull
    from ..events.recent import RecentEvents
    from ..index.pair import Pair
    from ..index.subjects import Subjects


MICROSECONDS = 10**6


class FenceCount:
    """An integer of a fence in a column of its tallies."""

    __slots__ = ("_column",)

    def __init__(self, column: Column) -> None:
        self._column = column

    def __get__(self, fence: "Fence", _: type) -> int:
        return int(fence.tallies.columns[self._column, fence.place])

    def __set__(self, fence: "Fence", value: int) -> None:
        fence.tallies.columns[self._column, fence.place] = value


class Fence:
    """One fence from its creation to its deletion.

    Args:
        row: its identity and settings.

    Attributes:
        row: its identity and settings, as stored.
        area: the hull that is its area, or None.
        subjects: the hulls whose keys it compares, by name; replaced as a whole where it changes.
        pair: the two hulls that it compares as wholes, or None.
        watched: the hulls of an alarm, as of the last request; None for a fence.
        last: the sequence of the last committed event, 0 before the first.
        first: the sequence of the oldest event that is kept; last + 1 if none is.
        time: the time of the last event, NO_TIME before the first.
        inside: the number of subjects inside, as of the last commit.
        consumers: its consumers, as of the last commit.
        dwelling: who waits for a dwell event, as of the last commit; None where the fence makes none.
        delays: changes of side that are no events yet, as of the last request, like the subjects' indexes; None where
            the fence has no rules that delay.
        due: when it is planned to look at those who wait, None if it is not.
        unsaved: the number of events since who is inside was last stored.
        ended: whether it has been deleted.
        tallies, place: where the integers above are: with those of other fences, once it has been created.
    """

    first, last, time = FenceCount(Column.FIRST), FenceCount(Column.LAST), FenceCount(Column.TIME)
    inside, unsaved = FenceCount(Column.INSIDE), FenceCount(Column.UNSAVED)

    def __init__(self, row: FenceRow) -> None:
        self.tallies = Tallies(room=1)
        self.place = self.tallies.add(row.number)
        self._recent: RecentEvents | None = None
        self.row = row
        self.delays = Delays(row.config) if row.config.delays else None
        self.area: Hull | None = None
        self.subjects: dict[str, Subjects] = {}
        self.pair: Pair | None = None
        rule = row.config.rule
        self.watched = None if rule is None else WatchedHulls(rule, int(row.created * MICROSECONDS))
        self.first = 1
        self.time = NO_TIME
        self.consumers: dict[str, Consumer] = {}
        self.dwelling: Dwelling | None = None
        self.expectations: Expectations | None = None
        self.due: int | None = None
        self.ended = False

    def join(self, tallies: Tallies, recent: "RecentEvents") -> None:
        """Keep its integers, and read its recent events, where those of others are."""
        self._move(tallies)
        tallies.owners[self.place] = self
        self._recent = recent

    def part(self, recent: "RecentEvents") -> None:
        """Keep its integers for itself, after its deletion, and what is left of its events."""
        shared = self.tallies
        self._move(Tallies(room=1))
        shared.remove(self.number)
        self._recent = recent

    def _move(self, tallies: Tallies) -> None:
        columns = self.tallies.columns[:, self.place]
        self.tallies, self.place = tallies, tallies.add(self.number)
        tallies.columns[:, self.place] = columns
        tallies.ruled += int(columns[Column.RULES])

    @property
    def name(self) -> str:
        """Its name."""
        return self.row.name

    @property
    def number(self) -> int:
        """Its number."""
        return self.row.number

    @property
    def subject_count(self) -> int:
        """The number of keys that it compares. O(hulls)."""
        return sum(each.hull.counts.points for each in self.subjects.values())

    @property
    def next_due(self) -> int | None:
        """When a time that subjects wait for has passed next; None if none waits."""
        times = []
        if self.dwelling is not None and self.dwelling.first is not None:
            times.append(self.dwelling.first + self.row.config.dwell)
        if self.delays is not None and self.delays.first is not None:
            times.append(self.delays.first + self.row.config.min_dwell)
        if self.watched is not None and (due := self.watched.first_due) is not None:
            times.append(due)
        if self.expectations is not None and (due := self.expectations.first_due) is not None:
            times.append(due)
        return min(times, default=None)

    def due_after(self, time: int) -> int | None:
        """When a time that subjects wait for will have passed next, of those that have not at a time; None for none.

        O(those that have).
        """
        times = []
        if self.dwelling is not None and (since := self.dwelling.first_after(time - self.row.config.dwell)) is not None:
            times.append(since + self.row.config.dwell)
        if self.delays is not None and (since := self.delays.first_after(time - self.row.config.min_dwell)) is not None:
            times.append(since + self.row.config.min_dwell)
        if self.watched is not None and (due := self.watched.first_due_after(time)) is not None:
            times.append(due)
        if self.expectations is not None and (due := self.expectations.due_after(time)) is not None:
            times.append(due)
        return min(times, default=None)

    @property
    def waiting(self) -> int:
        """The number of subjects that wait for a time."""
        return sum(
            len(each) for each in (self.dwelling, self.delays, self.watched, self.expectations) if each is not None
        )

    def keys_inside(self, subjects: "Subjects") -> Keys:
        """The keys of a hull that are inside, ascending, as its events say."""
        keys = subjects.index.inside(self.number)
        delays = {} if self.delays is None else self.delays.of(subjects.hull.name)
        return subjects.keys(set(key_list(keys)) ^ delays.keys()) if delays else keys

    def count_inside(self) -> None:
        """Count the subjects that are inside."""
        if self.pair is not None:
            self.inside = int(self.pair.near)
            return
        if self.watched is not None:
            self.inside = len(self.watched.raised)
            return
        self.inside = sum(each.index.count(self.number) for each in self.subjects.values())
        if self.delays is not None:
            self.inside += self.delays.balance

    def count_expected(self) -> None:
        """Find which of the keys that it expects are inside. O(those inside)."""
        if self.expectations is None:
            return
        found: dict[Key, int] = {}
        for subjects in self.subjects.values():
            for key in key_list(self.keys_inside(subjects)):
                if key in self.expectations.keys:
                    found[key] = found.get(key, 0) + 1
        self.expectations.found(found)

    def restored(self, kept: KeptFence) -> None:
        """Take over what the storage has; who is inside belongs to the subjects."""
        self.row = kept.row
        self.last, self.first = kept.last, kept.first
        self.consumers = dict(kept.consumers)
        self.dwelling = dwelling_after(kept)
        delays = {subject: delay for subject, delay in kept.delays.items() if subject[0]}
        self.delays = Delays(kept.row.config, delays) if kept.row.config.delays else None
        self.expectations = expectations_of(kept.row.config, kept.row.waits.time, kept.delays.items())
        self.unsaved = len(kept.events)
        self.time = max(self.time, kept.row.waits.time, kept.inside.time)
        if kept.events:
            self.time = max(self.time, kept.events[-1].time)
        if self.delays is not None:
            self.time = max(self.time, self.delays.newest)
        if self.expectations is not None:
            self.time = max(self.time, self.expectations.passed)
        self.note_settings()

    def note_settings(self) -> None:
        """Count what its settings ask for."""
        looks = self.dwelling, self.delays, self.expectations
        self.tallies.rule(self.place, rules=any(each is not None for each in looks))
        limits = self.row.config.max_events or self.row.config.max_event_age
        self.tallies.columns[Column.LIMITED, self.place] = bool(limits)

    def published(self, events: Sequence[FenceEvent]) -> None:
        """Record committed events."""
        self.last = events[-1].sequence
        self.time = events[-1].time
        if self.dwelling is not None:
            self.dwelling.follow(events)
        self.unsaved += len(events)

    def events(self, after: int, most: int) -> list[FenceEvent] | None:
        """At most that many committed events after a sequence; None if the first of them is not in memory."""
        after = max(after, self.first - 1)
        if after >= self.last:
            return []
        return None if self._recent is None else self._recent.events(self.number, after, most)

    def published_among(self, events: list[FenceEvent]) -> list[FenceEvent]:
        """Events from the storage, without those of a commit of a moment ago: others are not told of them yet."""
        if not events or events[-1].sequence <= self.last:
            return events
        return [each for each in events if each.sequence <= self.last]

    @property
    def oldest_recent(self) -> int:
        """The sequence of the oldest event in memory; that of the next one if there is none."""
        first = None if self._recent is None else self._recent.first(self.number)
        return self.last + 1 if first is None else first

    def backlog(self, consumer: Consumer) -> int:
        """The number of events that are kept and not acknowledged."""
        return self.last - max(consumer.acknowledged, self.first - 1)
