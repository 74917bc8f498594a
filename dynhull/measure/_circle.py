"""The smallest enclosing circle."""

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from math import lcm, nan

import numpy as np
import numpy.typing as npt

from .._exact import Exact, as_integers, exact, root, rounded
from .._predicates import UNDERFLOW, Point
from ..arrays import Points
from ._calipers import PRECISIONS, rounding


@dataclass(frozen=True)
class _Circle:
    centre: Exact
    squared_radius: Fraction

    def holds(self, p: Exact) -> bool:
        return (p[0] - self.centre[0]) ** 2 + (p[1] - self.centre[1]) ** 2 <= self.squared_radius


def min_circle(vertices: Points) -> tuple[tuple[float, float], float]:
    """Centre and radius of the smallest circle around the points: exact values, each rounded (radius: one ulp).

    NaN and 0.0 for no vertices. Gärtner, "Fast and robust smallest enclosing balls" (1999): while a point is outside,
    the farthest one joins the two or three that define the circle. O(h) a round, about ten rounds. Whether a point is
    outside is decided exactly.
    """
    if not len(vertices):
        return (nan, nan), 0.0
    held = [_corner(vertices, 0)]
    while True:
        circle, held = _around(held)
        far = _corner(vertices, _farthest(vertices, circle))
        if circle.holds(exact(far)):
            x, y = circle.centre
            return (rounded(x), rounded(y)), root(circle.squared_radius)
        held = [*held, far]


def _corner(vertices: Points, row: int) -> Point:
    x, y = vertices[row].tolist()
    return x, y


def _around(points: list[Point]) -> tuple[_Circle, list[Point]]:
    """The smallest circle around up to four points, and the points that define it."""
    corners = [exact(p) for p in points]
    candidates = [
        (circle, held)
        for count in (1, 2, 3)
        for held in combinations(range(len(points)), count)
        if (circle := _through([corners[i] for i in held])) and all(circle.holds(p) for p in corners)
    ]
    circle, held = min(candidates, key=lambda candidate: candidate[0].squared_radius)
    return circle, [points[i] for i in held]


def _through(points: list[Exact]) -> _Circle | None:
    """The smallest circle through one, two or three points; None for three on a line."""
    (ax, ay), (bx, by), (cx, cy) = points[0], points[-1], points[len(points) // 2]
    ux, uy, vx, vy = bx - ax, by - ay, cx - ax, cy - ay
    if len(points) < 3:
        x, y = ux / 2, uy / 2
    else:
        doubled = 2 * (ux * vy - uy * vx)
        if doubled == 0:
            return None
        u, v = ux * ux + uy * uy, vx * vx + vy * vy
        x, y = (vy * u - uy * v) / doubled, (ux * v - vx * u) / doubled
    return _Circle((ax + x, ay + y), x * x + y * y)


def _farthest(vertices: Points, circle: _Circle) -> int:
    """The index of the vertex farthest from the circle's centre. Integers decide what floats cannot."""
    shift = -int(np.frexp(np.abs(vertices).max())[1]) - 2
    scaled = np.ldexp(vertices, shift)
    centre = [value * Fraction(2) ** shift for value in circle.centre]
    near = np.arange(len(vertices))
    for precision in PRECISIONS:
        near = near[_perhaps_farthest(scaled[near].astype(precision), centre)]
    if len(near) == 1:
        return int(near[0])
    integers, unit = as_integers(vertices[near])
    cx, cy = (value / unit for value in circle.centre)
    divisor = lcm(cx.denominator, cy.denominator)
    dx, dy = (integers * divisor - [int(cx * divisor), int(cy * divisor)]).T
    distances = (dx * dx + dy * dy).tolist()
    return int(near[distances.index(max(distances))])


def _perhaps_farthest(points: npt.NDArray[np.floating], centre: list[Fraction]) -> npt.NDArray[np.bool_]:
    """The points that rounding errors do not rule out."""
    high = np.array([rounded(value) for value in centre])
    low = [rounded(value - Fraction(part)) for value, part in zip(centre, high.tolist(), strict=True)]
    x, y = high.astype(points.dtype) + low  # rounded: changes a distance relative to the size of the centre itself
    squares = (points[:, 0] - x) ** 2 + (points[:, 1] - y) ** 2
    error = rounding(points) * (squares + np.sqrt(squares) * (abs(x) + abs(y))) + UNDERFLOW
    possible: npt.NDArray[np.bool_] = squares + error >= (squares - error).max()
    return possible
