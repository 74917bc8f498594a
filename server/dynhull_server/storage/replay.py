"""The points that a snapshot and the batches after it make."""

from collections.abc import Iterable

import numpy as np

from dynhull import DynamicHull
from dynhull.arrays import Points

from ..state.records import Kept, Record

# Batches are replayed together up to so many points: as a set, which is many times faster.
REPLAYED_TOGETHER = 65_536


def replayed(kept: Kept) -> Points:
    """The points of a hull at its last revision, with multiplicity. O(n log n)."""
    hull = DynamicHull(kept.points)
    for records in _together(kept.records):
        inserts = np.concatenate([record.inserts for record in records])
        deletes = np.concatenate([record.deletes for record in records])
        ops = np.repeat(np.array([1, -1], np.int8), [len(inserts), len(deletes)])
        hull.apply(ops, np.concatenate([inserts, deletes]), missing="ignore" if records[0].lenient else "raise")
    return hull.points()


def _together(records: Iterable[Record]) -> Iterable[list[Record]]:
    """Records that may be applied as one set: none whose deletes depend on what was there at the time."""
    group: list[Record] = []
    rows = 0
    for record in records:
        if group and (record.lenient or group[-1].lenient or rows >= REPLAYED_TOGETHER):
            yield group
            group, rows = [], 0
        group.append(record)
        rows += len(record.inserts) + len(record.deletes)
    if group:
        yield group
