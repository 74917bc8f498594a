"""The extent of a hull: bounds, diameter, width."""

from fractions import Fraction
from math import nan

import numpy as np

from .._exact import Integers, root
from ..arrays import Points
from ._calipers import LEFT, edges, extremes, least, squared_height


def bounds(vertices: Points) -> tuple[float, float, float, float]:
    """Least x, least y, greatest x and greatest y. Exact; NaN for no vertices. O(h)."""
    if not len(vertices):
        return nan, nan, nan, nan
    (x0, y0), (x1, y1) = vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()
    return x0, y0, x1, y1


def diameter(vertices: Points) -> float:
    """The greatest distance of two vertices, the exact value within one unit in the last place; 0.0 for fewer than two.

    Rotating calipers: one of the two is farthest from an edge at the other, or next to that. O(h log h).
    """
    return root(squared_diameter(vertices))


def squared_diameter(vertices: Points) -> Fraction:
    """The exact square of the diameter. O(h log h)."""
    if len(vertices) < 2:
        return Fraction(0)
    a, b = edges(vertices)
    far = extremes(a, b, LEFT, vertices)
    after = (far + 1) % len(vertices)  # equally far if there is a parallel edge
    p, q = np.concatenate([a, b, a, b]), vertices[np.concatenate([far, far, after, after])]
    return -least(_negative_squared_length, p, q)[0]


def width(vertices: Points) -> float:
    """The least distance of two parallel lines with all points between, within one unit in the last place; 0.0 if flat.

    Houle and Toussaint, "Computing the width of a set" (1988): one of the lines passes through an edge. O(h log h).
    """
    return root(squared_width(vertices))


def squared_width(vertices: Points) -> Fraction:
    """The exact square of the width. O(h log h)."""
    if len(vertices) < 3:
        return Fraction(0)
    a, b = edges(vertices)
    return least(squared_height, a, b, vertices[extremes(a, b, LEFT, vertices)])[0]


def _negative_squared_length(p: Integers, q: Integers) -> tuple[Integers, Integers, Integers]:
    squares = ((q - p) ** 2).sum(axis=1)
    return -squares, squares * 0 + 1, squares
