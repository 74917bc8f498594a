"""Smallest boxes in any direction, which have a side on an edge."""

from dataclasses import dataclass
from fractions import Fraction
from math import nan
from typing import Self

import numpy as np

from .._exact import Exact, Integers, doubled_triangle, exact, rounded
from .._predicates import Point
from ..arrays import Points
from ._calipers import AHEAD, BEHIND, LEFT, Formula, edges, extremes, least


def min_box(vertices: Points) -> Points:
    """(4, 2) corners of the box of least area around the points, counter-clockwise, each coordinate rounded once.

    Freeman and Shapira, "Determining the minimum-area encasing rectangle for an arbitrary closed curve" (1975).
    O(h log h). A flat hull's box is flat; NaN for no vertices.
    """
    return _best_box(vertices, _area)


def min_perimeter_box(vertices: Points) -> Points:
    """(4, 2) corners of the box of least perimeter around the points, like `min_box`. O(h log h)."""
    return _best_box(vertices, _squared_half_perimeter)


def _best_box(vertices: Points, formula: Formula) -> Points:
    if len(vertices) < 3:
        ends = vertices if len(vertices) else np.full((1, 2), nan)
        return np.asarray(ends[[0, -1, -1, 0]], dtype=np.float64)
    a, b = edges(vertices)
    front, far, back = (vertices[extremes(a, b, turn, vertices)] for turn in (AHEAD, LEFT, BEHIND))
    _, row = least(formula, a, b, front, far, back)
    on_edge = ((x, y) for x, y in (corner[row].tolist() for corner in (a, b, front, far, back)))
    return np.array(_Box.on_edge(*on_edge).corners())


def _sides(
    a: Integers, b: Integers, front: Integers, far: Integers, back: Integers
) -> tuple[Integers, Integers, Integers, Integers, Integers]:
    """Length and height times the edge's length, with the sizes of their terms, and the edge's length squared."""
    (ux, uy), (vx, vy), (wx, wy) = (b - a).T, (front - back).T, (far - a).T
    along, height = ux * vx + uy * vy, ux * wy - uy * wx
    return along, abs(ux * vx) + abs(uy * vy), height, abs(ux * wy) + abs(uy * wx), ux * ux + uy * uy


def _area(*corners: Integers) -> tuple[Integers, Integers, Integers]:
    along, along_size, height, height_size, squared = _sides(*corners)
    return along * height, squared, along_size * height_size


def _squared_half_perimeter(*corners: Integers) -> tuple[Integers, Integers, Integers]:
    along, along_size, height, height_size, squared = _sides(*corners)
    return (along + height) ** 2, squared, (along_size + height_size) ** 2


@dataclass
class _Box:
    """A box along an edge, in multiples of the edge's vector: its begin and end along the edge, and its height."""

    corner: Exact
    vector: Exact
    begin: Fraction
    end: Fraction
    height: Fraction

    @classmethod
    def on_edge(cls, a: Point, b: Point, front: Point, far: Point, back: Point) -> Self:
        (ax, ay), (bx, by) = exact(a), exact(b)
        ux, uy = bx - ax, by - ay
        squared = ux * ux + uy * uy
        begin, end = (((x - ax) * ux + (y - ay) * uy) / squared for x, y in map(exact, (back, front)))
        return cls((ax, ay), (ux, uy), begin, end, doubled_triangle(a, b, far) / squared)

    def corners(self) -> list[Point]:
        (x, y), (ux, uy) = self.corner, self.vector
        places = (self.begin, 0), (self.end, 0), (self.end, self.height), (self.begin, self.height)
        return [(rounded(x + s * ux - t * uy), rounded(y + s * uy + t * ux)) for s, t in places]
