"""The gnomonic projection about a centre: it maps great circles to straight lines.

A projection consists of additions, subtractions, multiplications, divisions and roundings to integers. IEEE 754 defines
these to the last bit, so a place has the same projection on every machine, alone or in a batch. The sines of numpy and
of C differ between machines, and numpy's between one number and many.
"""

from __future__ import annotations

import math
from math import fsum
from typing import TYPE_CHECKING, Self

import numpy as np
import numpy.typing as npt

from ._exact import products
from ._implementation import kernel
from ._predicates import Floats, Point
from .arrays import Points, as_coordinate, as_points, repr_of

if TYPE_CHECKING:
    from typing import Any

Sum = tuple[Floats, Floats]  # of two doubles, the second much smaller

CHOSEN = ", the mean direction of the first points (`center` gives another)"
REACH = 85.0  # degrees from the centre
# The cosine of REACH, less 6 nanometres: a point at just this angle is accepted whichever way it is rounded.
LEAST_COSINE = 0.08715574274765817 - 1e-15

RADIANS = 0.017453292519943295  # pi / 180 as a double, and what is missing
RADIANS_REST = 2.9486522708701687e-19

# The sine and the cosine of up to pi / 4 (FreeBSD, k_sin.c and k_cos.c).
S1 = -1.66666666666666324348e-01
S2 = 8.33333333332248946124e-03
S3 = -1.98412698298579493134e-04
S4 = 2.75573137070700676789e-06
S5 = -2.50507602534068634195e-08
S6 = 1.58969099521155010221e-10
C1 = 4.16666666666666019037e-02
C2 = -1.38888888888741095749e-03
C3 = 2.48015872894767294178e-05
C4 = -2.75573143513906633035e-07
C5 = 2.08757232129817482790e-09
C6 = -1.13596475577881948265e-11


