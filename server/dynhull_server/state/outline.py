"""Queries about the vertices of a geographic hull, in degrees and metres."""

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from dynhull import DynamicHull
from dynhull.arrays import Checked, Points, as_points
from dynhull.globe import Gnomonic, distance

from .numbers import as_numbers
from .records import Center

Array = npt.NDArray[np.float64]


class Outline(Protocol):
    """Answers queries that depend on the vertices alone: a hull of any kind of the library, or a GlobeOutline."""

    def __len__(self) -> int: ...

    def locate(self, xy: Any) -> npt.NDArray[np.int8]:
        """(k,) sides of (k, 2) points."""

    def support(self, directions: Any) -> Array:
        """(k, 2) extreme vertices in (k, 2) directions."""

    def tangents(self, xy: Any) -> Array:
        """(k, 2, 2) tangent points from (k, 2) points."""

    def distance(self, xy: Any) -> Array:
        """(k,) distances of (k, 2) points."""

    def intersect_lines(self, p: Any, q: Any) -> Array:
        """(k, 2, 2) where the lines through (k, 2) points p and q enter and leave."""


class GlobeOutline:
    """The vertices of a geographic hull, and the plane into which they are projected.

    Points are places in degrees; the frame has checked those that have to be within reach of the centre.

    Args:
        vertices: (h, 2) the vertices.
        center: the centre of the hull; None for a hull that has none so far.
    """

    def __init__(self, vertices: Points, center: Center | None) -> None:
        self._frame = None if center is None else Gnomonic(center)
        self._vertices = vertices
        places, _ = self._project(vertices)
        self._hull = DynamicHull(places)
        order = np.argsort(as_numbers(places))
        self._order, self._sorted = order, as_numbers(places)[order]

    def __len__(self) -> int:
        return len(self._vertices)

    def locate(self, lonlat: Checked | Points) -> npt.NDArray[np.int8]:
        """As `GeoHull.locate`."""
        places, near = self._project(as_points(lonlat))
        sides = np.full(len(places), -1, np.int8)
        sides[near] = self._hull.locate(places[near])
        return sides

    def support(self, directions: Checked | Points) -> Points:
        """The extreme vertex in each direction, east and north at the centre. There are vertices."""
        return self._given(self._hull.support(directions))

    def tangents(self, lonlat: Checked | Points) -> Array:
        """As `GeoHull.tangents`, for places within reach."""
        places, _ = self._project(as_points(lonlat))
        if not len(self):
            return np.full((len(places), 2, 2), np.nan)
        result = self._hull.tangents(places)
        outside = ~np.isnan(result[:, 0, 0])
        result[outside] = self._given(result[outside].reshape(-1, 2)).reshape(-1, 2, 2)
        return result

    def distance(self, lonlat: Checked | Points) -> Array:
        """As `GeoHull.distance`."""
        places = as_points(lonlat)
        result = np.zeros(len(places))
        outside = self.locate(places) < 0
        result[outside] = distance(self._vertices, places[outside])
        return result

    def intersect_lines(self, origins: Checked | Points, targets: Checked | Points) -> Array:
        """(k, 2, 2) where great circles enter and leave, from (k, 2) origins to targets within reach; NaN for a miss.

        Each target has another projection than its origin.
        """
        p, q = as_points(origins), as_points(targets)
        if self._frame is None or not len(self):
            return np.full((len(p), 2, 2), np.nan)
        crossings = self._hull.intersect_lines(self._frame.project(p)[0], self._frame.project(q)[0])
        hits = ~np.isnan(crossings[:, 0, 0])
        crossings[hits] = self._frame.unproject(crossings[hits].reshape(-1, 2)).reshape(-1, 2, 2)
        return crossings

    def _project(self, lonlat: Points) -> tuple[Points, npt.NDArray[np.bool_]]:
        if self._frame is None:
            return np.full(lonlat.shape, np.nan), np.zeros(len(lonlat), np.bool_)
        return self._frame.project(lonlat)

    def _given(self, places: Points) -> Points:
        """The vertices at some of their projections, all different."""
        return self._vertices[self._order[np.searchsorted(self._sorted, as_numbers(places))]]
