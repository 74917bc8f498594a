"""Layers, depth, influence and the nearest points of a hull on the globe.

In the gnomonic projection these are those of the plane, and exact for the projections; areas are of the ellipsoid.
"""

from __future__ import annotations

from fractions import Fraction
from math import floor
from typing import TYPE_CHECKING

import numpy as np

from . import _ellipsoid, robust
from ._globe import Gnomonic
from ._hull import DynamicHull
from ._predicates import orient2d
from .static import convex_hull

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._predicates import Floats
    from .arrays import Points


class Peeled:
    """The outermost layers of places, as places and in the projection.

    Args:
        pairs: (n, 2) places in lexicographic order, all of them within reach of the centre.
        frame: the projection.
        k: the number of layers.

    Attributes:
        layers: (h, 2) places of each layer, counter-clockwise from the least; of several at one place, the least.
        projected: (h, 2) their projections.
    """

    def __init__(self, pairs: Points, frame: Gnomonic, k: int) -> None:
        places, first = np.unique(frame.project(pairs)[0], axis=0, return_index=True)
        numbers = _as_numbers(places)
        self.layers: list[Points] = []
        self.projected: list[Points] = []
        for layer in DynamicHull(places).layers(k):
            named = pairs[first[np.searchsorted(numbers, _as_numbers(layer))]]
            start = int(np.lexsort(named.T[::-1])[0])
            self.layers.append(np.roll(named, -start, axis=0))
            self.projected.append(np.roll(layer, -start, axis=0))


def depth(peeled: Peeled, frame: Gnomonic, lonlat: Points) -> npt.NDArray[np.int64]:
    """How many of the layers' hulls hold each of (m, 2) places; 0 for those beyond reach."""
    places, near = frame.project(lonlat)
    depths = np.zeros(len(lonlat), np.int64)
    depths[near] = robust.depth(peeled.projected, places[near])
    return depths


def influence(peeled: Peeled) -> Floats:
    """The square metres that the hull loses with each of its h vertices, of two layers. O(h) each.

    Without a vertex, the hull has new vertices only out of the second layer, beyond the line between its neighbours.
    """
    if not peeled.layers or len(peeled.layers[0]) < 3:
        return np.zeros(len(peeled.layers[0]) if peeled.layers else 0)
    pairs, places = peeled.layers[0], peeled.projected[0]
    inner, inner_places = (of[1] if len(of) > 1 else of[0][:0] for of in (peeled.layers, peeled.projected))
    lost = np.zeros(len(pairs))
    for i in range(len(pairs)):
        ends = np.array([places[i - 1], places[(i + 1) % len(pairs)]])
        beyond = np.flatnonzero(orient2d(ends[0], ends[1], inner_places) < 0)
        chain = _chain(ends, inner_places[beyond])
        new = inner[beyond[chain]]
        lost[i] = _ellipsoid.area(np.concatenate([pairs[[i - 1, i, (i + 1) % len(pairs)]], new[::-1]]))
    return lost


def nearest(lonlat: Points, percent: float) -> Points:
    """The places nearest to the mean direction of all, as `robust.nearest_points` chooses them. O(n).

    Angles are rounded, to a nanometre or so on the ground.
    """
    angles = Gnomonic.about(lonlat).angles(lonlat)
    rank = floor((len(lonlat) - 1) * Fraction(percent) / 100)
    chosen: Points = lonlat[angles <= np.partition(angles, rank)[rank]]
    return chosen


def _chain(ends: Points, beyond: Points) -> npt.NDArray[np.intp]:
    """The rows of `beyond` on the hull, from the first end to the second; all are to the right of these."""
    if not len(beyond):
        return np.empty(0, np.intp)
    ring = convex_hull(np.concatenate([ends, beyond]))
    start = int(np.flatnonzero((ring == ends[0]).all(axis=1))[0])
    chain = np.roll(ring, -start, axis=0)[1:-1]
    order = np.argsort(_as_numbers(beyond))
    return order[np.searchsorted(_as_numbers(beyond), _as_numbers(chain), sorter=order)]


def _as_numbers(points: Points) -> npt.NDArray[np.complex128]:
    """One complex number a point: numpy sorts only scalars."""
    return np.ascontiguousarray(points).view(np.complex128).ravel()
