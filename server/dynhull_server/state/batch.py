"""A batch: inserts, deletes and moves that are applied together or not at all."""

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from dynhull import DynamicHull, MissingPointError
from dynhull.arrays import Points

from .errors import PointMissingError


@dataclass(slots=True)
class Batch:
    """Points as (n, 2) arrays. The last `moves` of each are the origins and the destinations of moves.

    With `count_missing`, deletes of missing points are counted instead of refused.
    """

    inserts: Points
    deletes: Points
    moves: int
    count_missing: bool

    @property
    def growth(self) -> int:
        """The largest increase in the number of points."""
        return len(self.inserts) if self.count_missing else len(self.inserts) - len(self.deletes)


@dataclass(slots=True)
class Applied:
    """The effect of a batch, and the counts after it. For a `duplicate`, `revision` is one that includes it."""

    revision: int
    inserted: int
    deleted: int
    missing: int
    hull_changed: bool
    points: int
    duplicate: bool = False


def apply_batch(hull: DynamicHull, batch: Batch, revision: int) -> Applied:
    """Apply `batch` to `hull` as `revision`.

    Raises:
        PointMissingError: a point to delete is missing, and `count_missing` is False; nothing has changed.
    """
    inserted, to_delete = len(batch.inserts), len(batch.deletes)
    changes = hull.changes
    deleted = _apply(hull, batch)
    return Applied(revision, inserted, deleted, to_delete - deleted, hull.changes != changes, len(hull))


def check_batch(hull: DynamicHull, batch: Batch) -> None:
    """Raise the error with which `apply_batch` would refuse the batch. O(k log n): the hull itself does not change."""
    if batch.count_missing or not len(batch.deletes):
        return
    named = np.unique(batch.deletes, axis=0)
    copies = np.minimum(hull.count_many(named), len(batch.deletes))
    rehearsal = DynamicHull(np.repeat(named, copies, axis=0))
    _apply(rehearsal, batch)


def _apply(hull: DynamicHull, batch: Batch) -> int:
    """Returns the number of points deleted."""
    inserts, deletes = batch.inserts, batch.deletes
    missing: Literal["raise", "ignore"] = "ignore" if batch.count_missing else "raise"
    try:
        if not len(deletes):
            hull.insert_many(inserts)
            return 0
        if not len(inserts):
            return hull.delete_many(deletes, missing)
        ops = np.repeat(np.array([1, -1], np.int8), [len(inserts), len(deletes)])
        applied = hull.apply(ops, np.concatenate((inserts, deletes)), missing)
    except MissingPointError as error:
        row = cast("int", error.row) - len(inserts)  # always given for a batch
        first_origin = len(deletes) - batch.moves
        if row < first_origin:
            raise PointMissingError("deletes", row, error.point) from None
        raise PointMissingError("origins", row - first_origin, error.point) from None
    return applied - len(inserts)
