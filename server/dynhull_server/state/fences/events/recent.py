"""Recent events in memory, which watchers read without the storage."""

from collections import deque
from collections.abc import Iterator

import numpy as np

from ..model.records import FenceEvent
from .block import EventBlock, Integers, joined

# The memory for the events of all fences together, whatever is allowed for each.
MOST_BYTES = 2**26
# Blocks with fewer events are joined: a reader looks into each.
LEAST_EVENTS = 1024
MOST_SMALL = 64


class RecentEvents:
    """The recent events of all fences, as columns; the oldest go first. Only who reads makes objects of them.

    Args:
        bytes_a_fence: the memory for each fence that there is.
    """

    def __init__(self, bytes_a_fence: int = 0) -> None:
        self._bytes_a_fence = bytes_a_fence
        self._blocks: deque[EventBlock] = deque()
        self._small: list[EventBlock] = []  # newer than the others
        self._waiting = 0  # events in them
        self._bytes = 0

    def add(self, block: EventBlock, number: int) -> None:
        """Add the events of a trip; `number` is the number of fences that there are. O(runs), as a rule O(1)."""
        self._bytes += block.bytes
        if len(block) >= LEAST_EVENTS:  # it is not copied
            self._join()
            self._blocks.append(block)
        else:
            self._small.append(block)
            self._waiting += len(block)
        if self._waiting >= LEAST_EVENTS or len(self._small) == MOST_SMALL:
            self._join()
        most = min(self._bytes_a_fence * number, MOST_BYTES)
        while self._bytes > most and len(self._blocks) + len(self._small) > 1:
            if not self._blocks:
                self._blocks.append(self._small.pop(0))
                self._waiting -= len(self._blocks[0])
            self._bytes -= self._blocks.popleft().bytes

    def _join(self) -> None:
        """Let the small blocks be one of the others."""
        if self._small:
            self._blocks.append(joined(self._small))
            self._small, self._waiting = [], 0

    def events(self, number: int, after: int, most: int) -> list[FenceEvent] | None:
        """At most that many events of a fence after a sequence that is not the last; None if the next is not there.

        O(runs that are newer than the first of them + events).
        """
        runs: list[tuple[EventBlock, int]] = []
        for block, run in self._newest_first(number):
            runs.append((block, run))
            if block.firsts[run] <= after + 1:
                break
        if not runs or runs[-1][0].firsts[runs[-1][1]] > after + 1:
            return None
        found: list[FenceEvent] = []
        while runs and len(found) < most:
            block, run = runs.pop()
            skipped = max(after + 1 - int(block.firsts[run]), 0)
            found += block.events(run, skipped, most - len(found))
        return found

    def first(self, number: int) -> int | None:
        """The sequence of the oldest event of a fence; None if there is none. O(runs)."""
        for block in self._all():
            runs = np.flatnonzero(block.fences == number)
            if len(runs):
                return int(block.firsts[runs[0]])
        return None

    def of(self, numbers: Integers) -> "RecentEvents":
        """What there is of some fences. O(events)."""
        found = RecentEvents()
        wanted = [np.isin(block.fences, numbers) for block in self._all()]
        parts = [block.only(each) for block, each in zip(self._all(), wanted, strict=True) if each.any()]
        if parts:
            found._blocks.append(joined(parts))
        return found

    def _newest_first(self, number: int) -> Iterator[tuple[EventBlock, int]]:
        """The runs of a fence."""
        for block in (*reversed(self._small), *reversed(self._blocks)):
            for run in np.flatnonzero(block.fences == number)[::-1].tolist():
                yield block, run

    def _all(self) -> Iterator[EventBlock]:
        yield from self._blocks
        yield from self._small
