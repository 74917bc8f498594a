"""Points without keys that leave when they are too old or too many."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt

from dynhull import DynamicHull, GeoWindowHull, MissingPointError, WindowHull
from dynhull.arrays import Points
from dynhull.globe import Gnomonic

from ..admission import GREATEST_TIME, admit, too_old
from ..batch import NO_POINTS, Applied, Batch, KeyedBatch
from ..errors import InvalidBatchError, LimitExceededError, MisfitError
from ..frames import Globe
from ..numbers import as_numbers
from ..records import Cause, Center, Contents, Expiry, HullSettings, PointRows, Record, Rows, Times
from .live import REPLAYED_TOGETHER
from .multiset import NO_KEYS, apply_points, missing_point
from .places import move_center, require_batch

UNLIMITED = 2**63 - 1

RowNumbers = npt.NDArray[np.intp]


@dataclass(slots=True)
class AdmittedRows:
    """A batch without the inserts that are too old.

    Attributes:
        batch: the batch.
        times: (n,) the time of each insert, including the destinations of moves.
        clock: the clock of the hull after the batch, None for a hull without a clock.
        late: the number of inserts that are too old.
        clamped: the number of inserts whose time was reduced.
    """

    batch: Batch
    times: Times
    clock: int | None
    late: int
    clamped: int


class Windowed:
    """The contents of a hull without keys and with a window. Equal points leave in the order of their times.

    Args:
        settings: the settings of the hull.
        stored: its points, in the order in which they leave.
        clock: its clock.
        most_points: the limit on the number of points.
        globe: the frame of a geographic hull; None for a plane.
    """

    def __init__(
        self, settings: HullSettings, stored: Contents, clock: int | None, most_points: int, globe: Globe | None
    ) -> None:
        window = settings.window
        assert window is not None
        self._settings = settings
        self._window = window
        self._most_points = most_points
        self.clock = clock
        self.follows_server = window.clock == "server"
        self.globe = globe
        most = window.max_points or UNLIMITED
        self.hull = WindowHull(max_points=most) if globe is None else GeoWindowHull(None, most, globe.center)
        if stored.times is not None:
            self.hull.add(stored.points, stored.times.astype(np.float64))

    @property
    def due(self) -> int | None:
        """The time by the server's clock before which no point leaves; None if that clock makes none leave."""
        oldest = self.hull.oldest if self.follows_server and self._window.max_age else None
        return None if oldest is None else int(oldest) + self._window.max_age

    def admit(self, batch: Batch | KeyedBatch, arrived: int) -> AdmittedRows:
        """The batch with the times of its inserts, without those that are too old."""
        if isinstance(batch, KeyedBatch):
            raise MisfitError(batch.field, NO_KEYS)
        rows, moves = len(batch.inserts), batch.moves
        if moves and not self.follows_server:
            problem = "event times drive the clock of this hull, and moves have none: delete and insert instead"
            raise InvalidBatchError("moves", f"{moves} moves", problem)
        times = batch.times
        if times is not None:
            times = np.concatenate((times, np.full(moves, arrived, np.int64)))
        admission = admit(self._settings, times, rows, "insert_times", arrived, self.clock)
        assert admission.times is not None  # a hull with a window has times
        if self.globe is not None:
            require_batch(self.globe, batch, admission.young)
        admitted = AdmittedRows(batch, admission.times, admission.clock, 0, admission.clamped)
        if admission.young is not None:
            admitted.late = rows - int(np.count_nonzero(admission.young))
            admitted.times = admission.times[admission.young]
            young = batch.inserts[admission.young]
            admitted.batch = Batch(young, batch.deletes, batch.moves, batch.count_missing, batch.times)
        if len(self.hull) + admitted.batch.growth > self._most_points:
            self._refuse_growth(admitted)
        return admitted

    def check(self, admitted: AdmittedRows) -> None:
        """Raise PointMissingError if `apply` would. O(n)."""
        batch = admitted.batch
        if batch.count_missing or not len(batch.deletes):
            return
        there = self._staying(admitted.clock)
        rehearsal = DynamicHull(there[np.isin(as_numbers(there), as_numbers(batch.deletes))])
        apply_points(rehearsal, batch)

    def expires_before(self, admitted: AdmittedRows) -> int | None:
        """The clock that the batch leads to, if points leave at that time; None if none do."""
        until = self._until(admitted.clock)
        oldest = None if until is None else self.hull.oldest
        return admitted.clock if until is not None and oldest is not None and oldest <= until else None

    def apply(self, admitted: AdmittedRows, revision: int) -> Applied:
        """Apply the batch, or raise PointMissingError."""
        hull, batch = self.hull, admitted.batch
        changes, evicted = hull.changes, hull.evicted
        missing = self._carry_out(batch, admitted.times)
        self.clock = admitted.clock
        return Applied(
            revision,
            len(batch.inserts),
            len(batch.deletes) - missing,
            missing,
            hull.changes != changes,
            len(hull),
            late=admitted.late,
            clamped=admitted.clamped,
            evicted=hull.evicted - evicted,
            clock=self.clock,
        )

    def rows(self, admitted: AdmittedRows, applied: Applied) -> PointRows:
        """The points of an applied batch, with the times of the inserts."""
        batch = admitted.batch
        return PointRows(batch.inserts, batch.deletes, applied.missing > 0, admitted.times)

    def cause(self, _: AdmittedRows) -> Cause:
        """What makes the revision of a batch."""
        return "batch"

    def recenter(self, center: Center | None) -> PointRows:
        """Move the centre of a geographic hull, or raise MisfitError. Returns no rows. O(n log n)."""
        move_center(self.hull, center)
        return PointRows(NO_POINTS, NO_POINTS, times=np.empty(0, np.int64))

    def expire(self, clock: int) -> Expiry | None:
        """Advance the clock, and remove the points that leave. If none do, the clock stays."""
        clock = clock if self.clock is None else max(clock, self.clock)
        until = self._until(clock)
        leaving = 0 if until is None else self.hull.expire(until)
        if not leaving:
            return None
        self.clock = clock
        return Expiry(until, leaving)

    def replay(self, records: Iterable[Record]) -> None:
        """Apply recorded changes, many at a time: inserts in succession have the effect of one batch."""
        inserts: list[PointRows] = []
        size = 0
        for record in records:
            rows = record.rows
            if record.center is not None:
                self._insert(inserts)
                inserts, size = [], 0
                move_center(self.hull, record.center)
            if isinstance(rows, PointRows) and not len(rows.deletes) and size < REPLAYED_TOGETHER:
                inserts.append(rows)
                size += len(rows)
            else:
                self._insert(inserts)
                inserts, size = [], 0
                self._replay_alone(rows)
            self.clock = record.clock
        self._insert(inserts)

    def _insert(self, rows: list[PointRows]) -> None:
        if rows:
            times = np.concatenate([_times(each) for each in rows])
            self.hull.add(np.concatenate([each.inserts for each in rows]), times.astype(np.float64))

    def _replay_alone(self, rows: Rows) -> None:
        if isinstance(rows, Expiry):
            assert rows.until is not None  # only keys have deadlines
            self.hull.expire(rows.until)
        else:
            assert isinstance(rows, PointRows)
            self._carry_out(Batch(rows.inserts, rows.deletes, 0, rows.lenient), _times(rows))

    def stored(self) -> Contents:
        """The points in the order in which they leave. O(n log n)."""
        points, times = self.hull.oldest_first()
        return Contents(points, times=times.astype(np.int64))

    def _carry_out(self, batch: Batch, times: Times) -> int:
        """Apply the batch. Returns the number of missing points, or raises PointMissingError."""
        inserts, deletes = batch.inserts, batch.deletes
        rows = np.arange(len(deletes))
        if len(inserts) and len(deletes):
            entering, rows = _without_pairs(inserts, deletes)
            inserts, deletes, times = inserts[entering], deletes[rows], times[entering]
        missing = 0
        if len(deletes):
            try:
                removed = self.hull.delete_many(deletes, "ignore" if batch.count_missing else "raise")
            except MissingPointError as error:
                row = cast("int", error.row)  # always given for a batch
                raise missing_point(batch, int(rows[row]), error.point) from None
            missing = len(deletes) - removed
        if len(inserts):
            if isinstance(self.hull, GeoWindowHull) and self.hull.center is None:
                self.hull.recenter(Gnomonic.about(batch.inserts).center)  # as `admit` has checked
            self.hull.add(inserts, times.astype(np.float64))
        return missing

    def _until(self, clock: int | None) -> int | None:
        until = too_old(self._settings, clock)
        return until if until is not None and until >= -GREATEST_TIME else None

    def _staying(self, clock: int | None) -> Points:
        """The points that are left once those have left that leave at `clock`. O(n log n)."""
        until = self._until(clock)
        if until is None:
            return self.hull.points()
        points, times = self.hull.oldest_first()
        return points[times > until]

    def _refuse_growth(self, admitted: AdmittedRows) -> None:
        """Raise LimitExceededError if the hull would have too many points."""
        after = len(self._staying(admitted.clock)) + admitted.batch.growth
        if self._window.max_points:
            after = min(after, self._window.max_points)
        if after > self._most_points:
            raise LimitExceededError("max_points", self._most_points)


def _times(rows: PointRows) -> Times:
    assert rows.times is not None  # a hull with a window has times
    return rows.times


def _without_pairs(inserts: Points, deletes: Points) -> tuple[RowNumbers, RowNumbers]:
    """The rows of both without pairs of equal points: what a batch both inserts and deletes leaves no trace."""
    wanted = Counter(map(tuple, deletes.tolist()))
    entering = []
    for row, point in enumerate(map(tuple, inserts.tolist())):
        if wanted[point]:
            wanted[point] -= 1
        else:
            entering.append(row)
    leaving = []
    for row, point in enumerate(map(tuple, deletes.tolist())):
        if wanted[point]:
            wanted[point] -= 1
            leaving.append(row)
    return np.array(entering, np.intp), np.array(leaving, np.intp)
