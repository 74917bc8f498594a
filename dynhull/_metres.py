"""Metres on WGS84 from a place to an edge, in the plane of a projection: for decisions, so the same on every machine.

The kernel has the same operations, one by one. They are additions, multiplications, divisions and square roots, which
IEEE 754 defines to the last bit. Measures that are reported and decide nothing, at any distance, are those of
`_ellipsoid`.

The ellipsoid is the image of the globe of normals: a direction D of the globe has the place S D / sqrt(D S D) on it,
with S = diag(1, 1, 1 - e²), in radii of the equator. In the plane of a gnomonic projection D is linear, also along
edges. So the nearest place of an edge takes two steps of Gauss and Newton from the nearest one of the globe. A chord
becomes an arc by the curvature of the ellipsoid in its direction: that in the middle, weighted eight times as much as
each of the ends, is right up to the fourth power of the arc.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ._globe import Gnomonic
    from ._predicates import Floats
    from .arrays import Points

    Vectors = tuple[Floats, Floats, Floats]

# Metres beyond which no distance is decided. An area within that of a place in reach is where the plane still is.
MOST_METRES = 250_000.0
FARTHEST = 0.0392  # its chord and more, in radii of the equator: farther places are infinitely far
EQUATOR = 6378137.0
FLAT = 0.9933056200098587  # 1 - e²
STEPS = 2
# The arcsine of a root, over the root: (1, 1/6, 3/40, 5/112, 35/1152, 63/2816), all of a chord's digits.
ARC = (0.16666666666666666, 0.075, 0.044642857142857144, 0.030381944444444444, 0.022372159090909092)


class Metres:
    """Distances in metres between points and edges of the plane of a projection.

    Within a micrometre up to 250 km, rounding of the projection included; infinite beyond. For places within 85 degrees
    of the centre and edges within 88.

    Args:
        frame: the projection.
    """

    __slots__ = ("_cos", "_sin")

    def __init__(self, frame: Gnomonic) -> None:
        self._sin, self._cos = frame._sin[0], frame._cos[0]

    def to_edges(self, places: Points, start: Points, end: Points) -> Floats:
        """(k,) distances from (k, 2) points to edges, each from a point of `start` to one of `end`. O(k).

        An edge whose ends are the same is a point.
        """
        p, a = self._direction(places), self._direction(start)
        dx, dy = end[:, 0] - start[:, 0], end[:, 1] - start[:, 1]
        way = 0.0 - dy * self._sin, dx, dy * self._cos
        here = _surface(p)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = _nearest_share(p, a, way)
            for _ in range(STEPS):
                share = _step(here, a, way, share)
            nearest = a[0] + share * way[0], a[1] + share * way[1], a[2] + share * way[2]
            return _arc(p, here, nearest)

    def _direction(self, xy: Points) -> Vectors:
        """The directions of points of the plane: in the centre's meridian, east and up, not of length 1."""
        x, y = xy[:, 0], xy[:, 1]
        return self._cos - y * self._sin, x, self._sin + y * self._cos


def _surface(direction: Vectors) -> Vectors:
    """Where the ellipsoid has a direction as its normal, in radii of the equator."""
    x, y, z = direction
    up = FLAT * z
    root = np.sqrt((x * x + y * y) + z * up)
    return x / root, y / root, up / root


def _nearest_share(p: Vectors, a: Vectors, way: Vectors) -> Floats:
    """The share of the way along an edge at which its direction is nearest to that of p."""
    ahead, along = _dot(p, a), _dot(p, way)
    first, second, third = _dot(a, a), _dot(a, way), _dot(way, way)
    divisor = ahead * third - along * second
    return np.where(divisor > 0, _within((along * first - ahead * second) / divisor), 0.0)


def _step(here: Vectors, a: Vectors, way: Vectors, share: Floats) -> Floats:
    """A step of Gauss and Newton towards the nearest place on the ellipsoid."""
    x, y, z = a[0] + share * way[0], a[1] + share * way[1], a[2] + share * way[2]
    up, rise = FLAT * z, FLAT * way[2]
    square = (x * x + y * y) + z * up
    root = np.sqrt(square)
    turn = ((x * way[0] + y * way[1]) + z * rise) / square
    speed = (way[0] - x * turn) / root, (way[1] - y * turn) / root, (rise - up * turn) / root
    apart = here[0] - x / root, here[1] - y / root, here[2] - up / root
    divisor = _dot(speed, speed)
    return np.where(divisor > 0, _within(share + _dot(apart, speed) / divisor), share)


def _arc(p: Vectors, here: Vectors, nearest: Vectors) -> Floats:
    """Metres along the ellipsoid between places of two directions, given one of these places."""
    there = _surface(nearest)
    apart = there[0] - here[0], there[1] - here[1], there[2] - here[2]
    square = _dot(apart, apart)
    own, other = np.sqrt(_dot(p, p)), np.sqrt(_dot(nearest, nearest))
    middle = p[0] / own + nearest[0] / other, p[1] / own + nearest[1] / other, p[2] / own + nearest[2] / other
    curvature = 0.8 * _curvature(middle, apart) + 0.1 * (_curvature(p, apart) + _curvature(nearest, apart))
    chord = np.sqrt(square)
    half = curvature * chord / 2
    z = half * half
    series = 1 + z * (ARC[0] + z * (ARC[1] + z * (ARC[2] + z * (ARC[3] + z * ARC[4]))))
    metres = EQUATOR * chord * series
    return np.where(square > 0, np.where(chord <= FARTHEST, metres, np.inf), 0.0)


def _curvature(normal: Vectors, apart: Vectors) -> Floats:
    """The curvature of the ellipsoid at a normal, in the direction in which a chord leaves the normal."""
    x, y, z = normal
    square = _dot(normal, normal)
    steep = _dot(apart, normal) / square
    east, north, up = apart[0] - steep * x, apart[1] - steep * y, apart[2] - steep * z
    level = east * east + north * north
    return np.sqrt(((x * x + y * y) + z * (FLAT * z)) / square) * ((level + up * up / FLAT) / (level + up * up))


def _dot(a: Vectors, b: Vectors) -> Floats:
    product: Floats = (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
    return product


def _within(share: Floats) -> Floats:
    return np.where(share > 0, np.where(share < 1, share, 1.0), 0.0)  # 0 for what is no number
