"""Where a hull on the globe is: its bounds in degrees, and a place inside for its label."""

from __future__ import annotations

from math import copysign, nan
from typing import TYPE_CHECKING

import numpy as np

from ._flat_map import on_sheets
from ._globe import Gnomonic, wrapped
from ._rings import ring_signs
from .arrays import as_tuples
from .measure import label_point as label_in_plane

if TYPE_CHECKING:
    from ._predicates import Floats, Point
    from .arrays import Points

POLE, HALF_ROUND = 90.0, 180.0  # degrees


def bounds(vertices: Points) -> tuple[float, float, float, float]:
    """West, south, east and north of the hull of (h, 2) vertices, as the `bbox` of GeoJSON (RFC 7946, section 5.2).

    West is greater than east across the antimeridian. With a pole inside, from -180 to 180, and to the pole. Longitudes
    are exact; so are latitudes, but for an edge that reaches beyond its ends, where they are within 1e-13 degrees. NaN
    for no vertices. O(h).
    """
    if not len(vertices):
        return nan, nan, nan, nan
    lon, lat = wrapped(vertices[:, 0]), vertices[:, 1]
    east = np.roll(lon, -1) - lon
    closed = len(vertices) > 2
    if (np.abs(lat) == POLE).any() or (np.abs(east) == HALF_ROUND).any():  # a way along the border of the map
        positions = on_sheets(as_tuples(vertices), closed=closed)
        lons, lats, sheets = (np.array(column) for column in zip(*positions, strict=True))
        lat = np.concatenate([lats, _apexes(lat, east)])
    else:
        after = np.cumsum(1 * (east < -HALF_ROUND) - (east > HALF_ROUND))
        sheets = np.concatenate([[0], after if closed else after[:-1]])
        lons = np.append(lon, lon[0])[: len(sheets)]
        lat = np.concatenate([lat, _apexes(lat, east)])
    south, north = float(lat.min()), float(lat.max())
    turns = int(sheets[-1]) - int(sheets[0]) if closed else 0
    if turns:
        pole = copysign(POLE, turns)
        return -180.0, min(south, pole), 180.0, max(north, pole)
    low, high = sheets.min(), sheets.max()
    first, last = float(lons[sheets == low].min()), float(lons[sheets == high].max())
    return first, south, 180.0 if last == -180 and low < high else last, north


def label_point(vertices: Points, center: Point) -> Point:
    """A place inside the hull of (h, 2) vertices, exactly in its projection about this centre.

    A vertex where no place is inside, or rounding leads outside. NaN for no vertices. O(h).
    """
    if not len(vertices):
        return nan, nan
    frame = Gnomonic(center)
    outline = frame.project_all(vertices)
    place = frame.unproject(np.array([label_in_plane(outline)]))
    inside = len(vertices) > 2 and bool(ring_signs(outline, frame.project(place)[0])[0] > 0)
    ((lon, lat),) = as_tuples(place if inside else vertices[:1])
    return lon, lat


def _apexes(lat: Floats, east: Floats) -> Floats:
    """The latitudes of the northernmost or southernmost places that edges have between their ends.

    tan(latitude) = A cos(longitude - that of the apex) along a great circle, whose A is computed here without a
    difference of nearly equal numbers.
    """
    start = np.tan(np.radians(lat))
    end = np.roll(start, -1)
    angle = np.radians(east - 2 * HALF_ROUND * ((east > HALF_ROUND) * 1 - (east < -HALF_ROUND)))
    level = np.cos(angle)
    north = (end > start * level) & (start > end * level)
    between = north | ((end < start * level) & (start < end * level))
    if not between.any():
        return start[:0]
    p, q, d = start[between], end[between], angle[between]
    reached = np.degrees(np.arctan(np.sqrt(((p - q) / np.sin(d)) ** 2 + p * q / np.cos(d / 2) ** 2)))
    apexes: Floats = np.where(north[between], reached, -reached)
    return apexes
