"""Inputs that break hull code which trusts rounded signs: named lists of points, few of them distinct."""

from itertools import product
from math import inf, nextafter

import numpy as np
from inputs import CIRCLE, EXTREME, ULP

Point = tuple[float, float]

# Kettner, Mehlhorn, Pion, Schirra, Yap, "Classroom examples of robustness problems in geometric computations" (2008).
PUBLISHED: dict[str, list[Point]] = {
    "A1: outside, sees no edge": [
        (7.3000000000000194, 7.3000000000000167),
        (24.000000000000068, 24.000000000000071),
        (24.00000000000005, 24.000000000000053),
        (0.50000000000001621, 0.50000000000001243),
        (8.0, 4.0),
        (4.0, 9.0),
        (15.0, 27.0),
        (25.0, 25.0),
        (19.0, 11.0),
    ],
    "A1, global": [
        (0.1, 0.1),
        (0.2, 0.20000000000000004),
        (0.79999999999999993, 0.80000000000000004),
        (1.267650600228229e30, 1.2676506002282291e30),
    ],
    "A2: inside, sees an edge": [
        (27.643564356435643, -21.881188118811881),
        (83.366336633663366, 15.544554455445542),
        (4.0, 4.0),
        (73.415841584158414, 8.8613861386138595),
    ],
    "A2, visible": [
        (24.00000000000005, 24.000000000000053),
        (24.0, 6.0),
        (54.85, 6.0),
        (54.850000000000357, 61.000000000000121),
        (24.000000000000068, 24.000000000000071),
        (6.0, 6.0),
    ],
    "B1: outside, sees every edge": [
        (200.0, 49.200000000000003),
        (100.0, 49.600000000000001),
        (-233.33333333333334, 50.93333333333333),
        (166.66666666666669, 49.333333333333336),
    ],
    "B2: outside, sees edges that do not adjoin": [
        (0.50000000000001243, 0.50000000000000189),
        (0.50000000000001243, 0.50000000000000333),
        (24.00000000000005, 24.000000000000053),
        (24.000000000000068, 24.000000000000071),
        (17.300000000000001, 17.300000000000001),
    ],
}


def neighbours(value: float) -> list[float]:
    """The double, the one below and the one above."""
    return [nextafter(value, -inf), value, nextafter(value, inf)]


def nearly_collinear(a: Point, b: Point, t: float) -> list[Point]:
    """Both ends of a segment, the doubles nearest to the point at parameter t, and those around them."""
    x, y = (p + t * (q - p) for p, q in zip(a, b, strict=True))
    return [a, b, *product(neighbours(x), neighbours(y))]


def _constructed() -> dict[str, list[Point]]:
    rng = np.random.default_rng(11)
    sets = {}
    for i in range(12):
        a, b = map(tuple, rng.uniform(-1, 1, (2, 2)).tolist())
        sets[f"nearly collinear {i}"] = nearly_collinear(a, b, rng.uniform(-0.5, 1.5))
    slope = [(0.1 * i, 0.1 * (3 * i)) for i in range(-30, 31)]
    steps = [0.5 + i * ULP for i in range(18)]
    subnormal = [i * 5e-324 for i in range(-3, 4)]
    huge = [-1.7e308, -1e308, 1e308, 1.7e308]
    thousands = rng.integers(0, 5, (3000, 2)) / 10
    return sets | {
        "perturbation grid": [*product(steps, steps), (12.0, 12.0), (24.0, 24.0)],
        "rounded multiples of one slope": slope,
        "rounded multiples, one off the line": [*slope, (0.0, 5e-324)],
        "signed zeros": [*product((0.0, -0.0, 1.0, -1.0), repeat=2), (-0.0, 0.0), (0.0, -0.0)],
        "subnormals": list(product(subnormal, subnormal)),
        "subnormals and ones": [*product(subnormal, (0.0, 1.0)), *product((0.0, 1.0), subnormal)],
        "the largest doubles": [*product(huge, huge), (0.0, 0.0), (5e-324, 1.7e308)],
        "largest, on one line": [(x, x) for x in (*huge, 1.0, 5e-324, 0.0)],
        "every magnitude": list(product(EXTREME[2:], EXTREME[2:])),
        "1 and 9e15": [(s * x, t * y) for x, y in product((1.0, 9e15), repeat=2) for s, t in product((1, -1), repeat=2)]
        + [(9e15 - i, 9e15 - i) for i in range(9)]
        + [(i / 8, 1.0 - i / 8) for i in range(9)],
        "1 on a line of 9e15": [(9e15 * i / 16, 3e15 * i / 16 + j) for i in range(-16, 17) for j in (0, 1)],
        "duplicates by the thousand": [tuple(p) for p in thousands.tolist()],
        "one point, 5000 times": [(0.1, 0.3)] * 5000,
        "two points, thousands of times": [(0.1, 0.3), (0.3, 0.1)] * 2500,
        "one vertical line": [(0.1, y / 10) for y in range(50)] * 3,
        "integer circle": CIRCLE * 2,
        "circle of rounded points": [
            tuple(p) for p in np.stack([np.cos(np.arange(150)), np.sin(np.arange(150))], axis=1).tolist()
        ],
    }


KILLERS: dict[str, list[Point]] = PUBLISHED | _constructed()
