"""The gnomonic projection about a centre: it maps great circles to straight lines.

A projection consists of additions, subtractions, multiplications, divisions and roundings to integers. IEEE 754 defines
these to the last bit, so a place has the same projection on every machine, alone or in a batch. The sines of numpy and
of C differ between machines, and numpy's between one number and many.
"""

from __future__ import annotations

import math
from math import fsum
from typing import TYPE_CHECKING, Self, TypeVar

import numpy as np
import numpy.typing as npt

from ._implementation import kernel
from ._predicates import Floats, Point
from .arrays import Points, as_coordinate, as_points, repr_of

if TYPE_CHECKING:
    from typing import Any

T = TypeVar("T", Floats, float)

REACH = 85.0  # degrees from the centre
# The cosine of REACH, less 6 nanometres: a point at just this angle is accepted whichever way it is rounded.
LEAST_COSINE = 0.08715574274765817 - 1e-15

RADIANS = 0.017453292519943295  # pi / 180 as a double, and what is missing
RADIANS_REST = 2.9486522708701687e-19
SPLITTER = 134217729.0  # 2**27 + 1

# The sine and the cosine of up to pi / 4, each within 0.6 units in the last place (FreeBSD, k_sin.c and k_cos.c).
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

    Args:
        center: longitude and latitude in degrees, checked by `as_center`.
    """

    __slots__ = ("_cos", "_sin", "center")

    def __init__(self, center: Point) -> None:
        self.center = center
        sine, cosine = sin_cos(np.array([center[1]]))
        self._sin, self._cos = float(sine[0]), float(cosine[0])

    @classmethod
    def about(cls, lonlat: Points) -> Self:
        """About the direction of the mean vector of (k, 2) places, which does not depend on their order."""
        lon, lat = lonlat.T
        (sin_lon, cos_lon), (sin_lat, cos_lat) = sin_cos(lon / 2), sin_cos(lat)
        x = fsum((cos_lat * (1 - 2 * sin_lon * sin_lon)).tolist())
        y = fsum((cos_lat * (2 * sin_lon * cos_lon)).tolist())
        z = fsum(sin_lat.tolist())
        return cls(as_center((math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y))))))

    def project(self, lonlat: Points) -> tuple[Points, npt.NDArray[np.bool_]]:
        """The projections of (k, 2) places, and which of them are within REACH; the others have no projection (NaN)."""
        if kernel is not None:
            return kernel.gnomonic(lonlat, *self.center, self._sin, self._cos)
        return self._project(lonlat)

    def _project(self, lonlat: Points) -> tuple[Points, npt.NDArray[np.bool_]]:
        x, y, z = self._vectors(lonlat)
        near: npt.NDArray[np.bool_] = z >= LEAST_COSINE
        z = np.where(near, z, np.nan)
        return np.column_stack([x / z, y / z]) + 0.0, near

    def angle(self, place: Point) -> float:
        """The angle in degrees between the centre and a place, for messages."""
        x, y, z = (float(value[0]) for value in self._vectors(np.array([place])))
        return math.degrees(math.atan2(math.hypot(x, y), z))

    def _vectors(self, lonlat: Points) -> tuple[Floats, Floats, Floats]:
        """East, north and up, as seen from the centre.

        Written with the differences to the centre's coordinates, so that near the centre nothing cancels.
        """
        lon, lat = lonlat.T
        across, across_rest = _difference(_wrapped(lon), self.center[0])
        along, along_rest = _difference(lat, self.center[1])
        sin_half, cos_half = sin_cos(across / 2, across_rest / 2)
        sin_along, cos_along = sin_cos(along, along_rest)
        _, cos_lat = sin_cos(lat)
        chord = 2 * sin_half * cos_lat
        rise = chord * sin_half
        return chord * cos_half, sin_along + self._sin * rise, cos_along - self._cos * rise


def as_lonlat(lonlat: npt.ArrayLike, name: str = "points") -> Points:
    """Return places as `as_points` does; refuse longitudes beyond 360 and latitudes beyond 90 degrees."""
    places = as_points(lonlat, name)
    bad = np.flatnonzero((np.abs(places) > [360.0, 90.0]).any(axis=1))
    if bad.size:
        row = int(bad[0])
        _refuse_outside((places[row, 0].item(), places[row, 1].item()), f"{name} row {row}")
    return places


def as_place(lon: Any, lat: Any) -> Points:
    """Return one place as an array of shape (1, 2), checked like `as_lonlat`."""
    place = as_coordinate(lon, "lon"), as_coordinate(lat, "lat")
    if abs(place[0]) > 360 or abs(place[1]) > 90:
        _refuse_outside(place, "the point")
    return np.array([place])


def as_center(center: Any) -> Point:
    """Return a centre as longitude, from -180 to below 180, and latitude."""
    try:
        lon, lat = center
    except (TypeError, ValueError):
        raise ValueError(f"center must be (longitude, latitude), got {repr_of(center)}") from None
    place = as_coordinate(lon, "longitude of center"), as_coordinate(lat, "latitude of center")
    if abs(place[0]) > 360 or abs(place[1]) > 90:
        _refuse_outside(place, "center")
    return float(_wrapped(np.array([place[0]]))[0]), place[1]


def _refuse_outside(place: Point, where: str) -> None:
    lon, lat = place
    if abs(lat) > 90:
        hint = "; longitude comes first" if abs(lon) <= 90 else ""
        raise ValueError(f"{where} is ({lon}, {lat}): a latitude must be from -90 to 90 degrees{hint}")
    raise ValueError(f"{where} is ({lon}, {lat}): a longitude must be from -360 to 360 degrees")


def sin_cos(degrees: Floats, rest: Floats | float = 0.0) -> tuple[Floats, Floats]:
    """Sine and cosine of up to 180 degrees, given as a sum of two doubles, the second much smaller.

    Exact for multiples of 90 degrees: the poles are points, and the antimeridian is one line.
    """
    quarters = np.rint(degrees / 90)
    x, y = _radians(degrees - 90 * quarters, rest)  # the difference is exact (Sterbenz 1974)
    z = x * x
    cube = z * x
    tail = S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)))
    sine = x - ((z * (0.5 * y - cube * tail) - y) - cube * S1)
    tail = z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))
    half = 0.5 * z
    first = 1 - half
    cosine = first + (((1 - first) - half) + (z * tail - x * y))
    quadrant = quarters.astype(np.int64) & 3
    odd = quadrant % 2 == 1
    return (
        np.where(odd, cosine, sine) * np.where(quadrant >= 2, -1.0, 1.0),
        np.where(odd, sine, cosine) * np.where((quadrant == 1) | (quadrant == 2), -1.0, 1.0),
    )


def _radians(degrees: Floats, rest: Floats | float) -> tuple[Floats, Floats]:
    """Radians as a sum of two doubles, the product as Dekker (1971) does."""
    product = degrees * RADIANS
    high, low = _split(degrees)
    factor_high, factor_low = _split(RADIANS)
    error = ((high * factor_high - product) + high * factor_low + low * factor_high) + low * factor_low
    return product, error + (degrees * RADIANS_REST + rest * RADIANS)


def _split(value: T) -> tuple[T, T]:
    """Two halves of the digits of a number."""
    scaled = SPLITTER * value
    high = scaled - (scaled - value)
    return high, value - high


def _difference(a: Floats, b: float) -> tuple[Floats, Floats]:
    """The difference a - b as a sum of two doubles, exactly (Knuth)."""
    rounded = a - b
    taken = a - rounded
    return rounded, (a - (rounded + taken)) + (taken - b)


def _wrapped(lon: Floats) -> Floats:
    """Longitudes from -180 to below 180. Exact (Sterbenz 1974)."""
    wrapped: Floats = np.where(lon >= 180, lon - 360, np.where(lon < -180, lon + 360, lon))
    return wrapped + 0.0
