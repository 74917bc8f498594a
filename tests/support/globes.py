"""Places on the globe: hulls that the tests run on, a judge with fifty digits, random sets."""

from itertools import pairwise

import mpmath
import numpy as np
import spherely

from dynhull import GeoHull, GeoKeyedHull, GeoWindowHull
from dynhull._globe_tree import GlobeEntities, GlobeTree, GlobeWindowTree

EARTH_RADIUS = 6371008.8  # metres, the mean
DIGITS = mpmath.MPContext()
DIGITS.dps = 50


class PythonGeoHull(GeoHull):
    __slots__ = ()
    _tree_type = GlobeTree


class PythonGeoKeyedHull(GeoKeyedHull):
    __slots__ = ()
    _tree_type = GlobeEntities


class PythonGeoWindowHull(GeoWindowHull):
    __slots__ = ()
    _tree_type = GlobeWindowTree


GEO_HULLS = {"python": PythonGeoHull, "as installed": GeoHull}
GEO_KEYED_HULLS = {"python": PythonGeoKeyedHull, "as installed": GeoKeyedHull}
GEO_WINDOW_HULLS = {"python": PythonGeoWindowHull, "as installed": GeoWindowHull}


def direction(place):
    """The unit vector of a place, to fifty digits."""
    lon, lat = (DIGITS.radians(DIGITS.mpf(float(value))) for value in place)
    return DIGITS.cos(lat) * DIGITS.cos(lon), DIGITS.cos(lat) * DIGITS.sin(lon), DIGITS.sin(lat)


def projection(center, place):
    """The gnomonic projection, to fifty digits, in radii of the globe."""
    (lon, lat), (lon_0, lat_0) = (
        [DIGITS.radians(DIGITS.mpf(float(value))) for value in each] for each in (place, center)
    )
    x = DIGITS.cos(lat) * DIGITS.sin(lon - lon_0)
    y = DIGITS.cos(lat_0) * DIGITS.sin(lat) - DIGITS.sin(lat_0) * DIGITS.cos(lat) * DIGITS.cos(lon - lon_0)
    z = DIGITS.sin(lat_0) * DIGITS.sin(lat) + DIGITS.cos(lat_0) * DIGITS.cos(lat) * DIGITS.cos(lon - lon_0)
    return x / z, y / z


def triple(a, b, c):
    """The determinant of three directions: positive if the great circle from a to b has c on its left."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = map(direction, (a, b, c))
    return cx * (ay * bz - az * by) + cy * (az * bx - ax * bz) + cz * (ax * by - ay * bx)


def around(rng, center, radius, count):
    """(count, 2) random places, evenly over the cap of this radius in degrees, which may hold poles and 180 degrees."""
    least = np.cos(np.radians(radius))
    # The height of a place below the middle of the cap, small for small caps, is not computed as a difference of ones.
    height = rng.uniform(0, 1 - least if radius > 1 else np.radians(radius) ** 2 / 2, count)
    up, out, turn = 1 - height, np.sqrt(height * (2 - height)), rng.uniform(0, 2 * np.pi, count)
    lon, lat = np.radians(center)
    east, north = out * np.sin(turn), out * np.cos(turn)
    z = up * np.sin(lat) + north * np.cos(lat)
    level = up * np.cos(lat) - north * np.sin(lat)
    found = np.degrees(np.column_stack([lon + np.arctan2(east, level), np.arctan2(z, np.hypot(level, east))]))
    found[:, 0] = (found[:, 0] + 540) % 360 - 180
    return found


def random_center(rng):
    """Anywhere, often at a pole, beside one, or on the antimeridian."""
    kind = rng.integers(6)
    if kind == 0:
        return float(rng.uniform(-180, 180)), float(rng.choice([-90, 90]))
    if kind == 1:
        return float(rng.choice([-180, 180])), float(rng.uniform(-89, 89))
    if kind == 2:
        return float(rng.uniform(-180, 180)), float(rng.choice([-1, 1]) * rng.uniform(85, 90))
    return float(rng.uniform(-180, 180)), float(np.degrees(np.arcsin(rng.uniform(-1, 1))))


def random_set(rng, most):
    """A centre, a radius from metres to 80 degrees, and 3 to `most` places in that cap."""
    center = random_center(rng)
    radius = float(rng.choice([10 ** rng.uniform(-5, 0), rng.uniform(1, 80), 80]))
    return center, radius, around(rng, center, radius, int(np.exp(rng.uniform(np.log(3), np.log(most)))))


def s2_hull(places):
    """The hull by S2 and its vertices as directions; None if S2 takes the whole globe for the hull.

    It does so if its bound on the latitudes and longitudes of the places is not within a hemisphere.
    """
    hull = spherely.convex_hull(spherely.create_multipoint(places))
    text = spherely.to_wkt(hull, precision=17)
    assert text.startswith("POLYGON ((")
    ring = np.array([pair.split() for pair in text[len("POLYGON ((") : -len("))")].split(", ")], dtype=float)
    return (hull, directions(ring[:-1])) if len(ring) > 3 else None


def seen_from_above(center, places):
    """The places on a globe that is turned so that the centre is a pole, where the bound of S2 is close."""
    lon, lat = np.radians(center)
    x, y, z = directions(places).T
    out, east = x * np.cos(lon) + y * np.sin(lon), y * np.cos(lon) - x * np.sin(lon)
    up, out = z * np.sin(lat) + out * np.cos(lat), out * np.sin(lat) - z * np.cos(lat)
    return np.degrees(np.column_stack([np.arctan2(east, out), np.arctan2(up, np.hypot(east, out))]))


def agrees_with_s2(hull, places, center):
    """Whether S2 finds the same vertices, and which of the places its hull covers."""
    found = s2_hull(hull.points())
    turned = found is None
    points, vertices, asked = (
        seen_from_above(center, each) if turned else each for each in (hull.points(), hull.vertices(), places)
    )
    judge, ring = found or s2_hull(points)
    covered = spherely.covers(judge, spherely.points(*asked.T))
    return same_ring(directions(vertices), ring) and hull.contains(places).tolist() == covered.tolist()


def directions(places):
    """(k, 3) unit vectors, as doubles."""
    lon, lat = np.radians(places).T
    return np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


def same_ring(ours, theirs, tolerance=1e-14):
    """Whether two rings of directions are the same but for where they begin, and for rounding."""
    if len(ours) != len(theirs):
        return False
    start = int(((theirs - ours[0]) ** 2).sum(axis=1).argmin())
    return bool(np.abs(np.roll(theirs, -start, axis=0) - ours).max() < tolerance)


def ring_winds_left(ring):
    """Whether a closed ring of positions on a flat map is counter-clockwise."""
    return sum((x1 - x0) * (y1 + y0) for (x0, y0), (x1, y1) in pairwise(ring)) < 0
