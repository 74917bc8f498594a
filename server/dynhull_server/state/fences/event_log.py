"""The events that a trip makes of crossings, without an object for each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dynhull import Crossings

from ..records import NO_TIME, Times
from .event_block import Bytes, EventBlock, Integers, joined, key_columns
from .fence import Fence
from .records import Cause, EventType, FenceEvent
from .subjects import Subjects

# A cause as the index knows it, and what it is here.
Swap = tuple[Cause, Cause]
# The type of an event by its change of side, -1 for the last one.
TYPES = np.array([EventType.CROSS, EventType.ENTER, EventType.EXIT], np.uint8)


class Told(NamedTuple):
    """What a trip has said of a fence so far.

    Attributes:
        last: the sequence of the last event.
        time: its time.
        made: the number of events.
        change: by how many more subjects are inside.
    """

    last: int
    time: int
    made: int
    change: int


@dataclass(frozen=True, slots=True)
class _Crossed:
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

    Attributes:
        told: what has been said of each fence, by its number, as of the last `settle`.
    """

    def __init__(self) -> None:
        self.told: dict[int, Told] = {}
        self._waiting: list[_Crossed] = []
        self._blocks: list[EventBlock] = []
        self._fences: dict[int, Fence] = {}

    def add(
        self,
        subjects: Subjects,
        crossings: Crossings,
        area_revisions: Mapping[str, int],
        swap: Swap | None,
        now: int,
    ) -> None:
        """Make an event of each crossing; `swap` is a cause, and the one that it stands for."""
        revision, times = subjects.hull.state.counts.revision, subjects.times(crossings.keys)
        self._waiting.append(_Crossed(subjects, crossings, revision, area_revisions, times, swap, now))

    def settle(self) -> None:
        """Give the events their numbers. O(events)."""
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            self._blocks += map(self._numbered, waiting)

    def block(self) -> EventBlock | None:
        """All events; None if there are none. To be called after `settle`."""
        if len(self._blocks) > 1:
            self._blocks = [joined(self._blocks)]
        return self._blocks[0] if self._blocks else None

    def fences(self) -> Sequence[tuple[Fence, Told]]:
        """The fences with events."""
        return [(self._fences[number], told) for number, told in self.told.items()]

    def events(self, fence: Fence) -> list[FenceEvent]:
        """The events of one fence so far."""
        self.settle()
        found: list[FenceEvent] = []
        for block in self._blocks if fence.number in self.told else ():
            for run in np.flatnonzero(block.fences == fence.number).tolist():
                found += block.events(run)
        return found

    def _numbered(self, crossed: _Crossed) -> EventBlock:
        crossings, told = crossed.crossings, self.told
        changes, numbers = crossings.changes, crossings.fences
        starts = first_rows(numbers)
        counts = np.diff(starts, append=len(numbers))
        of_runs = numbers[starts]
        firsts, times, areas = [], [], []
        moved = np.add.reduceat(changes, starts, dtype=np.int64)
        for number, count, change in zip(of_runs.tolist(), counts.tolist(), moved.tolist(), strict=True):
            before = told.get(number)
            if before is None:
                fence = self._fences[number] = crossed.subjects.fences[number]
                before = Told(fence.last, fence.time, 0, 0)
            else:
                fence = self._fences[number]
            time = max(crossed.now, before.time)
            told[number] = Told(before.last + count, time, before.made + count, before.change + change)
            firsts.append(before.last + 1)
            times.append(time)
            if crossed.area_revisions:
                areas.append(0 if fence.area is None else crossed.area_revisions[fence.area.name])
        kind, lengths, keys = key_columns(crossings.keys)
        event_times = crossed.event_times
        none = np.full(len(numbers), NO_TIME)
        return EventBlock(
            of_runs,
            np.array(firsts, np.int64),
            counts,
            [crossed.subjects.hull.name] * len(starts),
            np.full(len(starts), kind, np.uint8),
            np.full(len(starts), crossed.revision),
            np.array(areas, np.int64) if areas else np.zeros(len(starts), np.int64),
            np.array(times, np.int64),
            TYPES[changes],
            _caused(crossings.causes, crossed.swap),
            lengths,
            keys,
            crossings.points,
            crossings.previous,
            np.where(np.isnan(crossings.points[:, 0]), np.nan, crossings.distances),
            none if event_times is None else event_times,
            none,
        )


def first_rows(numbers: Integers) -> Integers:
    """The rows at which the number of another fence begins."""
    return np.flatnonzero(np.append(True, numbers[1:] != numbers[:-1]))


def _caused(causes: Bytes, swap: Swap | None) -> Bytes:
    """Sets of causes with one cause in the place of another one."""
    if swap is None:
        return causes
    meant, stands_for = np.uint8(swap[0]), np.uint8(swap[1])
    return np.where(causes & meant, causes & ~meant | stands_for, causes)
