"""The times at which keys leave."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush

import numpy as np

from ..records import FOREVER, Times

Key = str | int
# Beyond twice the number of keys, rows of keys that have another deadline by now are dropped.
MOST_SPARE_ROWS = 1024


@dataclass(slots=True)
class SameDeadline:
    """Keys that were given the same deadline, and perhaps another one since."""

    deadline: int
    keys: list[Key] = field(default_factory=list)


class Deadlines:
    """The deadlines of keys, in microseconds since 1970. O(1) a key, O(log d) for each of d different deadlines.

    A key that leaves or gets another deadline stays in its old group until that comes first or the groups are tidied.
    """

    def __init__(self) -> None:
        self._of: dict[Key, SameDeadline] = {}
        self._groups: dict[int, SameDeadline] = {}
        self._order: list[int] = []  # a heap of the groups' deadlines
        self._rows = 0  # of all groups

    def __len__(self) -> int:
        return len(self._of)

    def keys(self) -> list[Key]:
        """The keys that have a deadline."""
        return list(self._of)

    @property
    def first(self) -> int | None:
        """The earliest deadline, None if there is none."""
        return self._order[0] if self._of else None

    def set(self, keys: Iterable[Key], deadlines: Iterable[int]) -> None:
        """Give each key its deadline; FOREVER for none."""
        for key, deadline in zip(keys, deadlines, strict=True):
            if deadline == FOREVER:
                self._of.pop(key, None)
                continue
            group = self._groups.get(deadline)
            if group is None:
                group = self._groups[deadline] = SameDeadline(deadline)
                heappush(self._order, deadline)
            if self._of.get(key) is not group:
                self._of[key] = group
                group.keys.append(key)
                self._rows += 1
        self._tidy()

    def drop(self, keys: Iterable[Key]) -> None:
        """Forget the deadlines of keys, if they have any."""
        for key in keys:
            self._of.pop(key, None)
        self._tidy()

    def pop_until(self, clock: int) -> list[Key]:
        """Remove and return the keys whose deadline has come at `clock`."""
        ended: list[Key] = []
        while self._order and self._order[0] <= clock:
            group = self._groups.pop(heappop(self._order))
            self._rows -= len(group.keys)
            for key in group.keys:
                if self._of.get(key) is group:
                    del self._of[key]
                    ended.append(key)
        self._tidy()
        return ended

    def of(self, keys: Iterable[Key]) -> Times:
        """The deadline of each key, FOREVER for a key without one."""
        groups = (self._of.get(key) for key in keys)
        return np.array([FOREVER if group is None else group.deadline for group in groups], np.int64)

    def _tidy(self) -> None:
        """Make the earliest deadline that of a key, and drop the rows of other keys if there are many."""
        while self._order:
            first = self._groups[self._order[0]]
            while first.keys and self._of.get(first.keys[-1]) is not first:
                first.keys.pop()
                self._rows -= 1
            if first.keys:
                break
            del self._groups[heappop(self._order)]
        if self._rows > 2 * len(self._of) + MOST_SPARE_ROWS:
            for group in self._groups.values():
                group.keys = [key for key in dict.fromkeys(group.keys) if self._of.get(key) is group]
            self._groups = {deadline: group for deadline, group in self._groups.items() if group.keys}
            self._order = sorted(self._groups)
            self._rows = sum(len(group.keys) for group in self._groups.values())


# Those of all hulls whose keys never had any: to read, to drop and to pop change nothing in them.
NO_DEADLINES = Deadlines()


def given_deadlines(deadlines: Deadlines, keys: Iterable[Key], times: Iterable[int]) -> Deadlines:
    """The deadlines once each key has been given its own: the same object, or one in place of NO_DEADLINES."""
    own = Deadlines() if deadlines is NO_DEADLINES else deadlines
    own.set(keys, times)
    return own
