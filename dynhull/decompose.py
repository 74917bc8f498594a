"""Concave polygons as unions of convex ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.ma  # np.unique needs it, and two threads cannot import it at its first call: python/cpython#149728
import numpy.typing as npt

from ._predicates import Point, dot_sign, orient2d, orientation
from .arrays import Points, as_points, as_tuples

if TYPE_CHECKING:
    from collections.abc import Sequence

Ring = list[int]


def convex_pieces(contour: npt.ArrayLike) -> list[Points]:
    """Cut a simple polygon into convex polygons without new corners, at most four times the least number. O(n²).

    Cuts off ears until nothing is left (Meisters, "Polygons have ears", 1975), then joins triangles while they stay
    convex (Hertel and Mehlhorn, "Fast triangulation of simple polygons", 1983). Every decision is exact.

    Args:
        contour: (n, 2) corners around the polygon, in either direction. Repeated corners, and corners on the line
            between their neighbours, are left out.

    Returns:
        (k, 2) corners of each piece, counter-clockwise. A polygon without area is one piece: a segment or a point.

    Raises:
        ValueError: the contour is empty, touches itself or crosses itself: the message names the edges.

    >>> from dynhull.decompose import convex_pieces
    >>> [piece.tolist() for piece in convex_pieces([[0, 0], [2, 0], [2, 2], [1, 1], [0, 2]])]
    [[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 2.0]]]
    """
    corners = _without_straight_corners(as_points(contour, "contour"))
    if not len(corners):
        raise ValueError("contour is empty: it needs at least one corner")
    if len(corners) < 3:
        return [corners]
    _check_simple(corners)
    lowest = int(np.lexsort(corners.T[::-1])[0])
    if orient2d(corners[lowest - 1], corners[lowest], corners[(lowest + 1) % len(corners)]) < 0:
        corners = corners[::-1].copy()
    triangles, diagonals = _triangulation(corners)
    return [corners[piece] for piece in _joined(as_tuples(corners), triangles, diagonals)]


def _without_straight_corners(contour: Points) -> Points:
    """The contour without repeated and straight corners; for a contour without area, its two ends."""
    ordered = np.unique(contour, axis=0)
    if not np.any(orient2d(ordered[:1], ordered[-1:], ordered)):
        return ordered[[0, -1]] if len(ordered) > 2 else ordered
    kept = as_tuples(contour[np.any(contour != np.roll(contour, 1, axis=0), axis=1)])
    while True:
        around = zip(kept[-1:] + kept[:-1], kept, kept[1:] + kept[:1], strict=True)
        bent = [q for p, q, r in around if orientation(p, q, r) or dot_sign(p, q, q, r) < 0]
        if len(bent) == len(kept):
            return np.array(kept)
        kept = bent


def _check_simple(corners: Points) -> None:
    """Raise ValueError if two edges touch that are not neighbours, or if an edge goes straight back."""
    count = len(corners)
    points = as_tuples(corners)
    ends = np.roll(corners, -1, axis=0)
    low, high = np.minimum(corners, ends), np.maximum(corners, ends)
    for i in range(count):
        p, q, r = points[i], points[(i + 1) % count], points[(i + 2) % count]
        if orientation(p, q, r) == 0 and dot_sign(p, q, q, r) < 0:
            raise ValueError(f"contour goes straight back at {_text(ends[i])}: it is not a simple polygon")
        others = np.arange(i + 2, count - (i == 0))
        near = np.all((low[others] <= high[i]) & (high[others] >= low[i]), axis=1)
        others = others[near]
        c, d = corners[others], ends[others]
        across = np.multiply(orient2d(corners[i], ends[i], c), orient2d(corners[i], ends[i], d)) <= 0
        across &= np.multiply(orient2d(c, d, corners[i]), orient2d(c, d, ends[i])) <= 0
        if across.any():
            j = int(others[across][0])
            edges = [f"from {_text(corners[k])} to {_text(ends[k])}" for k in (i, j)]
            raise ValueError(f"contour is not a simple polygon: its edges {edges[0]} and {edges[1]} meet")


def _text(point: Points) -> str:
    return str(tuple(point.tolist()))


def _triangulation(corners: Points) -> tuple[list[Ring], list[tuple[int, int]]]:
    """The triangles and the diagonals between them. A corner's being an ear changes only with its neighbours."""
    ring = list(range(len(corners)))
    ears = [_is_ear(corners, ring, i) for i in ring]
    triangles, diagonals = [], []
    while len(ring) > 3:
        place = ears.index(True)
        before, after = ring[place - 1], ring[(place + 1) % len(ring)]
        triangles.append([before, ring[place], after])
        diagonals.append((before, after))
        del ring[place], ears[place]
        for neighbour in ((place - 1) % len(ring), place % len(ring)):
            ears[neighbour] = _is_ear(corners, ring, neighbour)
    return [*triangles, ring], diagonals


def _is_ear(corners: Points, ring: Ring, place: int) -> bool:
    """Whether the triangle at a corner turns left and contains no other corner, boundary included."""
    a, b, c = (corners[ring[i % len(ring)]] for i in (place - 1, place, place + 1))
    if orient2d(a, b, c) <= 0:
        return False
    around = {ring[i % len(ring)] for i in (place - 1, place, place + 1)}
    others = corners[[i for i in ring if i not in around]]
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    near = others[np.all((low <= others) & (others <= high), axis=1)]
    within = [np.asarray(orient2d(p, q, near)) >= 0 for p, q in ((a, b), (b, c), (c, a))]
    return not np.any(within[0] & within[1] & within[2])


def _joined(points: Sequence[Point], triangles: list[Ring], diagonals: list[tuple[int, int]]) -> list[Ring]:
    """Join the pieces on both sides of each diagonal if the result is convex at both its ends."""
    owner = {edge: ring for ring in triangles for edge in _edges(ring)}
    for a, b in diagonals:
        one, other = _from(owner[a, b], b), _from(owner[b, a], a)
        # one: b ... a, other: a ... b
        joined = [*one, *other[1:-1]]
        at_a, at_b = (one[-2], a, other[1]), (other[-2], b, one[1])
        if all(orientation(points[p], points[q], points[r]) >= 0 for p, q, r in (at_a, at_b)):
            owner.update(dict.fromkeys(_edges(joined), joined))
            del owner[a, b], owner[b, a]
    pieces = {id(ring): ring for ring in owner.values()}.values()
    return [_without_straight(points, ring) for ring in pieces]


def _without_straight(points: Sequence[Point], ring: Ring) -> Ring:
    around = zip(ring[-1:] + ring[:-1], ring, ring[1:] + ring[:1], strict=True)
    return [q for p, q, r in around if orientation(points[p], points[q], points[r])]


def _edges(ring: Ring) -> list[tuple[int, int]]:
    return [(ring[i - 1], ring[i]) for i in range(len(ring))]


def _from(ring: Ring, first: int) -> Ring:
    """The ring rotated to begin at a corner."""
    place = ring.index(first)
    return ring[place:] + ring[:place]
