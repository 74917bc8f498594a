"""Which rows of events there are, and in how many runs of them there is something left."""

from array import array
from bisect import bisect_left

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int64]


class EventDirectory:
    """The rows of events that some fence needs. A row has runs of one fence or of many.

    32 bytes a row, and no object for each.
    """

    def __init__(self) -> None:
        self._places = array("q")  # ascending
        self._weights = array("q")
        self._needed = array("q")  # runs that a fence needs
        self._stored = array("q")  # runs in the payload
        self._gone = 0

    def __len__(self) -> int:
        """The number of rows."""
        return len(self._places) - self._gone

    @property
    def sum(self) -> int:
        """The sum of their weights. O(rows)."""
        return sum(weight for weight, runs in zip(self._weights, self._needed, strict=True) if runs)

    def add(self, place: int, weight: int, needed: int, stored: int) -> None:
        """Add a row, as a rule behind all others: the number of its runs that are needed, and that of all of them."""
        row = len(self._places)
        if row and place < self._places[-1]:
            row = bisect_left(self._places, place)
        self._places.insert(row, place)
        self._weights.insert(row, weight)
        self._needed.insert(row, needed)
        self._stored.insert(row, stored)

    def left(self, places: Integers) -> tuple[Integers, Integers]:
        """The number of runs that are needed of each of some rows, and the weights of the rows. O(k log n)."""
        rows = self._rows(places)
        return _view(self._needed)[rows], _view(self._weights)[rows]

    def needs(self, place: int) -> bool:
        """Whether there is a row that a fence needs. O(log n)."""
        row = bisect_left(self._places, place)
        return row < len(self._places) and self._places[row] == place and self._needed[row] > 0

    def sparse(self) -> list[int]:
        """The rows of which at most half of the runs are needed. O(rows)."""
        needed = _view(self._needed)
        rows = (needed > 0) & (2 * needed <= _view(self._stored))
        found: list[int] = _view(self._places)[rows].tolist()
        return found

    def release(self, places: Integers, counts: Integers) -> None:
        """Some runs of each of some rows are no longer needed. O(k log n), with O(n) now and then."""
        rows = self._rows(places)
        needed = _view(self._needed)
        needed[rows] -= counts
        self._gone += int((needed[rows] == 0).sum())
        del needed  # an array that is seen from outside cannot grow
        if 2 * self._gone > len(self._places):
            self._tidy()

    def shrink(self, place: int, weight: int, stored: int) -> None:
        """The payload of a row now has only that many runs."""
        row = bisect_left(self._places, place)
        self._weights[row], self._stored[row] = weight, stored

    def _rows(self, places: Integers) -> npt.NDArray[np.intp]:
        return np.searchsorted(_view(self._places), places)

    def _tidy(self) -> None:
        rows = _view(self._needed) > 0
        columns = self._places, self._weights, self._needed, self._stored
        self._places, self._weights, self._needed, self._stored = (
            array("q", _view(column)[rows].tobytes()) for column in columns
        )
        self._gone = 0


def _view(column: "array[int]") -> Integers:
    return np.frombuffer(column, np.int64)
