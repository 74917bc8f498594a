"""Which rows of events there are, and in how many runs of them there is something left."""

from array import array

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int64]


class EventDirectory:
    """The rows of events that some fence needs. A row has runs of one fence or of many.

    24 bytes a row, and no object for each.
    """

    def __init__(self) -> None:
        self._places = array("q")  # ascending
        self._weights = array("q")
        self._runs = array("q")
        self._gone = 0

    def __len__(self) -> int:
        """The number of rows."""
        return len(self._places) - self._gone

    @property
    def sum(self) -> int:
        """The sum of their weights. O(rows)."""
        return sum(weight for weight, runs in zip(self._weights, self._runs, strict=True) if runs)

    def add(self, place: int, weight: int, runs: int) -> None:
        """Add a row behind all others."""
        self._places.append(place)
        self._weights.append(weight)
        self._runs.append(runs)

    def left(self, places: Integers) -> tuple[Integers, Integers]:
        """The number of runs that are needed of each of some rows, and the weights of the rows. O(k log n)."""
        rows = self._rows(places)
        return np.frombuffer(self._runs, np.int64)[rows], np.frombuffer(self._weights, np.int64)[rows]

    def release(self, places: Integers, counts: Integers) -> None:
        """Some runs of each of some rows are no longer needed. O(k log n), with O(n) now and then."""
        rows = self._rows(places)
        runs = np.frombuffer(self._runs, np.int64)
        runs[rows] -= counts
        self._gone += int((runs[rows] == 0).sum())
        del runs
        if 2 * self._gone > len(self._places):
            self._tidy()

    def _rows(self, places: Integers) -> npt.NDArray[np.intp]:
        return np.searchsorted(np.frombuffer(self._places, np.int64), places)

    def _tidy(self) -> None:
        needed = np.frombuffer(self._runs, np.int64) > 0
        columns = (self._places, self._weights, self._runs)
        self._places, self._weights, self._runs = (
            array("q", np.frombuffer(column, np.int64)[needed].tobytes()) for column in columns
        )
        self._gone = 0
