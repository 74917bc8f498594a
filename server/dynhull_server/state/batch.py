"""A batch: inserts, deletes and moves that are applied all or none."""

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from dynhull import DynamicHull, MissingPointError
from dynhull.arrays import Points

from .errors import PointMissingError


@dataclass(slots=True)
class Batch:
    """Points as (n, 2) arrays. The last `moves` of each are the origins and the destinations of moves.

    With `count_missing`, points to delete that are not there are passed over and counted.
    """

    inserts: Points
    deletes: Points
    moves: int
    count_missing: bool

    @property
    def growth(self) -> int:
        """How many more points there are afterwards, at most."""
        return len(self.inserts) if self.count_missing else len(self.inserts) - len(self.deletes)


@dataclass(slots=True)
class Applied:
    """What a batch did, and the counts after it. Of a `duplicate`, a revision that has it in it."""

    revision: int
    inserted: int
    deleted: int
    missing: int
    hull_changed: bool
    points: int
    duplicate: bool = False


def apply_batch(hull: DynamicHull, batch: Batch, revision: int) -> Applied:
    """Apply `batch` to `hull`, as `revision`.

    Raises:
        PointMissingError: a point to delete is not there, and missing points are not to be counted; nothing changed.
    """
    inserted, to_delete = len(batch.inserts), len(batch.deletes)
    changes = hull.changes
    deleted = _apply(hull, batch)
    return Applied(revision, inserted, deleted, to_delete - deleted, hull.changes != changes, len(hull))


def _apply(hull: DynamicHull, batch: Batch) -> int:
    """Returns how many points were deleted."""
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
        row = cast("int", error.row) - len(inserts)  # of a batch there is one
        first_origin = len(deletes) - batch.moves
        if row < first_origin:
            raise PointMissingError("deletes", row, error.point) from None
        raise PointMissingError("origins", row - first_origin, error.point) from None
    return applied - len(inserts)
