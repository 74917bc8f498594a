"""The frames of hulls: what coordinates mean, and which ones are places on the globe.

A geographic hull keeps degrees: the library's hulls take and give them, and project them about the centre. So batches,
records and snapshots have the doubles that were given; beside them they have the centre only.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.globe import REACH, Gnomonic

from .errors import InvalidPlaceError
from .records import Center

GREATEST_LONGITUDE, GREATEST_LATITUDE = 360.0, 90.0


@dataclass(frozen=True, slots=True)
class Misplaced:
    """The first row of an array that cannot be used.

    Attributes:
        row: the row.
        place: its coordinates.
        problem: the reason.
    """

    row: int
    place: tuple[float, float]
    problem: str


def off_globe(lonlat: Points) -> Misplaced | None:
    """The first of (k, 2) pairs that is no longitude and latitude."""
    bad = np.abs(lonlat) > (GREATEST_LONGITUDE, GREATEST_LATITUDE)
    if not bad.any():
        return None
    row = int(np.argmax(bad.any(axis=1)))
    lon, lat = lonlat[row].tolist()
    if abs(lat) <= GREATEST_LATITUDE:
        return Misplaced(row, (lon, lat), "a longitude is from -360 to 360 degrees")
    hint = "; the longitude comes first" if abs(lon) <= GREATEST_LATITUDE else ""
    return Misplaced(row, (lon, lat), f"a latitude is from -90 to 90 degrees{hint}")


def out_of_reach(frame: Gnomonic, lonlat: Points, chosen: str = "") -> Misplaced | None:
    """The first of (k, 2) places that is too far from the centre; `chosen` says how that was chosen."""
    _, near = frame.project(lonlat)
    return None if near.all() else too_far(frame, lonlat, near, chosen)


def too_far(frame: Gnomonic, lonlat: Points, near: npt.NDArray[np.bool_], chosen: str = "") -> Misplaced:
    """The first place that is not near."""
    row = int(np.argmin(near))
    lon, lat = lonlat[row].tolist()
    problem = (
        f"{frame.angle((lon, lat)):.6f} degrees from the centre {frame.center}{chosen}; "
        f"a hull reaches {REACH:g} degrees"
    )
    return Misplaced(row, (lon, lat), problem)


class Globe:
    """The frame of the points of one geographic hull.

    Args:
        center: its centre; None until the first points choose it.
    """

    __slots__ = ("_frame",)

    def __init__(self, center: Center | None) -> None:
        self._frame = None if center is None else Gnomonic(center)

    @property
    def frame(self) -> Gnomonic | None:
        """The projection about the centre."""
        return self._frame

    @property
    def center(self) -> Center | None:
        """The centre."""
        return None if self._frame is None else self._frame.center

    def refusal(self, inserts: Points) -> Misplaced | None:
        """The first of (k, 2) places that the hull does not reach; without a centre they choose it. O(k)."""
        if self._frame is not None:
            return out_of_reach(self._frame, inserts)
        if not len(inserts):
            return None
        return out_of_reach(Gnomonic.about(inserts), inserts, ", the mean direction of the first points")

    def follow(self, center: Center | None) -> bool:
        """Take over the centre of the hull. Returns whether it is a new one."""
        if center is None or center == self.center:
            return False
        self._frame = Gnomonic(center)
        return True


def require_reach(center: Center, field: str, lonlat: Points) -> None:
    """Raise InvalidPlaceError for the first place of a request that a hull with this centre does not reach."""
    _projected(Gnomonic(center), field, lonlat)


def require_lines(center: Center, origins: Points, targets: Points) -> None:
    """Raise InvalidPlaceError unless great circles through (k, 2) origins and targets are lines of the projection."""
    frame = Gnomonic(center)
    same = (_projected(frame, "origins", origins) == _projected(frame, "targets", targets)).all(axis=1)
    if same.any():
        row = int(np.argmax(same))
        lon, lat = targets[row].tolist()
        raise InvalidPlaceError("targets", row, (lon, lat), "is the same place as the origin, so there is no line")


def _projected(frame: Gnomonic, field: str, lonlat: Points) -> Points:
    """The projections of places of a request, all of which the hull is to reach."""
    xy, near = frame.project(lonlat)
    if not near.all():
        misplaced = too_far(frame, lonlat, near)
        raise InvalidPlaceError(field, misplaced.row, misplaced.place, misplaced.problem)
    return xy
