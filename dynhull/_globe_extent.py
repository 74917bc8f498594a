"""Where a hull on the globe is: its bounds in degrees, and a place inside for its label."""

from __future__ import annotations

from math import copysign, nan
from typing import TYPE_CHECKING

import numpy as np

from ._ellipsoid import unit_vectors
from ._flat_map import on_sheets
from ._globe import Gnomonic
from ._rings import ring_signs
from .arrays import as_tuples
from .measure import label_point as label_in_plane

if TYPE_CHECKING:
    from ._predicates import Floats, Point
    from .arrays import Points


def bounds(vertices: Points) -> tuple[float, float, float, float]:
    """West, south, east and north of the hull of (h, 2) vertices, as the `bbox` of GeoJSON (RFC 7946, section 5.2).

    West is greater than east across the antimeridian. With a pole inside, from -180 to 180, and to the pole. Longitudes
    are exact; so are latitudes, but for an edge that reaches beyond its ends, where they are within 1e-12 degrees. NaN
    for no vertices. O(h).
    """
    if not len(vertices):
        return nan, nan, nan, nan
    closed = len(vertices) > 2
    positions = on_sheets(as_tuples(vertices), closed=closed)
    latitudes = np.concatenate([[each.lat for each in positions], _apexes(vertices if closed else vertices[:2])])
    south, north = float(latitudes.min()), float(latitudes.max())
    turns = positions[-1].sheet - positions[0].sheet if closed else 0
    if turns:
        pole = copysign(90.0, turns)
        return -180.0, min(south, pole), 180.0, max(north, pole)
    (low, west), *_, (high, east) = sorted((each.sheet, each.lon) for each in [*positions, positions[0]])
    return west, south, 180.0 if east == -180 and low < high else east, north


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


def _apexes(vertices: Points) -> Floats:
    """The latitudes of the northernmost or southernmost places that edges have between their ends."""
    start = unit_vectors(vertices)
    end = np.roll(start, -1, axis=0)
    normal = np.cross(start, end)
    apex = -normal[:, 2:] * normal
    level = np.hypot(normal[:, 0], normal[:, 1])
    apex[:, 2] = level**2  # towards the north
    between = (np.einsum("ij,ij->i", np.cross(start, apex), normal) > 0) & (
        np.einsum("ij,ij->i", np.cross(apex, end), normal) > 0
    )
    opposite = (np.einsum("ij,ij->i", np.cross(start, -apex), normal) > 0) & (
        np.einsum("ij,ij->i", np.cross(-apex, end), normal) > 0
    )
    latitude = np.degrees(np.arctan2(level, np.abs(normal[:, 2])))
    return np.concatenate([latitude[between], -latitude[opposite]])
