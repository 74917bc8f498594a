"""The times at which keys leave."""

from collections.abc import Iterable

import numpy as np
from sortedcontainers import SortedList

from ..records import FOREVER, Times

Key = str | int


class Deadlines:
    """The deadlines of keys, in microseconds since 1970. O(log n) a change."""

    def __init__(self) -> None:
        self._of: dict[Key, int] = {}
        self._order: SortedList[tuple[int, Key]] = SortedList()

    def __len__(self) -> int:
        return len(self._of)

    def keys(self) -> list[Key]:
        """The keys that have a deadline."""
        return list(self._of)

    @property
    def first(self) -> int | None:
        """The earliest deadline, None if there is none."""
        return self._order[0][0] if self._of else None

    def set(self, key: Key, deadline: int) -> None:
        """Give a key a deadline; FOREVER for none."""
        self.drop(key)
        if deadline != FOREVER:
            self._of[key] = deadline
            self._order.add((deadline, key))

    def drop(self, key: Key) -> None:
        """Forget the deadline of a key, if it has one."""
        known = self._of.pop(key, None)
        if known is not None:
            self._order.remove((known, key))

    def until(self, clock: int) -> list[Key]:
        """The keys whose deadline has come at `clock`, without any change."""
        keys = []
        for deadline, key in self._order:
            if deadline > clock:
                break
            keys.append(key)
        return keys

    def pop_until(self, clock: int) -> list[Key]:
        """Remove and return the keys whose deadline has come at `clock`."""
        keys = self.until(clock)
        for key in keys:
            del self._of[key]
        del self._order[: len(keys)]
        return keys

    def of(self, keys: Iterable[Key]) -> Times:
        """The deadline of each key, FOREVER for a key without one."""
        return np.array([self._of.get(key, FOREVER) for key in keys], np.int64)
