"""What is counted of each fence, as columns: a commit that concerns many fences counts for all of them at once."""

from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from .event_log import Told
    from .fence import Fence

Integers = npt.NDArray[np.int64]

ROOM = 16
NOBODY = -1  # the number of no fence


class Table:
    """Columns of integers with a place for each fence, where it stays.

    Only one thread adds and removes fences. Others may meanwhile find and read those that they know to stay.

    Args:
        columns: the number of columns.
        room: the number of places, at first.

    Attributes:
        columns: (columns, places) the integers.
    """

    __slots__ = ("_free", "_index", "_new", "_numbers", "_size", "columns")

    def __init__(self, columns: int, room: int = ROOM) -> None:
        self.columns: Integers = np.zeros((columns, room), np.int64)
        self._numbers: Integers = np.full(room, NOBODY)
        self._size = 0
        self._free: list[int] = []
        self._new = False  # whether the index lacks some
        # The numbers, ascending, and their places; also of fences that have been removed.
        self._index: tuple[Integers, Integers] = (np.empty(0, np.int64), np.empty(0, np.int64))

    def add(self, number: int) -> int:
        """Make a place for a fence, with zeros. O(1), with O(n) now and then."""
        if self._free:
            place = self._free.pop()
        else:
            place = self._size
            if place == len(self._numbers):
                self._grow()
            self._size += 1
        self._numbers[place] = number
        self.columns[:, place] = 0
        self._new = True
        return place

    def remove(self, place: int) -> None:
        """Give a place away. O(1)."""
        self._numbers[place] = NOBODY
        self._free.append(place)

    def sort(self) -> None:
        """Let `places` find the fences that were added. O(n) after some were."""
        if self._new:
            self._new = False
            places = np.flatnonzero(self._numbers != NOBODY)
            order = np.argsort(self._numbers[places], kind="stable")
            self._index = self._numbers[places[order]], places[order]

    def places(self, numbers: npt.NDArray[Any]) -> Integers:
        """The places of fences; KeyError if one is not there. `sort` has been called. O(log n) for each."""
        ascending, places = self._index
        at = np.searchsorted(ascending, numbers)
        if at.max(initial=NOBODY) == len(ascending):
            raise KeyError(f"there is no fence {numbers[at.argmax()]}")
        found: Integers = places[at]
        missing = self._numbers[found] != numbers
        if missing.any():
            raise KeyError(f"there is no fence {numbers[missing.argmax()]}")
        return found

    def _grow(self) -> None:
        room = max(2 * len(self._numbers), ROOM)
        columns = np.zeros((len(self.columns), room), np.int64)
        columns[:, : self._size] = self.columns[:, : self._size]
        numbers = np.full(room, NOBODY)
        numbers[: self._size] = self._numbers[: self._size]
        self.columns, self._numbers = columns, numbers


class Column(IntEnum):
    """What is counted of each fence; see `Fence`, but for three.

    RULES: whether it has rules that look at each of its events.
    LIMITED: whether it has limits of its own on the events that are kept.
    STIRRED: whether it has had events since its keeping looked at it.
    """

    FIRST = 0
    LAST = 1
    TIME = 2
    INSIDE = 3
    UNSAVED = 4
    RULES = 5
    LIMITED = 6
    STIRRED = 7


class Tallies(Table):
    """What is counted of fences.

    Attributes:
        owners: the fences, by their places.
        ruled: the number of those with rules that look at each of their events.
    """

    __slots__ = ("owners", "ruled")

    def __init__(self, room: int = ROOM) -> None:
        super().__init__(len(Column), room)
        self.owners: dict[int, Fence] = {}
        self.ruled = 0

    def remove(self, place: int) -> None:
        """Give a place away. O(1)."""
        self.rule(place, rules=False)
        self.owners.pop(place, None)
        super().remove(place)

    def stirred(self) -> npt.NDArray[np.bool_]:
        """(places,) which fences have had events of crossings since this was last asked. O(places)."""
        found: npt.NDArray[np.bool_] = self.columns[Column.STIRRED] != 0
        self.columns[Column.STIRRED] = False
        return found

    def take(self, told: "Told") -> None:
        """Count events of crossings, which are committed."""
        columns, places = self.columns, told.places
        columns[Column.LAST, places] = told.lasts
        columns[Column.TIME, places] = told.times
        columns[Column.UNSAVED, places] += told.made
        columns[Column.INSIDE, places] += told.changes
        columns[Column.STIRRED, places] = True

    def rule(self, place: int, *, rules: bool) -> None:
        """Take note whether a fence has rules that look at each of its events."""
        self.ruled += rules - int(self.columns[Column.RULES, place])
        self.columns[Column.RULES, place] = rules
