"""Points that hull code gets wrong, as hypothesis strategies."""

from math import copysign, inf, nextafter

import numpy as np
from hypothesis import strategies as st
from oracle import hull

ULP = 2.0**-53
# Integer points on the circle of radius sqrt(5525): all of them vertices, exactly.
CIRCLE = [(float(x), float(y)) for x in range(-75, 76) for y in range(-75, 76) if x * x + y * y == 5525]

EXTREME = [0.0, -0.0, 1.0, 3.0, 9e15, 5e-324, 1e-323, 2.2250738585072014e-308, 1e-200, 1e-160, 1e160, 1.7e308]

grid = st.integers(0, 3).map(float)
ulps = st.integers(-4, 4).map(lambda i: 0.5 + i * ULP)
extremes = st.sampled_from(EXTREME + [-value for value in EXTREME])
finite = st.floats(allow_nan=False, allow_infinity=False)
coordinates = {"grid": grid, "ulps": ulps, "extremes": extremes, "finite": finite}

line = st.integers(-5, 5).map(lambda i: (i * 0.1, i * 0.3))
point = st.one_of(
    *(st.tuples(coordinate, coordinate) for coordinate in coordinates.values()),
    st.sampled_from(CIRCLE),
    line,
)


def points(max_size: int) -> st.SearchStrategy[list[tuple[float, float]]]:
    """Lists of points, of one kind or mixed."""
    kinds = [st.tuples(coordinate, coordinate) for coordinate in coordinates.values()]
    kinds += [st.sampled_from(CIRCLE), line, point]
    return st.one_of(*(st.lists(kind, max_size=max_size) for kind in kinds))


grid_points = st.lists(st.tuples(*[st.integers(-6, 6).map(float)] * 2), min_size=1, max_size=12)
any_points = st.one_of(grid_points, points(12).filter(len), st.lists(st.sampled_from(CIRCLE), min_size=1, max_size=9))


@st.composite
def questions(draw, max_size: int):
    """Points of a hull, and query points: arbitrary ones, and ones that touch the hull or nearly do."""
    rows = draw(any_points)
    corners = hull(rows)
    asked = draw(points(max_size))
    for _ in range(draw(st.integers(0, max_size))):
        i = draw(st.integers(0, len(corners) - 1))
        share = draw(st.sampled_from([0.0, 0.5, 1 / 3, 1.0, -1.0, 2.0]))
        ends = zip(corners[i - 1], corners[i], strict=True)
        steps = draw(st.tuples(*[st.integers(-2, 2)] * 2))
        on_edge = [a * (1 - share) + b * share for a, b in ends]
        p = [moved(x, step) for x, step in zip(on_edge, steps, strict=True)]
        if np.isfinite(p).all():
            asked.append((p[0], p[1]))
    return rows, draw(st.permutations(asked))


def moved(x: float, steps: int) -> float:
    """The double `steps` doubles above x, or below it where negative."""
    for _ in range(abs(steps)):
        x = nextafter(x, copysign(inf, steps))
    return x


@st.composite
def stars(draw):
    """Simple polygons around the origin, their corners on rays of the integer grid in order of angle."""
    rays = [(8, 1), (5, 4), (1, 6), (-3, 7), (-6, 2), (-7, -5), (-1, -8), (4, -7), (6, -1)]
    lengths = draw(st.lists(st.integers(1, 9), min_size=len(rays), max_size=len(rays)))
    return [(x * length, y * length) for (x, y), length in zip(rays, lengths, strict=True)]


def cloud(kind, count, random):
    """Many points of one kind: (count, 2), from a numpy generator."""
    if kind == "uniform":
        return random.random((count, 2))
    if kind == "circle":
        angle = random.random(count) * 2 * np.pi
        return np.column_stack([np.cos(angle), np.sin(angle)])
    if kind == "grid":
        return random.integers(0, 40, (count, 2)).astype(float)
    if kind == "columns":
        return np.column_stack([random.integers(0, 3, count).astype(float), random.random(count)])
    clusters = np.exp2(random.integers(-60, 60, count).astype(float))
    return np.column_stack([clusters * random.random(count), clusters])