class Gnomonic:
    """The gnomonic projection about a centre, in units of the globe's radius: x to the east, y to the north.

    It maps great circles to straight lines. A place has the same projection on every machine, to the last bit; two
    places may have one projection in common: (180, 0) and (-180, 0), or places less than a nanometre apart.

    Args:
        center: longitude and latitude in degrees. `center` is then the same with a longitude from -180 to below 180.

    Raises:
        ValueError, TypeError: the centre is not a place.
    """

    __slots__ = ("_cos", "_sin", "center")

    center: Point

    def __init__(self, center: Point) -> None:
        self.center = as_center(center)
        self._sin, self._cos = (
            (float(value[0]), float(rest[0])) for value, rest in sin_cos(np.array([self.center[1]]))
        )

    @classmethod
    def about(cls, lonlat: Points) -> Self:
        """About the direction of the mean vector of (k, 2) places, which does not depend on their order. O(k)."""
        lon, lat = lonlat.T
        ((sin_lon, _), (cos_lon, _)), ((sin_lat, _), (cos_lat, _)) = sin_cos(lon / 2), sin_cos(lat)
        x = fsum((cos_lat * (1 - 2 * sin_lon * sin_lon)).tolist())
        y = fsum((cos_lat * (2 * sin_lon * cos_lon)).tolist())
        z = fsum(sin_lat.tolist())
        return cls((math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y)))))

    def project(self, lonlat: Points) -> tuple[Points, npt.NDArray[np.bool_]]:
        """The projections of places, and which of them have one. O(k).

        Args:
            lonlat: (k, 2) places as `as_lonlat` returns them.

        Returns:
            xy: (k, 2) projections, NaN beyond REACH.
            near: (k,) which places are within REACH.
        """
        if kernel is not None:
            return kernel.gnomonic(lonlat, (self.center, self._sin, self._cos))
        return self._project(lonlat)

    def _project(self, lonlat: Points) -> tuple[Points, npt.NDArray[np.bool_]]:
        x, y, z = self._vectors(lonlat)
        near: npt.NDArray[np.bool_] = z >= LEAST_COSINE
        z = np.where(near, z, np.nan)
        return np.column_stack([x / z, y / z]) + 0.0, near

    def project_all(self, lonlat: Points, name: str = "points") -> Points:
        """The (k, 2) projections of places, all of which are to have one. O(k).

        Raises:
            ValueError: a place is beyond REACH; the message names the first such row.
        """
        places, near = self.project(lonlat)
        self.require(lonlat, near, f"{name} row {{}}")
        return places

    def require(self, lonlat: Points, near: npt.NDArray[np.bool_], name: str, chosen: str = "") -> None:
        """Raise ValueError for the first of (k, 2) places that is not near. O(k)."""
        far = np.flatnonzero(~near)
        if far.size:
            row = int(far[0])
            pair = (lonlat[row, 0].item(), lonlat[row, 1].item())
            raise ValueError(
                f"{name.format(row)} is {pair}: {self.angle(pair):.6f} degrees from the centre {self.center}{chosen}; "
                f"a hull reaches {REACH:g} degrees"
            )

    def unproject(self, xy: Points) -> Points:
        """The places of (k, 2) points of the plane, longitudes from -180 to 180. Rounded, a nanometre or so. O(k)."""
        x, y = xy.T
        up, level = self._sin[0] + y * self._cos[0], self._cos[0] - y * self._sin[0]
        lon = self.center[0] + np.degrees(np.arctan2(x, level))
        lat = np.degrees(np.arctan2(up, np.hypot(level, x)))
        places: Points = np.column_stack([wrapped(lon), lat])
        return places

    def angle(self, place: Point) -> float:
        """The angle in degrees between the centre and a place."""
        return float(self.angles(np.array([place]))[0])

    def angles(self, lonlat: Points) -> Floats:
        """(k,) angles in degrees between the centre and (k, 2) places. Rounded: nanometres on the ground. O(k)."""
        x, y, z = self._vectors(lonlat)
        angles: Floats = np.degrees(np.arctan2(np.hypot(x, y), z))
        return angles

    def vectors(self, lonlat: Points) -> npt.NDArray[np.float64]:
        """(k, 3) unit vectors of (k, 2) places anywhere: east, north and up, as seen from the centre. O(k)."""
        return np.column_stack(self._vectors(lonlat))

    def _vectors(self, lonlat: Points) -> tuple[Floats, Floats, Floats]:
        """East, north and up, as seen from the centre.

        Written with the differences to the centre's coordinates, so that near the centre nothing cancels. Far from it
        up is small, and it divides: what is subtracted there are sums of two doubles.
        """
        lon, lat = lonlat.T
        across, across_rest = _difference(wrapped(lon), self.center[0])
        along, along_rest = _difference(lat, self.center[1])
        sin_half, cos_half = sin_cos(across / 2, across_rest / 2)
        sin_along, cos_along = sin_cos(along, along_rest)
        _, cos_lat = sin_cos(lat)
        chord = _product((2 * sin_half[0], 2 * sin_half[1]), cos_lat)
        rise = _product(chord, sin_half)
        fall = _product(rise, self._cos)
        up = (cos_along[0] - fall[0]) + (cos_along[1] - fall[1])
        east = chord[0] * cos_half[0] + (chord[0] * cos_half[1] + chord[1] * cos_half[0])
        sine, rest = self._sin
        north = (sin_along[0] + sine * rise[0]) + (sin_along[1] + (sine * rise[1] + rest * rise[0]))
        return east, north, up


# What the kernel asks of Python.


def parameters(center: Point) -> tuple[Point, Point, Point]:
    """The projection about a centre as the kernel takes it."""
    frame = Gnomonic(center)
    return frame.center, frame._sin, frame._cos


def chosen(lonlat: Points) -> tuple[Point, Point, Point] | None:
    """The projection that (k, 2) first places choose, not yet checked; None if they are none, or bad."""
    try:
        places = as_lonlat(lonlat)
    except (TypeError, ValueError):
        return None
    return parameters(Gnomonic.about(places).center) if len(places) else None


def refused(lonlat: Points, inserted: npt.NDArray[np.bool_], center: Point | None, name: str) -> Points:
    """The places of a batch, checked as the batch checks them: raises the error for which it is refused."""
    places = as_lonlat(lonlat)
    if center is not None:
        require_near(places, center, inserted, name)
    elif inserted.any():
        require_near(places, Gnomonic.about(places[inserted]).center, inserted, name, CHOSEN)
    return places


def require_near(
    lonlat: Points,
    center: Point,
    inserted: npt.NDArray[np.bool_] | bool = True,
    name: str = "points row {}",
    how: str = "",
) -> None:
    """Raise ValueError for the first inserted place that is too far from a centre."""
    frame = Gnomonic(center)
    frame.require(lonlat, frame.project(lonlat)[1] | ~np.asarray(inserted), name, how)


