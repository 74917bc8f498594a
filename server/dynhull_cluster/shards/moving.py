"""How points get from the shards of one division to those of another one."""

from collections.abc import Iterator

import numpy as np

from dynhull_server.state.batch import NO_POINTS, Batch
from dynhull_server.state.contents import gate, windowed
from dynhull_server.state.records import NO_TIME, Contents, KeyRows

from .parts import Admitted, keys_at
from .placement import SLOTS, key_hashes, point_hashes, slots_of


class Dealt:
    """The points of a shard by their slots. O(n log n) for all of them, then O(k) for k points.

    Args:
        contents: the points.
    """

    def __init__(self, contents: Contents) -> None:
        self._contents = contents
        hashes = point_hashes(contents.points) if contents.keys is None else key_hashes(contents.keys)
        slots = slots_of(hashes)
        self._order = np.argsort(slots, kind="stable")
        self._starts = np.searchsorted(slots[self._order], np.arange(SLOTS + 1))

    def between(self, first: int, end: int) -> Contents:
        """The points of the slots from `first` to before `end`."""
        contents = self._contents
        rows = self._order[self._starts[first] : self._starts[end]]
        times, deadlines = (None if each is None else each[rows] for each in (contents.times, contents.deadlines))
        keys = None if contents.keys is None else keys_at(contents.keys, rows)
        accuracies = None if contents.accuracies is None else contents.accuracies[rows]
        return Contents(contents.points[rows], keys, times, deadlines, accuracies=accuracies)


def puts(contents: Contents, clock: int | None) -> Iterator[Admitted]:
    """What inserts the points into shards that have none of them."""
    keys, times = contents.keys, contents.times
    if keys is None:
        batch = Batch(contents.points, NO_POINTS, 0, count_missing=False)
        if len(batch.inserts):
            yield batch if times is None else windowed.AdmittedRows(batch, times, clock, 0, 0)
        return
    dated = np.zeros(len(keys), np.bool_) if times is None else times != NO_TIME
    for have_times in (False, True):  # a put gives all of its keys a time, or none
        rows = np.flatnonzero(dated == have_times)
        if len(rows):
            put = KeyRows(
                keys_at(keys, rows),
                contents.points[rows],
                keys_at(keys, rows[:0]),
                times[rows] if have_times and times is not None else None,
                None if contents.deadlines is None else contents.deadlines[rows],
                accuracies=None if contents.accuracies is None else contents.accuracies[rows],
            )
            yield gate.AdmittedPuts(put, clock, 0, 0, refuse_missing=False)
