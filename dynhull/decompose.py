"""Concave polygons as unions of convex ones."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from .arrays import Points, as_points
from .predicates import Point, dot_sign, orient2d, orientation

Ring = list[int]


def convex_pieces(contour: npt.ArrayLike) -> list[Points]:
    """Cut a simple polygon into convex polygons without new corners, at most four times as many as need be. O(n²).

    Ears are cut off until nothing is left (Meisters, "Polygons have ears", 1975), then triangles are joined as long as
    they stay convex (Hertel and Mehlhorn, "Fast triangulation of simple polygons", 1983). Every decision is exact.

    Args:
        contour: (n, 2) corners around the polygon, either way. Corners that lie straight between their neighbours and
            repeated ones are left out.

    Returns:
        (k, 2) corners of each piece, counter-clockwise. A polygon without area is one piece: a segment or a point.

    Raises:
        ValueError: the contour is empty, touches itself or crosses itself: the message names the edges.

    >>> [piece.tolist() for piece in convex_pieces([[0, 0], [2, 0], [2, 2], [1, 1], [0, 2]])]
    [[[0.0, 0.0], [1.0, 1.0], [0.0, 2.0]], [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 1.0]]]
    """
    corners = _without_straight_corners(as_points(contour, "contour"))
    if not len(corners):
        raise ValueError("contour is empty: no polygon")
    if len(corners) < 3:
        return [corners]
    _check_simple(corners)
    lowest = int(np.lexsort(corners.T[::-1])[0])
    if orient2d(corners[lowest - 1], corners[lowest], corners[(lowest + 1) % len(corners)]) < 0:
        corners = corners[::-1].copy()
    points = [(x, y) for x, y in corners.tolist()]
    return [corners[piece] for piece in _joined(points, _ears(points, corners))]


def _without_straight_corners(contour: Points) -> Points:
    """Neither repeated corners, nor such as are passed straight on. Of a contour without area, its two ends."""
    if not len(contour) or not np.any(orient2d(contour.min(axis=0), contour, contour)) and len(np.unique(contour, axis=0)) < 3:
        return np.unique(contour, axis=0)
    ordered = np.unique(contour, axis=0)
    if not np.any(orient2d(ordered[0], ordered[-1], ordered)):
        return ordered[[0, -1]]
    kept = [tuple(row) for row in contour[np.any(contour != np.roll(contour, 1, axis=0), axis=1)].tolist()]
    straight = True
    while straight:
        before, after = kept[-1:] + kept[:-1], kept[1:] + kept[:1]
        turns = zip(before, kept, after, strict=True)
        bent = [q for p, q, r in turns if orientation(p, q, r) or dot_sign(p, q, q, r) < 0]
        straight, kept = len(bent) < len(kept), bent
    return np.array(kept)
