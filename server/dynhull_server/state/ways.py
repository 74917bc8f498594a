"""The ways of all keys of a hull through some of its revisions, one key after the other."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .records import Keys, Times

Numbers = npt.NDArray[np.float64]


@dataclass(slots=True)
class Stamps:
    """The revisions of some rows, and their commits.

    Attributes:
        revisions: (n,) the revisions.
        numbers: (n,) the numbers of their commits.
        times: (n,) and the times of these.
    """

    revisions: npt.NDArray[np.int64]
    numbers: npt.NDArray[np.int64]
    times: Times

    def __getitem__(self, rows: npt.NDArray[np.intp]) -> "Stamps":
        return Stamps(self.revisions[rows], self.numbers[rows], self.times[rows])

    def once(self) -> "Stamps":
        """Each revision once, in order."""
        return self[np.unique(self.revisions, return_index=True)[1]]

    def columns(self) -> tuple[list[int], list[int], list[int]]:
        """The columns as lists."""
        return self.revisions.tolist(), self.numbers.tolist(), self.times.tolist()


NO_STAMPS = Stamps(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.int64))


def joined(parts: Sequence[Stamps]) -> Stamps:
    """Stamps one after the other."""
    return Stamps(
        np.concatenate([NO_STAMPS.revisions, *(part.revisions for part in parts)]),
        np.concatenate([NO_STAMPS.numbers, *(part.numbers for part in parts)]),
        np.concatenate([NO_STAMPS.times, *(part.times for part in parts)]),
    )


@dataclass(slots=True)
class KeyWays:
    """What batches do to some keys of a hull, where they only put and remove keys: rows by key, then revision.

    Attributes:
        keys: k keys. The first one may be the last one of the part before, and goes on.
        starts: (k,) the first row of each.
        x, y: (n,) the places; NaN where the key is removed.
        stamps: the revisions of all rows and their commits, which are read when this is called.
        all_stamps: likewise, with those of batches that do nothing; others may come several times.
    """

    keys: Keys
    starts: npt.NDArray[np.intp]
    x: Numbers
    y: Numbers
    stamps: Callable[[], Stamps]
    all_stamps: Callable[[], Stamps]

    def __len__(self) -> int:
        return len(self.x)
