"""The part of a trip at one fence."""

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from dynhull import Crossings
from dynhull.keys import PackedKeys, key_list, take_keys

from ...alarms.watched import Watched
from ...changes import FenceChange
from ...hull import Hull
from ...records import NO_TIME, Keys
from ..events.sequences import Swap, caused
from ..index.pair import Pair
from ..index.subjects import Subjects, keyed
from ..model.dwell import Dwelling
from ..model.expected import NOWHERE
from ..model.fence import Fence
from ..model.records import (
    AddFence,
    Cause,
    ChangeFence,
    Consumer,
    Delay,
    DropConsumer,
    DropEvents,
    DropFence,
    EventType,
    FenceEvent,
    FenceRow,
    Inside,
    KeptFence,
    Key,
    Members,
    Origin,
    Position,
    PutConsumer,
    PutDelays,
    Subject,
)

# Some rows of crossings.
Rows = slice | npt.NDArray[np.intp]
TYPES = {1: EventType.ENTER, -1: EventType.EXIT, 0: EventType.CROSS, 2: EventType.TRANSFER}
NO_KEYS = PackedKeys(b"", b"")
NOBODY: Mapping[Key, Origin] = MappingProxyType({})


class FenceLeg:
    """What a trip does to one fence.

    Args:
        fence: the fence.
        created: whether the trip creates it.
        told: the sequence and the time of the last event that the trip has made of it before; None for none.

    Attributes:
        fence: the fence.
        row: its identity and settings after the trip.
        area, pair: the hull that is its area, and the two hulls that it compares, after the trip.
        created, deleted: whether the trip creates or deletes it.
        events: the events that it makes, after those of crossings in the log of the trip.
        consumers: its consumers after the trip.
        first: the oldest event that is kept after the trip.
        inside: who is inside of a new fence that says nothing about it.
        delays: the delays that it changes.
        followed: of how many of its events it is known which of the expected keys they are about.
    """

    def __init__(self, fence: Fence, *, created: bool = False, told: tuple[int, int] | None = None) -> None:
        self.fence = fence
        self.row: FenceRow = fence.row
        self.area = fence.area
        self.pair = fence.pair
        self.created = created
        self.deleted = False
        self.events: list[FenceEvent] = []
        self.consumers = fence.consumers
        self.first = fence.first
        self.inside = Inside()
        self.delays: dict[Subject, Delay | None] = {}
        self.followed = 0
        self._last, self._told = (fence.last, fence.time) if told is None else told
        self._time = self._told

    @property
    def last(self) -> int:
        """The sequence of the last event."""
        return self.events[-1].sequence if self.events else self._last

    @property
    def area_revision(self) -> int:
        """The revision of the area's hull, 0 for other areas."""
        return 0 if self.area is None else self.area.state.counts.revision

    def time(self, now: int) -> int:
        """The time of an event that is made now: never before the one before it."""
        return max(now, self._time, self.events[-1].time if self.events else NO_TIME)

    def crossed(
        self,
        subjects: Subjects,
        crossings: Crossings,
        rows: Rows,
        swap: Swap | None,
        now: int,
        origins: Mapping[Key, Origin] = NOBODY,
    ) -> None:
        """Make an event of each of some crossings.

        Args:
            subjects: the keys of a hull.
            crossings: who has crossed.
            rows: those that become events.
            swap: a cause, and the one that it stands for.
            now: the time.
            origins: where subjects of this fence come from.
        """
        time, hull, revisions = self.time(now), subjects.hull.name, self._revisions(subjects.hull)
        keys = crossings.keys[rows] if isinstance(rows, slice) else take_keys(crossings.keys, rows)
        columns = zip(
            crossings.changes[rows].tolist(),
            crossings.causes[rows].tolist(),
            key_list(keys),
            crossings.points[rows].tolist(),
            crossings.previous[rows].tolist(),
            crossings.distances[rows].tolist(),
            _event_times(subjects, keys),
            strict=True,
        )
        for change, causes, key, (x, y), (before_x, before_y), distance, event_time in columns:
            gone = x != x  # NaN
            here, before = None if gone else (x, y), None if before_x != before_x else (before_x, before_y)
            far, origin = None if gone else distance, origins.get(key)
            subject = TYPES[change], caused(causes, swap), hull, key, *revisions
            self.events.append(FenceEvent(self.last + 1, *subject, here, before, far, event_time, time, origin=origin))

    def entered(self, subjects: Subjects, now: int) -> None:
        """Make an event of each subject that is inside of a new fence."""
        time, hull, revisions = self.time(now), subjects.hull.name, self._revisions(subjects.hull)
        keys = self.fence.keys_inside(subjects)
        points = keyed(subjects.hull.state).positions(keys).tolist()
        for key, (x, y), event_time in zip(key_list(keys), points, _event_times(subjects, keys), strict=True):
            subject = EventType.ENTER, Cause.CREATED, hull, key, *revisions
            self.events.append(FenceEvent(self.last + 1, *subject, (x, y), None, 0.0, event_time, time))

    def report(self, subjects: Subjects, found: Mapping[Key, tuple[EventType, int, int]], now: int) -> None:
        """Make an event of each of some keys that are there, given its type, why, and its first time."""
        time, hull, revisions = self.time(now), subjects.hull.name, self._revisions(subjects.hull)
        keys = subjects.keys(found)
        points = keyed(subjects.hull.state).positions(keys)
        delays = {} if self.fence.delays is None else self.fence.delays.of(subjects.hull.name)
        outside = np.array([found[key][0] is EventType.EXIT or key in delays for key in key_list(keys)], np.bool_)
        distances = subjects.distances(self, keys, points, outside)
        columns = zip(key_list(keys), points.tolist(), distances, _event_times(subjects, keys), strict=True)
        for key, (x, y), distance, event_time in columns:
            kind, causes, first_time = found[key]
            subject = kind, causes, hull, key, *revisions
            self.events.append(
                FenceEvent(self.last + 1, *subject, (x, y), None, distance, event_time, time, first_time)
            )

    def paired(self, pair: Pair, causes: int, now: int) -> None:
        """Make the event that two hulls begin or cease to be near."""
        kind = EventType.BEGIN if pair.near else EventType.CEASE
        hulls = kind, causes, pair.other.name, None, pair.other.state.counts.revision, pair.area.state.counts.revision
        self.events.append(FenceEvent(self.last + 1, *hulls, None, None, pair.distance, NO_TIME, self.time(now)))

    def alarmed(
        self,
        kind: EventType,
        causes: int,
        watched: Watched,
        values: tuple[float, float, float | None],
        began: tuple[int, int],
        now: int,
        keys: Keys | None = None,
    ) -> None:
        """Make the event that an alarm is raised or cleared for a hull.

        Args:
            kind: BEGIN if it is raised, CEASE if it is cleared.
            causes: why.
            watched: the hull.
            values: the measure, infinite for none, the bound and the measure before: the distance and the previous
                position of the event.
            began: the revision with which the condition began to hold, and its time: the revision of the area and the
                event time.
            now: the time.
            keys: those of the vertices that it is about: who is inside.
        """
        hull, (value, bound, previous), (revision, time) = watched.hull, values, began
        hulls = kind, causes, hull.name, None, hull.state.counts.revision, revision
        before = None if previous is None else (previous, bound)
        inside = () if keys is None or not len(keys) else (Members(hull.name, keys, hull.state.counts.revision),)
        self.events.append(FenceEvent(self.last + 1, *hulls, None, before, value, time, self.time(now), inside=inside))

    def left(self, subjects: Subjects, keys: Keys, cause: Mapping[Key, int] | int, now: int) -> None:
        """Make an exit of each of some keys of a hull that are gone, given why; with the positions they still have."""
        time, hull, revisions = self.time(now), subjects.hull.name, self._revisions(subjects.hull)
        points = keyed(subjects.hull.state).positions(keys).tolist()
        for key, (x, y) in zip(key_list(keys), points, strict=True):
            why, before = cause if isinstance(cause, int) else cause[key], None if x != x else (x, y)
            subject = EventType.EXIT, why, hull, key, *revisions
            self.events.append(FenceEvent(self.last + 1, *subject, None, before, None, NO_TIME, time))

    def order(self, first: int) -> None:
        """Order its events from one on by hull and key, as those of one revision are."""
        ordered = sorted(self.events[first:], key=lambda event: (event.hull, event.key))
        start = self.events[first].sequence if ordered else 0
        self.events[first:] = [event._replace(sequence=start + place) for place, event in enumerate(ordered)]

    def put_delay(self, subject: Subject, delay: Delay | None) -> None:
        """Put the delay of a subject in the place of the one before."""
        assert self.fence.delays is not None  # only such fences have subjects with delays
        self.fence.delays.set(subject, delay)
        if delay is not None:  # what confirms it may have arrived earlier
            self._time = max(self._time, delay.since)
        self.delays[subject] = delay
        self.fence.subjects[subject[0]].note_delays(self.fence)

    def put_expected(self, key: Key, stored: Delay | None) -> None:
        """Put what is stored of an expected key in the place of what was; None where nothing is new."""
        if stored is not None:
            self._time = max(self._time, stored.since)
            self.delays[NOWHERE, key] = stored

    def place(self, subjects: Subjects, key: Key) -> tuple[Position, float, int] | None:
        """Where a key is that is outside as the events say, its distance, and the time; None if it is not there."""
        hull, keys = subjects.hull, subjects.keys([key])
        points = keyed(hull.state).positions(keys)
        if np.isnan(points[0, 0]):
            return None
        delay = None if self.fence.delays is None else self.fence.delays.of(hull.name).get(key)
        outside = np.array([delay is None or not delay.enters])
        (distance,) = subjects.distances(self, keys, points, outside)
        x, y = points[0].tolist()
        return (x, y), distance, _event_times(subjects, keys)[0]

    def put_standing(self, hull: str, standing: Delay | None) -> None:
        """Put what an alarm has about a hull in the place of what it had."""
        self.delays[hull, ""] = standing

    def summed_up(self, kind: EventType, cause: int, now: int) -> None:
        """Make one event of all subjects that are inside."""
        everybody = kind, cause, "", None, 0, self.area_revision
        inside = tuple(members(self.fence))
        self.events.append(
            FenceEvent(self.last + 1, *everybody, None, None, None, NO_TIME, self.time(now), inside=inside)
        )

    def _revisions(self, hull: Hull) -> tuple[int, int]:
        """The revisions of a subject's hull and of the area."""
        return hull.state.counts.revision, self.area_revision

    def settings(self) -> Iterator[FenceChange]:
        """The changes to commit before its events."""
        if self.created:
            yield AddFence(self.row, self.inside)
        elif self.row is not self.fence.row and not self.deleted:
            yield ChangeFence(self.row)

    def changes(self) -> Iterator[FenceChange]:
        """The changes to commit after its events."""
        fence, number = self.fence, self.fence.number
        if self.deleted:
            yield DropFence(number)
            return
        if self.delays:
            yield PutDelays(number, self.delays)
        if self.first != fence.first:
            yield DropEvents(number, self.first)
        if self.consumers is not fence.consumers:
            for name, consumer in self.consumers.items():
                if fence.consumers.get(name) != consumer:
                    yield PutConsumer(number, consumer)
            for name in fence.consumers.keys() - self.consumers.keys():
                yield DropConsumer(number, name)

    def acknowledge(self, consumer: Consumer) -> None:
        """Put a consumer in the place of the one of its name."""
        self.consumers = self.consumers | {consumer.name: consumer}

    def landed(self, found: KeptFence | None) -> bool:
        """Whether the changes were committed, given the fence in the storage."""
        if self.deleted or found is None:
            return self.deleted and found is None
        same = all(found.delays.get(subject) == delay for subject, delay in self.delays.items())
        kept = found.row, found.first, found.last, found.consumers
        return same and kept == (self.row, self.first, self.last, self.consumers)

    def publish(self) -> None:
        """Make the changes, which are committed, those of the fence."""
        fence = self.fence
        begins = self.created or self.row.waits != fence.row.waits
        fence.row, fence.consumers, fence.first = self.row, self.consumers, self.first
        fence.area, fence.pair = self.area, self.pair
        fence.ended = self.deleted
        if self.events:
            fence.published(self.events)
        if not self.row.config.delays:
            fence.delays = None
        # What began and ended in the trip is not stored: the next event must not wait for it.
        stored = (each.since for each in self.delays.values() if each is not None)
        fence.time = max(fence.time, self._told, *stored)
        if not self.deleted:
            fence.count_inside()
            if begins:
                fence.time = max(fence.time, self.row.waits.time)
                fence.dwelling = Dwelling(self.row.waits, members(fence)) if self.row.config.dwell else None
        fence.note_settings()


def members(fence: Fence, dwelling: Dwelling | None = None) -> Iterator[Members]:
    """The subjects that are inside, by hull, and since when they wait; no keys of a hull that is near as a whole."""
    if fence.pair is not None and fence.pair.near:
        yield Members(fence.pair.other.name, NO_KEYS, fence.pair.other.state.counts.revision)
    for watched in () if fence.watched is None else fence.watched.raised.values():
        yield Members(watched.hull.name, NO_KEYS, watched.hull.state.counts.revision)
    for subjects in fence.subjects.values():
        keys = fence.keys_inside(subjects)
        if len(keys):
            since = None if dwelling is None else dwelling.times(subjects.hull.name, keys)
            yield Members(subjects.hull.name, keys, subjects.hull.state.counts.revision, since)


def _event_times(subjects: Subjects, keys: Keys) -> list[int]:
    """The time of the position of each key."""
    times = subjects.times(keys)
    return [NO_TIME] * len(keys) if times is None else times.tolist()
