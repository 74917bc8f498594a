"""A batch: inserts, deletes and moves that are applied all or none."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dynhull import DynamicHull, MissingPointError
from dynhull.arrays import Points

from .errors import PointMissingError


@dataclass(slots=True)
class Batch:
    """Points as (n, 2) arrays; `destinations` has a row for each of `origins`.

    With `count_missing`, points to delete that are not there are passed over and counted.
    """

    inserts: Points
    deletes: Points
    origins: Points
    destinations: Points
    count_missing: bool

    @property
    def all_inserts(self) -> Points:
        """Inserts and destinations."""
        return np.concatenate((self.inserts, self.destinations)) if len(self.destinations) else self.inserts

    @property
    def all_deletes(self) -> Points:
        """Deletes and origins."""
        return np.concatenate((self.deletes, self.origins)) if len(self.origins) else self.deletes

    @property
    def growth(self) -> int:
        """How many more points there are afterwards, at most."""
        grown = len(self.inserts) + len(self.destinations)
        return grown if self.count_missing else grown - len(self.deletes) - len(self.origins)


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
    inserted = len(batch.inserts) + len(batch.destinations)
    to_delete = len(batch.deletes) + len(batch.origins)
    changes = hull.changes
    if inserted + to_delete == 1:
        deleted = _apply_one(hull, batch)
    elif to_delete == 0:
        deleted = 0
        hull.insert_many(batch.all_inserts)
    else:
        deleted = _apply_many(hull, batch)
    return Applied(revision, inserted, deleted, to_delete - deleted, hull.changes != changes, len(hull))


def _apply_one(hull: DynamicHull, batch: Batch) -> int:
    """One insert or one delete, what most messages of a live feed hold: without the cost of arrays."""
    if len(batch.inserts):
        x, y = batch.inserts[0].tolist()
        hull.insert(x, y)
        return 0
    x, y = batch.deletes[0].tolist()
    try:
        hull.delete(x, y)
    except MissingPointError as error:
        if batch.count_missing:
            return 0
        raise PointMissingError("deletes", 0, error.point) from None
    return 1


def _apply_many(hull: DynamicHull, batch: Batch) -> int:
    inserts, deletes = batch.all_inserts, batch.all_deletes
    missing: Literal["raise", "ignore"] = "ignore" if batch.count_missing else "raise"
    try:
        if not len(inserts):
            return hull.delete_many(deletes, missing)
        ops = np.repeat(np.array([1, -1], np.int8), [len(inserts), len(deletes)])
        applied = hull.apply(ops, np.concatenate((inserts, deletes)), missing)
    except MissingPointError as error:
        if error.row is None:
            raise
        row = error.row - len(inserts)
        if row < len(batch.deletes):
            raise PointMissingError("deletes", row, error.point) from None
        raise PointMissingError("origins", row - len(batch.deletes), error.point) from None
    return applied - len(inserts)
