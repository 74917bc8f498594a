"""How far a hull reaches beyond a few of its vertices."""

from fractions import Fraction
from math import inf, nextafter

import numpy as np
import numpy.typing as npt

from .._areas import squared_distance
from .._exact import doubled_triangle, root, squared_length
from .._predicates import Point
from ..arrays import Points, as_tuples

SLACK = 2.0**-40  # relative to the sizes of the coordinates: far above all rounding errors


def sketch_error(beyond: Points) -> float:
    """The greatest distance of a vertex from its edge, rounded up; 0.0 without vertices.

    Args:
        beyond: (3 k, 2), for each vertex the edge's ends and the vertex, which is nearest to a point between them.
    """
    rows = as_tuples(beyond)
    squares = (
        doubled_triangle(a, b, p) ** 2 / squared_length(a, b)
        for a, b, p in zip(rows[::3], rows[1::3], rows[2::3], strict=True)
    )
    return _root_up(max(squares, default=Fraction(0)))


def few_vertices(vertices: Points, count: int) -> tuple[Points, float]:
    """One to three of the vertices, and the greatest distance of a vertex from their hull, rounded up. O(h).

    The first, the one farthest from it, and the one farthest from both.
    """
    chosen = [0]
    while True:
        distances = _distances(vertices, vertices[chosen])
        if len(chosen) == min(count, len(vertices)):
            break
        distances[chosen] = -1.0  # others may be so near that theirs round to 0
        chosen = sorted([*chosen, int(distances.argmax())])
    corners = as_tuples(vertices[chosen])
    farthest = vertices[distances >= distances.max() - SLACK]
    error = max(_squared_distance(corners, p) for p in as_tuples(farthest))
    return vertices[chosen], _root_up(error)


def _distances(vertices: Points, corners: Points) -> npt.NDArray[np.float64]:
    """Distances from the hull of up to three corners, times a power of two, with errors far below SLACK."""
    scale = -int(np.frexp(np.abs(vertices).max())[1]) - 1
    p, ends = np.ldexp(vertices, scale), np.ldexp(corners, scale)
    nearest = np.full(len(p), inf)
    for a, b in zip(ends, np.roll(ends, -1, axis=0), strict=True):
        along = b - a
        squared = along @ along
        share = np.clip((p - a) @ along / squared, 0, 1) if squared > 0 else np.zeros(len(p))
        nearest = np.minimum(nearest, np.hypot(*(p - a - share[:, None] * along).T))
    return nearest


def _squared_distance(corners: list[Point], p: Point) -> Fraction:
    """The squared distance of a vertex from the hull of others: from the nearest of their edges."""
    return min(squared_distance(p, a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))


def _root_up(value: Fraction) -> float:
    """The least double not below the square root."""
    nearest = root(value)
    return nextafter(nearest, inf) if nearest < inf and Fraction(nearest) ** 2 < value else nearest
