"""What is counted of each fence, as columns: a commit that concerns many fences counts for all of them at once."""

from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ....compiled import Numbers, native, numbers

if TYPE_CHECKING:
    from ..events.sequences import Told
    from .fence import Fence

Integers = npt.NDArray[np.int64]

ROOM = 16


class Table:
    """Columns of integers with a place for each fence, where it stays.

    Only one thread adds and removes fences. Others may meanwhile find and read those that they know to stay.

    Args:
        columns: the number of columns.
        room: the number of places, at first.

    Attributes:
        rows: (places, columns) the integers: those of a fence lie together, as who looks at one looks at others.
        columns: (columns, places) the same.
        at: the place of each fence, by its number.
    """

    __slots__ = ("_free", "at", "columns", "rows")

    def __init__(self, columns: int, room: int = ROOM) -> None:
        self.rows: Integers = np.zeros((room, columns), np.int64)
        self.columns: Integers = self.rows.T
        self.at: Numbers = numbers()
        self._free: list[int] = []

    def add(self, number: int) -> int:
        """Make a place for a fence, with zeros. O(1), with O(n) now and then."""
        if self._free:
            place = self._free.pop()
        else:
            place = len(self.at)
            self._make_room(place)
        self.rows[place] = 0
        self.at[number] = place
        return place

    def remove(self, number: int) -> int:
        """Give the place of a fence away, and return it. O(1)."""
        place = self.at.pop(number)
        self._free.append(place)
        return place

    def places(self, numbers: npt.NDArray[np.integer[Any]]) -> Integers:
        """The places of some fences; KeyError if one is not there. O(1) for each."""
        at = self.at
        return np.array([at[number] for number in numbers.tolist()], np.int64)

    def _make_room(self, place: int) -> None:
        room = len(self.rows)
        if place == room:
            rows = np.zeros((max(2 * room, ROOM), self.rows.shape[1]), np.int64)
            rows[:room] = self.rows
            self.rows, self.columns = rows, rows.T


class Column(IntEnum):
    """What is counted of each fence; see `Fence`, but for three.

    RULES: whether it has rules that look at each of its events.
    LIMITED: whether it has limits of its own on the events that are kept.
    CHANGED: whether it has had events since its keeping looked at it.
    """

    FIRST = 0
    LAST = 1
    TIME = 2
    INSIDE = 3
    UNSAVED = 4
    RULES = 5
    LIMITED = 6
    CHANGED = 7


# What events of crossings change.
COUNTED = Column.LAST, Column.TIME, Column.UNSAVED, Column.INSIDE, Column.CHANGED


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

    def remove(self, number: int) -> int:
        """Give the place of a fence away, and return it. O(1)."""
        place = super().remove(number)
        self.rule(place, rules=False)
        self.owners.pop(place, None)
        self.columns[Column.CHANGED, place] = False  # nobody is there to be looked at
        return place

    def changed(self) -> npt.NDArray[np.bool_]:
        """(places,) which fences have had events of crossings since this was last asked. O(places)."""
        found: npt.NDArray[np.bool_] = self.columns[Column.CHANGED] != 0
        self.columns[Column.CHANGED] = False
        return found

    def take(self, told: "Told") -> None:
        """Count events of crossings, which are committed."""
        if native is not None:
            native.counted(told.places, told[2:], self.rows, COUNTED)
            return
        columns, places = self.columns, told.places
        columns[Column.LAST][places] = told.lasts
        columns[Column.TIME][places] = told.times
        columns[Column.UNSAVED][places] += told.made
        columns[Column.INSIDE][places] += told.changes
        columns[Column.CHANGED][places] = True

    def rule(self, place: int, *, rules: bool) -> None:
        """Take note whether a fence has rules that look at each of its events."""
        self.ruled += rules - int(self.columns[Column.RULES, place])
        self.columns[Column.RULES, place] = rules
