"""The plane of a projection beyond the reach of hulls: areas that end there, or are cut where it ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .static import convex_hull

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._globe import Gnomonic
    from .arrays import Points

    Vectors = npt.NDArray[np.float64]  # (k, 3): east, north and up, as seen from the centre

# The plane is cut so many radii of the globe from its centre, east and north: 88 degrees, and hulls reach 85.
PLANE_ENDS = 28.64


def project_far(frame: Gnomonic, lonlat: Points) -> Points:
    """The projections of (k, 2) places, those within reach as `Gnomonic.project` returns them. O(k).

    Returns:
        (k, 2) projections; NaN for places more than about 88 degrees from the centre.
    """
    xy, near = frame.project(lonlat)
    if not near.all():
        xy[~near] = _flat(frame.vectors(lonlat[~near]))
        xy[~(np.abs(xy) <= PLANE_ENDS).all(axis=1)] = np.nan
    return xy


def project_hull(frame: Gnomonic, vertices: Points) -> Points:
    """The hull of (h, 2) vertices in the plane, cut where this ends. O(h log h).

    What is within the reach of hulls is the hull there, but for rounding: an edge is off by nanometres where it was not
    made about the same centre, or leads out of reach.

    Args:
        frame: the projection.
        vertices: those of a hull about any centre, in order around it.

    Returns:
        (k, 2) vertices, as `dynhull.convex_hull` returns them; none if the hull is beyond the plane.
    """
    xy, near = frame.project(vertices)
    if not near.all():
        xy = _cut(frame.vectors(vertices), xy, near)
    return convex_hull(xy)


def _flat(vectors: Vectors) -> Points:
    """The projections of places above the horizon, NaN for others."""
    up = np.where(vectors[:, 2] > 0, vectors[:, 2], np.nan)
    flat: Points = vectors[:, :2] / up[:, None] + 0.0
    return flat


def _cut(vectors: Vectors, xy: Points, near: npt.NDArray[np.bool_]) -> Points:
    """The corners of what is left of a convex polygon within the square where the plane ends.

    Sutherland and Hodgman (1974), with vectors as homogeneous coordinates: each side of the square is a
    great circle, and so are the edges.
    """
    rows = np.arange(len(vectors))
    for axis in (0, 1):
        for sign in (1.0, -1.0):
            inner = PLANE_ENDS * vectors[:, 2] - sign * vectors[:, axis]
            following, next_inner = np.roll(vectors, -1, axis=0), np.roll(inner, -1)
            crosses = (inner >= 0) != (next_inner >= 0)
            share = np.divide(inner, inner - next_inner, out=np.zeros_like(inner), where=crosses)
            between = vectors + share[:, None] * (following - vectors)
            corners = np.stack([vectors, between], axis=1).reshape(-1, 3)
            numbers = np.stack([rows, np.full(len(rows), -1)], axis=1).ravel()
            kept = np.stack([inner >= 0, crosses], axis=1).ravel()
            vectors, rows = corners[kept], numbers[kept]
    found = _flat(vectors)
    own = np.flatnonzero(rows >= 0)
    own = own[near[rows[own]]]
    found[own] = xy[rows[own]]
    return found[~np.isnan(found).any(axis=1)]
