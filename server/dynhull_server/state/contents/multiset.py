"""Points that are counted as often as they were inserted."""

from collections.abc import Iterable
from typing import Literal, cast

import numpy as np

from dynhull import DynamicHull, GeoHull, MissingPointError

from ..batch import NO_POINTS, Applied, Batch, KeyedBatch
from ..errors import LimitExceededError, MisfitError, PointMissingError
from ..frames import Globe
from ..records import Cause, Center, Contents, Expiry, PointRows, Record
from .live import REPLAYED_TOGETHER
from .places import move_center, require_batch

NO_KEYS = "has points without keys, which a batch inserts and deletes"


class Multiset:
    """The contents of a hull whose points have no keys and do not leave by themselves.

    Args:
        stored: the points.
        most_points: the limit on their number.
        globe: the frame of a geographic hull; None for a plane.

    Attributes:
        points: the number of points.
        most_points: the limit on it.
    """

    clock: int | None = None
    due: int | None = None
    follows_server = True

    def __init__(self, stored: Contents, most_points: int, globe: Globe | None) -> None:
        self.hull = DynamicHull(stored.points) if globe is None else GeoHull(stored.points, globe.center)
        self.globe = globe
        self.most_points = most_points
        self.points, self._changes = len(self.hull), self.hull.changes

    def admit(self, batch: Batch | KeyedBatch, _: int) -> Batch:
        """The batch, or raise MisfitError or LimitExceededError."""
        if isinstance(batch, KeyedBatch):
            raise MisfitError(batch.field, NO_KEYS)
        if batch.times is not None:
            raise MisfitError("insert_times", "has no window, so its points have no times")
        if self.points + batch.growth > self.most_points:
            raise LimitExceededError("max_points", self.most_points)
        if self.globe is not None:
            require_batch(self.globe, batch)
        return batch

    def check(self, batch: Batch) -> None:
        """Raise PointMissingError if `apply` would. O(k log n)."""
        if batch.count_missing or not len(batch.deletes):
            return
        named = np.unique(batch.deletes, axis=0)
        copies = np.minimum(self.hull.count_many(named), len(batch.deletes))
        apply_points(DynamicHull(np.repeat(named, copies, axis=0)), batch)

    def expires_before(self, _: Batch) -> int | None:
        """None: no points leave."""
        return None

    def apply(self, batch: Batch, revision: int) -> Applied:
        """Apply the batch, or raise PointMissingError."""
        hull, before = self.hull, self._changes
        inserted, to_delete, deleted = len(batch.inserts), len(batch.deletes), 0
        if to_delete:
            deleted = apply_points(hull, batch)
        else:
            hull.insert_many(batch.inserts)
        self.points += inserted - deleted
        self._changes = hull.changes
        return Applied(revision, inserted, deleted, to_delete - deleted, self._changes != before, self.points)

    def rows(self, batch: Batch, applied: Applied) -> PointRows:
        """The points of an applied batch."""
        return PointRows(batch.inserts, batch.deletes, applied.missing > 0)

    def cause(self, _: Batch) -> Cause:
        """What makes the revision of a batch."""
        return "batch"

    def recenter(self, center: Center | None) -> PointRows:
        """Move the centre of a geographic hull, or raise MisfitError. Returns no rows. O(n log n)."""
        move_center(self.hull, center)
        self._changes = self.hull.changes
        return PointRows(NO_POINTS, NO_POINTS)

    def expire(self, _: int) -> Expiry | None:
        """None: no points leave."""
        return None

    def replay(self, records: Iterable[Record]) -> None:
        """Apply recorded batches, many at a time."""
        for center, group in _together(records):
            if center is not None:
                move_center(self.hull, center)
            inserts = np.concatenate([rows.inserts for rows in group])
            deletes = np.concatenate([rows.deletes for rows in group])
            if not len(deletes):
                self.hull.insert_many(inserts)
                continue
            ops = np.repeat(np.array([1, -1], np.int8), [len(inserts), len(deletes)])
            missing: Literal["raise", "ignore"] = "ignore" if group[0].lenient else "raise"
            self.hull.apply(ops, np.concatenate([inserts, deletes]), missing)
        self.points, self._changes = len(self.hull), self.hull.changes

    def stored(self) -> Contents:
        """The points. O(n)."""
        return Contents(self.hull.points())


def apply_points(hull: DynamicHull | GeoHull, batch: Batch) -> int:
    """Apply a batch to `hull`. Returns the number of points deleted.

    Raises:
        PointMissingError: a point to delete is missing, and `count_missing` is False; nothing has changed.
    """
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
        raise missing_point(batch, row, error.point) from None
    return applied - len(inserts)


def missing_point(batch: Batch, row: int, point: tuple[float, float]) -> PointMissingError:
    """The refusal of a batch because of a row of its deletes."""
    first_origin = len(batch.deletes) - batch.moves
    if row < first_origin:
        return PointMissingError("deletes", row, point)
    return PointMissingError("origins", row - first_origin, point)


def _together(records: Iterable[Record]) -> Iterable[tuple[Center | None, list[PointRows]]]:
    """Groups of batches to apply as one set, each with the centre to set before it, or None.

    A lenient one stays alone: its deletes depend on the points before it.
    """
    center: Center | None = None
    group: list[PointRows] = []
    size = 0
    for record in records:
        rows = record.rows
        assert isinstance(rows, PointRows)
        alone = rows.lenient or record.center is not None
        if group and (alone or group[-1].lenient or size >= REPLAYED_TOGETHER):
            yield center, group
            center, group, size = None, [], 0
        center = center or record.center
        group.append(rows)
        size += len(rows)
    if group:
        yield center, group
