"""The points of batches as places on the globe, and the centre of the hull."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from dynhull import GeoHull, GeoKeyedHull, GeoWindowHull
from dynhull.arrays import Points
from dynhull.globe import Gnomonic

from ..batch import Batch
from ..errors import InvalidBatchError, MisfitError
from ..frames import Globe, Misplaced, off_globe, out_of_reach
from ..records import Center

GeographicHull = GeoHull | GeoKeyedHull | GeoWindowHull
Rows = npt.NDArray[np.bool_]


def require_batch(globe: Globe, batch: Batch, young: Rows | None = None) -> None:
    """Raise InvalidBatchError unless the hull reaches the inserts that are young, and all rows are places. O(k)."""
    misplaced = _misplaced(globe, batch.inserts, young)
    fields, points = ("inserts", "moves.destinations"), batch.inserts
    if misplaced is None:
        misplaced = off_globe(batch.deletes)
        fields, points = ("deletes", "moves.origins"), batch.deletes
    if misplaced is not None:
        first = len(points) - batch.moves
        moved = misplaced.row >= first
        row = misplaced.row - first if moved else misplaced.row
        raise InvalidBatchError(fields[moved], misplaced.place, misplaced.problem, row)


def require_puts(globe: Globe, points: Points, young: Rows | None) -> None:
    """Raise InvalidBatchError unless the hull reaches the puts that are young, and all are places. O(k)."""
    misplaced = _misplaced(globe, points, young)
    if misplaced is not None:
        raise InvalidBatchError("puts.points", misplaced.place, misplaced.problem, misplaced.row)


def _misplaced(globe: Globe, points: Points, young: Rows | None) -> Misplaced | None:
    """The first row that is no place, or that is young and out of the reach of the hull."""
    misplaced = off_globe(points)
    if misplaced is None:
        misplaced = globe.refusal(points if young is None else points[young])
        if misplaced is not None and young is not None:
            misplaced = replace(misplaced, row=int(np.flatnonzero(young)[misplaced.row]))
    return misplaced


def move_center(hull: object, center: Center | None) -> None:
    """Move the centre of a hull, None to the mean direction of its points. O(n log n).

    Raises:
        MisfitError: the hull is a plane, or cannot have this centre; nothing has changed.
    """
    if not isinstance(hull, GeographicHull):
        raise MisfitError("", "is a plane, which has no centre")
    points = hull.points()
    if center is None and not len(points):
        raise MisfitError("center", "has no points to choose a centre from")
    frame = Gnomonic.about(points) if center is None else Gnomonic(center)
    misplaced = out_of_reach(frame, points)
    if misplaced is not None:
        raise MisfitError("center", f"has the point {misplaced.place}, {misplaced.problem}")
    hull.recenter(frame.center)