def as_lonlat(lonlat: npt.ArrayLike, name: str = "points") -> Points:
    """Return (k, 2) places as `dynhull.arrays.as_points` does. O(k).

    Raises:
        ValueError, TypeError: as `as_points`, and for longitudes beyond 360 and latitudes beyond 90 degrees. The
            message names the first bad row.
    """
    places = as_points(lonlat, name, on_globe=True)
    beyond = np.abs(places) > (360.0, 90.0)
    if beyond.any():
        row = int(np.argmax(beyond.any(axis=1)))
        _refuse_outside((places[row, 0].item(), places[row, 1].item()), f"{name} row {row}")
    return places


def as_place(lon: Any, lat: Any) -> Point:
    """Return one place, checked like `as_lonlat`."""
    place = as_coordinate(lon, "lon"), as_coordinate(lat, "lat")
    if abs(place[0]) > 360 or abs(place[1]) > 90:
        _refuse_outside(place, "the point")
    return place


def as_center(center: Any) -> Point:
    """Return a centre as longitude, from -180 to below 180, and latitude."""
    try:
        lon, lat = center
    except (TypeError, ValueError):
        raise ValueError(f"center must be (longitude, latitude), got {repr_of(center)}") from None
    place = as_coordinate(lon, "longitude of center"), as_coordinate(lat, "latitude of center")
    if abs(place[0]) > 360 or abs(place[1]) > 90:
        _refuse_outside(place, "center")
    return float(wrapped(np.array([place[0]]))[0]), place[1]


def _refuse_outside(place: Point, where: str) -> None:
    lon, lat = place
    if abs(lat) > 90:
        hint = "; longitude comes first" if abs(lon) <= 90 else ""
        raise ValueError(f"{where} is ({lon}, {lat}): a latitude must be from -90 to 90 degrees{hint}")
    raise ValueError(f"{where} is ({lon}, {lat}): a longitude must be from -360 to 360 degrees")


def sin_cos(degrees: Floats, rest: Floats | float = 0.0) -> tuple[Sum, Sum]:
    """Sine and cosine, as sums, of up to 180 degrees, given as a sum.

    Exact for multiples of 90 degrees: the poles are points, and the antimeridian is one line.
    """
    quarters = np.rint(degrees / 90)
    x, y = _radians(degrees - 90 * quarters, rest)  # the difference is exact (Sterbenz 1974)
    z = x * x
    cube = z * x
    tail = S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)))
    sine = _sum(x, -((z * (0.5 * y - cube * tail) - y) - cube * S1))
    tail = z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))
    half = 0.5 * z
    first = 1 - half
    cosine = _sum(first, ((1 - first) - half) + (z * tail - x * y))
    turns = np.abs(quarters)
    turned, across = 1 - turns, quarters * (2 - turns)  # cosine and sine of the quarters: 0, 1 or -1
    return (
        (turned * sine[0] + across * cosine[0], turned * sine[1] + across * cosine[1]),
        (turned * cosine[0] - across * sine[0], turned * cosine[1] - across * sine[1]),
    )


def _radians(degrees: Floats, rest: Floats | float) -> Sum:
    product, error = products(degrees, RADIANS)
    return product, error + (degrees * RADIANS_REST + rest * RADIANS)


def _product(a: Sum, b: Sum | tuple[float, float]) -> Sum:
    product, error = products(a[0], b[0])
    return product, error + (a[0] * b[1] + a[1] * b[0])


def _sum(a: Floats, b: Floats) -> Sum:
    """The sum, exactly, where the first is greater (Dekker 1971)."""
    rounded = a + b
    return rounded, (a - rounded) + b


def _difference(a: Floats, b: float) -> Sum:
    """The difference a - b, exactly (Knuth)."""
    rounded = a - b
    taken = a - rounded
    return rounded, (a - (rounded + taken)) + (taken - b)


def wrapped(lon: Floats) -> Floats:
    """Longitudes from -180 to below 180. Exact (Sterbenz 1974)."""
    wrapped: Floats = (lon - np.where(lon >= 180, 360.0, 0.0)) + np.where(lon < -180, 360.0, 0.0)
    return wrapped
