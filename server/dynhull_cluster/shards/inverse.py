"""How a shard takes back a batch that another shard has refused."""

from collections.abc import Callable

import numpy as np

from dynhull_server.state.batch import NO_POINTS, Batch
from dynhull_server.state.contents import gate, keyed, replayed
from dynhull_server.state.contents.key_rows import select_keys
from dynhull_server.state.contents.live import LiveContents
from dynhull_server.state.contents.multiset import Multiset
from dynhull_server.state.records import NO_TIME, HullSettings, Kept, KeyRows

from .parts import Admitted

Inverse = Callable[[], LiveContents]


def inverse_of(admitted: Admitted | None, contents: LiveContents, settings: HullSettings) -> Inverse:
    """What returns contents equal to those now, once a step has been applied, perhaps without rows.

    O(k log n) for points without times and keys without deadlines. Where there is a clock, points leave that no row
    names, so all are copied: O(n log n), for batches that name points or keys to remove which must be there.
    """
    if isinstance(contents, Multiset) and isinstance(admitted, Batch):
        return _of_points(admitted, contents)
    if isinstance(contents, keyed.Keyed) and isinstance(admitted, gate.AdmittedPuts) and admitted.clock is None:
        return _of_keys(admitted.rows, contents)
    copy = Kept(0, contents.stored(), clock=contents.clock)
    return lambda: replayed(copy, settings)


def _of_points(batch: Batch, contents: Multiset) -> Inverse:
    named = np.unique(np.concatenate([batch.inserts, batch.deletes]), axis=0)
    before = contents.hull.count_many(named)

    def undo() -> LiveContents:
        more = contents.hull.count_many(named) - before
        gone, come = np.repeat(named, np.maximum(-more, 0), axis=0), np.repeat(named, np.maximum(more, 0), axis=0)
        contents.apply(Batch(gone, come, 0, count_missing=False), 0)
        return contents

    return undo


def _of_keys(rows: KeyRows, contents: keyed.Keyed) -> Inverse:
    before = [(keys, contents.find(keys)) for keys in (rows.keys, rows.removes)]

    def undo() -> LiveContents:
        nothing = select_keys(rows.keys, np.zeros(len(rows.keys), np.bool_))
        for keys, _ in before:
            _apply(contents, KeyRows(nothing, NO_POINTS, keys))
        for keys, found in before:
            times = np.full(len(keys), NO_TIME) if found.times is None else found.times
            for dated in (False, True):  # a put gives all of its keys a time, or none
                which = found.present & ((times != NO_TIME) == dated)
                if which.any():
                    put = select_keys(keys, which)
                    errors = None if found.accuracies is None else found.accuracies[which]
                    put_times = times[which] if dated else None
                    back = KeyRows(put, found.points[which], nothing, put_times, accuracies=errors)
                    _apply(contents, back)
        return contents

    return undo


def _apply(contents: keyed.Keyed, rows: KeyRows) -> None:
    contents.apply(gate.AdmittedPuts(rows, None, 0, 0, refuse_missing=False), 0)
