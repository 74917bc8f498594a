"""Locates of many points, which boxes inside and outside the hull answer, against the exact sides of its edges."""

from fractions import Fraction

import numpy as np
import pytest

from dynhull import DynamicHull

MANY = 12_000  # from 10,000 points on the boxes are laid
FEW = 100  # so few, asked of a hull that was asked nothing else, take the way through the tree

ANGLES = np.random.default_rng(7).random(3_000) * 2 * np.pi
CIRCLE = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
TINY = 5e-324
HULLS = {
    "circle": CIRCLE,
    "flat": CIRCLE * (1, 1e-12),
    "upright": CIRCLE * (1e-12, 1),
    "leaning": CIRCLE @ [[1, 1], [1, 1 + 1e-9]],
    "far away": CIRCLE + 1e9,
    "greatest": CIRCLE * 1.7e308,
    "least": np.round(CIRCLE * 900) * TINY,
    "grid": np.round(CIRCLE * 40),
    "square": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "triangle": [[0, 0], [3, 1], [1, 2]],
    "thin": [[0, 0], [1, 1e-300], [2, 0]],
    "segment": [[0, 0], [3, 1]],
    "point": [[2, 2]],
}


def asked(vertices: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Points in the box around the hull and outside it, close to its edges, and right above and below its vertices."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = np.where(high > low, high / 2 - low / 2, 1)
    edges = np.roll(vertices, -1, axis=0)
    rows = random.integers(len(vertices), size=MANY // 3)
    part = random.random((MANY // 3, 1))
    near = vertices[rows] * (1 - part) + edges[rows] * part
    up = np.nextafter(vertices[rows], random.choice([-np.inf, np.inf], size=(MANY // 3, 2)))
    with np.errstate(over="ignore"):
        around = low / 2 + high / 2 + (random.random((MANY, 2)) * 2.4 - 1.2) * size
    return np.clip(np.concatenate([around, near, near * (1, 1 + 1e-15), up, vertices]), -1.79e308, 1.79e308)


def exact_side(vertices: list[list[Fraction]], point: list[float]) -> int:
    x, y = map(Fraction, point)
    sides = [
        (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        for (ax, ay), (bx, by) in zip(vertices, vertices[1:] + vertices[:1], strict=True)
    ]
    return min((side > 0) - (side < 0) for side in sides)


@pytest.mark.parametrize("name", HULLS)
def test_many_points_at_once_are_located_as_one_by_one(name: str) -> None:
    hull = DynamicHull(HULLS[name])
    vertices = hull.vertices()
    points = asked(vertices, np.random.default_rng(len(name)))
    many = hull.locate(points)
    parts = [points[row : row + FEW] for row in range(0, len(points), FEW)]
    fresh = DynamicHull(HULLS[name])
    by_few = np.concatenate([fresh.copy().locate(part) for part in parts])
    np.testing.assert_array_equal(many, by_few)
    if len(vertices) > 2:
        rational = [[Fraction(value) for value in row] for row in vertices.tolist()]
        step = max(1, len(points) * len(vertices) // 5_000)
        for point, side in zip(points[::step].tolist(), many[::step].tolist(), strict=True):
            assert side == exact_side(rational, point), point


def test_points_that_are_not_finite_are_refused_among_many() -> None:
    hull = DynamicHull(CIRCLE)
    points = asked(hull.vertices(), np.random.default_rng(1))
    points[11_000, 1] = np.nan
    with pytest.raises(ValueError, match="11000"):
        hull.locate(points)
