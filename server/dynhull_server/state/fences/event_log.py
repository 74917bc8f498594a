"""The events that a trip makes of crossings, without an object for each."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from dynhull import Crossings

from ..records import NO_TIME, Times
from .event_block import Bytes, EventBlock, Integers, joined, key_columns
from .records import Cause, EventType, FenceEvent
from .subjects import Subjects
from .tallies import Column, Tallies

# A cause as the index knows it, and what it is here.
Swap = tuple[Cause, Cause]
# The type of an event by its change of side, -1 for the last one.
TYPES = np.array([EventType.CROSS, EventType.ENTER, EventType.EXIT], np.uint8)


class Told(NamedTuple):
    """What a trip has said so far of k fences, by ascending numbers.

    Attributes:
        fences: (k,) their numbers.
        places: (k,) where they are counted.
        lasts: (k,) the sequence of the last event of each.
        times: (k,) its time.
        made: (k,) the number of events.
        changes: (k,) by how many more subjects are inside.
    """

    fences: Integers
    places: Integers
    lasts: Integers
    times: Integers
    made: Integers
    changes: Integers

    def of(self, number: int) -> tuple[int, int] | None:
        """The last sequence of a fence, and the time of that event; None if nothing was said."""
        row = int(self.fences.searchsorted(number))
        if row == len(self.fences) or self.fences[row] != number:
            return None
        return int(self.lasts[row]), int(self.times[row])


class _Crossed(NamedTuple):
    """Crossings of one revision, whose events have no numbers yet.

    Attributes:
        subjects: the hull of the subjects.
        crossings: the crossings.
        revision: the revision of that hull.
        area_revisions: those of the hulls that are areas of its fences, by name.
        event_times: the times of the positions, or None.
        swap: a cause, and the one that it stands for.
        now: the time.
    """

    subjects: Subjects
    crossings: Crossings
    revision: int
    area_revisions: Mapping[str, int]
    event_times: Times | None
    swap: Swap | None
    now: int


class EventLog:
    """Crossings become events of their fences in the order in which they came.

    They get their numbers together, once for a trip as a rule.

    Args:
        tallies: what is counted of the fences, as of the last commit.

    Attributes:
        told: what has been said, as of the last `settle`; None for nothing.
    """

    def __init__(self, tallies: Tallies) -> None:
        self.told: Told | None = None
        self._tallies = tallies
        self._waiting: list[_Crossed] = []
        self._blocks: list[EventBlock] = []

    def add(
        self,
        subjects: Subjects,
        crossings: Crossings,
        area_revisions: Mapping[str, int],
        swap: Swap | None,
        now: int,
    ) -> None:
        """Make an event of each crossing; `swap` is a cause, and the one that it stands for."""
        if self._waiting and now < self._waiting[-1].now:  # of one fence the time of events never goes back
            self.settle()
        revision, times = subjects.hull.state.counts.revision, subjects.times(crossings.keys)
        self._waiting.append(_Crossed(subjects, crossings, revision, area_revisions, times, swap, now))

    def settle(self) -> None:
        """Give the events their numbers. O(n log n) for n events."""
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            self._blocks.append(self._numbered(waiting))

    def block(self) -> EventBlock | None:
        """All events; None if there are none. To be called after `settle`."""
        if len(self._blocks) > 1:
            self._blocks = [joined(self._blocks)]
        return self._blocks[0] if self._blocks else None

    def last(self, number: int) -> tuple[int, int] | None:
        """The last sequence of a fence, and the time of that event; None if it has no events of crossings."""
        self.settle()
        return None if self.told is None else self.told.of(number)

    def events(self, number: int) -> list[FenceEvent]:
        """The events of one fence so far."""
        self.settle()
        found: list[FenceEvent] = []
        for block in self._blocks:
            for run in np.flatnonzero(block.fences == number).tolist():
                found += block.events(run)
        return found

    def _numbered(self, waiting: list[_Crossed]) -> EventBlock:
        counts = [len(each.crossings) for each in waiting]
        fences, changes = _column(waiting, "fences"), _column(waiting, "changes")
        points, distances = _column(waiting, "points"), _column(waiting, "distances")
        n = len(fences)
        # Of each fence the events follow each other.
        order = fences.argsort(kind="stable")
        ascending = fences[order]
        groups = first_rows(ascending)
        made = sizes(groups, n)
        numbers = ascending[groups]
        before = self._before(numbers)
        sequences = np.empty(n, np.int64)
        sequences[order] = np.arange(1, n + 1) + (before.lasts - groups).repeat(made)
        times = np.empty(n, np.int64)
        times[order] = before.times.repeat(made)
        if waiting[0].now == waiting[-1].now:  # they never go back
            np.maximum(times, waiting[0].now, out=times)
        else:
            np.maximum(times, np.array([each.now for each in waiting]).repeat(counts), out=times)
        self._tell(
            Told(
                numbers,
                before.places,
                before.lasts + made,
                times[order[groups + made - 1]],
                before.made + made,
                before.changes + np.add.reduceat(changes[order], groups, dtype=np.int64),
            )
        )
        ends = np.cumsum(counts)
        runs = first_rows(fences, ends[:-1])
        moments = ends.searchsorted(runs, "right")  # of each run, which crossings it is part of
        names = tuple({each.subjects.hull.name: None for each in waiting})
        keys = [key_columns(each.crossings.keys) for each in waiting]
        none = np.full(n, NO_TIME)
        event_times = none
        if any(each.event_times is not None for each in waiting):
            columns = (each.event_times for each in waiting)
            event_times = _joined(
                [np.full(count, NO_TIME) if each is None else each for count, each in zip(counts, columns, strict=True)]
            )
        distances = distances.copy()
        distances[points[:, 0] != points[:, 0]] = np.nan
        return EventBlock(
            fences[runs],
            sequences[runs],
            sizes(runs, n),
            np.array([names.index(each.subjects.hull.name) for each in waiting])[moments],
            np.array([kind for kind, _, _ in keys], np.uint8)[moments],
            np.array([each.revision for each in waiting])[moments],
            _area_revisions(waiting, fences[runs], moments),
            times[runs],
            TYPES[changes],
            _joined([_caused(each.crossings.causes, each.swap) for each in waiting]),
            _joined([lengths for _, lengths, _ in keys]),
            b"".join([data for _, _, data in keys]),
            points,
            _column(waiting, "previous"),
            distances,
            event_times,
            none,
            names,
        )

    def _before(self, numbers: Integers) -> Told:
        """What is known of fences: as of the last commit, and what the trip has said since."""
        places = self._tallies.places(numbers)
        columns = self._tallies.columns
        nothing = np.zeros(len(numbers), np.int64)
        before = Told(numbers, places, columns[Column.LAST, places], columns[Column.TIME, places], nothing, nothing)
        told = self.told
        if told is None:
            return before
        rows = np.minimum(told.fences.searchsorted(numbers), len(told.fences) - 1)
        known = told.fences[rows] == numbers
        return Told(
            numbers,
            places,
            *(np.where(known, new[rows], old) for new, old in zip(told[2:], before[2:], strict=True)),
        )

    def _tell(self, new: Told) -> None:
        """Add what was said of some fences; nothing else is said of those before."""
        if self.told is not None:
            old = ~np.isin(self.told.fences, new.fences)
            both = [np.concatenate([column[old], more]) for column, more in zip(self.told, new, strict=True)]
            order = np.argsort(both[0], kind="stable")
            new = Told(*(column[order] for column in both))
        self.told = new


def _column(waiting: list[_Crossed], name: str) -> Any:
    return _joined([getattr(each.crossings, name) for each in waiting])


def _joined(columns: list[Any]) -> Any:
    return columns[0] if len(columns) == 1 else np.concatenate(columns)


def _area_revisions(waiting: list[_Crossed], fences: Integers, moments: Integers) -> Integers:
    """The revision of the area of each run, 0 where that is no hull."""
    if not any(each.area_revisions for each in waiting):
        return np.zeros(len(fences), np.int64)
    found = []
    for number, moment in zip(fences.tolist(), moments.tolist(), strict=True):
        each = waiting[moment]
        area = each.subjects.fences[number].area
        found.append(0 if area is None else each.area_revisions.get(area.name, 0))
    return np.array(found, np.int64)


def first_rows(numbers: Integers, more: Integers | None = None) -> Integers:
    """The rows at which the number of another fence begins, and some more."""
    begins = np.empty(len(numbers), np.bool_)
    begins[0] = True
    np.not_equal(numbers[1:], numbers[:-1], out=begins[1:])
    if more is not None:
        begins[more] = True
    return begins.nonzero()[0]


def sizes(starts: Integers, end: int) -> Integers:
    """How many rows there are from each of some rows to the next, or to the end."""
    found = np.empty(len(starts), np.int64)
    np.subtract(starts[1:], starts[:-1], out=found[:-1])
    found[-1] = end - starts[-1]
    return found


def _caused(causes: Bytes, swap: Swap | None) -> Bytes:
    """Sets of causes with one cause in the place of another one."""
    if swap is None:
        return causes
    meant, stands_for = np.uint8(swap[0]), np.uint8(swap[1])
    return np.where(causes & meant, causes & ~meant | stands_for, causes)
