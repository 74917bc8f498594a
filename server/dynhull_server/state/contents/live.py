"""What all kinds of contents have in common: with or without keys, with or without a window."""

from collections.abc import Iterable
from typing import Any, Protocol

from dynhull import DynamicHull, GeoHull, GeoKeyedHull, GeoWindowHull, KeyedHull, WindowHull
from dynhull.arrays import Points

from ..batch import NO_POINTS, Applied
from ..frames import Globe
from ..records import Cause, Center, Contents, Expiry, Record, Rows

AnyHull = DynamicHull | KeyedHull | WindowHull | GeoHull | GeoKeyedHull | GeoWindowHull
AnyKeyedHull = KeyedHull | GeoKeyedHull

# Changes are replayed as one of up to this many rows, which is many times faster.
REPLAYED_TOGETHER = 65_536


class LiveContents(Protocol):
    """The points of a hull. A batch is admitted, then applied; `Admitted` batches belong to the class that made them.

    Attributes:
        clock: the clock of the hull in microseconds since 1970, None for a hull without a clock so far.
        follows_server: whether the clock, if any, follows the server's, rather than event times.
        globe: the frame of a geographic hull; None for a plane.
    """

    clock: int | None
    follows_server: bool
    globe: Globe | None

    @property
    def hull(self) -> AnyHull:
        """The points."""

    @property
    def due(self) -> int | None:
        """The time by the server's clock before which no point leaves; None if that clock makes none leave."""

    def admit(self, batch: Any, arrived: int) -> Any:
        """The batch with the times of its rows, without those that are too old. Changes nothing.

        Args:
            batch: a Batch or a KeyedBatch.
            arrived: the time of its arrival by the server's clock, in microseconds since 1970.

        Raises:
            MisfitError: a hull of this kind takes no such batch.
            RefusedError: the times are invalid, or the hull would have too many points.
        """

    def check(self, admitted: Any) -> None:
        """Raise the error with which `apply` would refuse the batch."""

    def expires_before(self, admitted: Any) -> int | None:
        """The clock that the batch leads to, if points leave at that time; None if none do. The hull has a clock."""

    def apply(self, admitted: Any, revision: int) -> Applied:
        """Apply the batch as `revision`. Returns its effect.

        Raises:
            RefusedError: the batch is refused; nothing has changed.
        """

    def rows(self, admitted: Any, applied: Applied) -> Rows:
        """The rows of an applied batch that `replay` needs."""

    def cause(self, admitted: Any) -> Cause:
        """What makes the revision of a batch."""

    def recenter(self, center: Center | None) -> Rows:
        """Move the centre of a geographic hull; None for the mean direction of its points. Returns no rows.

        Raises:
            MisfitError: the hull is a plane, or cannot have this centre; nothing has changed.
        """

    def expire(self, clock: int) -> Expiry | None:
        """Advance the clock, and remove the points that leave. If none do, the clock stays, and None is returned."""

    def replay(self, records: Iterable[Record]) -> None:
        """Apply recorded changes, many at a time."""

    def stored(self) -> Contents:
        """The points, for a snapshot. O(n log n)."""


def layer_of(hull: AnyHull, number: int) -> Points:
    """The vertices of a convex layer, from 1; none if the points run out before. O(log² n) for each of those before."""
    if number == 1:
        return hull.vertices()
    layers = hull.layers(number)
    return layers[-1] if len(layers) == number else NO_POINTS
