"""How far positions may be from where their keys really are."""

from collections.abc import Iterable

import numpy as np

from ..records import Accuracies
from .deadlines import Key


class AccuracyTable:
    """The errors of the positions of keys, above 0. O(1) a key.

    A key that has left by itself may still have one: it gets another with its next position.
    """

    def __init__(self) -> None:
        self._of: dict[Key, float] = {}

    def __len__(self) -> int:
        return len(self._of)

    def keys(self) -> list[Key]:
        """The keys that have one."""
        return list(self._of)

    def set(self, keys: Iterable[Key], accuracies: Iterable[float]) -> None:
        """Give each key the error of its position; 0 for none."""
        for key, accuracy in zip(keys, accuracies, strict=True):
            if accuracy:
                self._of[key] = accuracy
            else:
                self._of.pop(key, None)

    def drop(self, keys: Iterable[Key]) -> None:
        """Forget the errors of keys, if they have any."""
        for key in keys:
            self._of.pop(key, None)

    def of(self, keys: Iterable[Key]) -> Accuracies:
        """The error of each key, 0 for a key without one."""
        return np.array([self._of.get(key, 0.0) for key in keys], np.float64)


# That of all hulls whose keys never had any: to read and to drop change nothing in it.
NO_ACCURACIES = AccuracyTable()


def given_accuracies(table: AccuracyTable, keys: Iterable[Key], accuracies: Iterable[float]) -> AccuracyTable:
    """The table once each key has been given its own: the same object, or one in place of NO_ACCURACIES."""
    own = AccuracyTable() if table is NO_ACCURACIES else table
    own.set(keys, accuracies)
    return own
