"""Recent events in memory, which watchers read without the storage."""

from bisect import bisect_right
from collections import deque
from operator import itemgetter
from typing import TYPE_CHECKING

from .event_block import EventBlock
from .records import FenceEvent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .fence import Fence

# The memory for the events of all fences together, whatever is allowed for each.
MOST_BYTES = 2**26
SEQUENCE = itemgetter(0)


class RecentRuns:
    """The recent events of one fence: runs of blocks that it shares with others."""

    __slots__ = ("_dropped", "_runs")

    def __init__(self) -> None:
        self._runs: list[tuple[int, EventBlock, int]] = []
        self._dropped = 0

    @property
    def first(self) -> int | None:
        """The sequence of the oldest event; None if there is none."""
        return self._runs[self._dropped][0] if self._dropped < len(self._runs) else None

    def events(self, after: int, most: int) -> list[FenceEvent] | None:
        """At most that many events after a sequence that is not the last; None if the first of them is not there."""
        at = bisect_right(self._runs, after + 1, lo=self._dropped, key=SEQUENCE) - 1
        if at < self._dropped:
            return None
        found: list[FenceEvent] = []
        while at < len(self._runs) and len(found) < most:
            _, block, run = self._runs[at]
            found += (event for event in block.events(run) if event.sequence > after)
            at += 1
        return found[:most]

    def add(self, first: int, block: EventBlock, run: int) -> None:
        """Add the next run."""
        self._runs.append((first, block, run))

    def drop(self, block: EventBlock) -> None:
        """Drop the oldest run, if it is one of a block."""
        if self._dropped < len(self._runs) and self._runs[self._dropped][1] is block:
            self._dropped += 1
            if 2 * self._dropped >= len(self._runs):
                del self._runs[: self._dropped]
                self._dropped = 0

    def clear(self) -> None:
        """Drop all."""
        self._runs, self._dropped = [], 0


class RecentEvents:
    """The recent events of all fences, block by block; the oldest block goes first.

    Args:
        bytes_a_fence: the memory for each fence that there is.
    """

    def __init__(self, bytes_a_fence: int) -> None:
        self._bytes_a_fence = bytes_a_fence
        self._blocks: deque[tuple[EventBlock, Sequence[Fence]]] = deque()
        self._bytes = 0

    def add(self, block: EventBlock, fences: "Sequence[Fence]", number: int) -> None:
        """Add the events of a trip.

        Args:
            block: the events.
            fences: the fence of each run.
            number: the number of fences that there are.
        """
        for run, (fence, first) in enumerate(zip(fences, block.firsts.tolist(), strict=True)):
            fence.recent.add(first, block, run)
        self._blocks.append((block, fences))
        self._bytes += block.bytes
        most = min(self._bytes_a_fence * number, MOST_BYTES)
        while self._bytes > most and len(self._blocks) > 1:
            oldest, of_runs = self._blocks.popleft()
            self._bytes -= oldest.bytes
            for fence in of_runs:
                if not fence.ended:  # what is left of a deleted fence is nowhere else
                    fence.recent.drop(oldest)
