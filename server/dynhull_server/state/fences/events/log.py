"""The events that a trip makes of crossings, without an object for each."""

from collections.abc import Mapping

import numpy as np

from dynhull.crossings import PackedCrossings

from ....compiled import native
from ..index.subjects import Subjects
from ..model.records import FenceEvent
from ..model.tallies import Column, Tallies
from .block import EventBlock, Integers, joined
from .sequences import Crossed, Swap, Told, numbered, numbered_natively


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
        self._waiting: list[Crossed] = []
        self._blocks: list[EventBlock] = []

    def add(
        self,
        subjects: Subjects,
        packed: PackedCrossings,
        area_revisions: Mapping[str, int],
        swap: Swap | None,
        now: int,
    ) -> None:
        """Make an event of each crossing; `swap` is a cause, and the one that it stands for."""
        if self._waiting and now < self._waiting[-1].now:  # of one fence the time of events never goes back
            self.settle()
        hull, areas = subjects.hull, None
        if area_revisions:
            areas = {}
            for number in packed.unpack().fences.tolist():
                area = subjects.fences[number].area
                areas[number] = 0 if area is None else area_revisions.get(area.name, 0)
        times = subjects.times(packed.unpack().keys) if subjects.timed else None
        self._waiting.append(Crossed(packed, hull.row.name, hull.state.counts.revision, areas, times, swap, now))

    def settle(self) -> None:
        """Give the events their numbers. O(n log n) for n events."""
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            if native is not None and self.told is None:
                block, self.told = numbered_natively(native, waiting, self._tallies)
            else:
                block, told = numbered(waiting, self._before)
                self._tell(told)
            self._blocks.append(block)

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

    def _before(self, numbers: Integers) -> Told:
        """What is known of fences: as of the last commit, and what the trip has said since."""
        places = self._tallies.places(numbers)
        columns = self._tallies.columns
        nothing = np.zeros(len(numbers), np.int64)
        before = Told(numbers, places, columns[Column.LAST][places], columns[Column.TIME][places], nothing, nothing)
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
