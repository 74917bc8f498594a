"""The one-shot hull: every way to it against rational arithmetic, large inputs against the plain chain."""

import threading
from functools import cache

import numpy as np
import oracle
import pytest
from hulls import ONE_SHOT
from hypothesis import example, given
from inputs import CIRCLE, points

from dynhull import KERNEL, DynamicHull, convex_hull, static

# Large enough for the filter, and for two threads, to come by themselves; Python alone has neither.
LARGE, HUGE = (15_000, 500_000) if KERNEL == "cpp" else (2_000, 5_000)

every = pytest.mark.parametrize("hull_of", ONE_SHOT.values(), ids=ONE_SHOT.keys())


def tuples(array):
    return list(map(tuple, array.tolist()))


@every
@given(rows=points(80))
@example(rows=CIRCLE)
@example(rows=[])
@example(rows=[(1.0, 2.0)] * 2)
@example(rows=[(-0.0, -0.0), (0.0, 0.0)])
@example(rows=[(2.0, float(y)) for y in range(60)])
@example(rows=[(x * 1.7e308, y * 1.7e308) for x in (-1, 0, 1) for y in (-1, 0, 1)])
def test_hull(hull_of, rows):
    vertices = hull_of(rows)
    assert tuples(vertices) == tuples(static.monotone_chain(rows)) == tuples(DynamicHull(rows).vertices())
    assert tuples(vertices) == oracle.hull(rows)
    assert not (np.signbit(vertices) & (vertices == 0)).any()


def in_disk(random, n):
    angle, radius = 2 * np.pi * random.random(n), np.sqrt(random.random(n))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def on_circle(random, n):
    angle = 2 * np.pi * random.random(n)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def lexicographic(xy):
    return xy[np.lexsort(xy.T[::-1])]


CLOUDS = {
    "uniform": lambda random, n: random.random((n, 2)),
    "disk": in_disk,
    "gaussian": lambda random, n: random.standard_normal((n, 2)),
    "heavy tails": lambda random, n: random.standard_cauchy((n, 2)),
    "circle": on_circle,
    "sorted": lambda random, n: lexicographic(random.random((n, 2))),
    "sorted circle, backwards": lambda random, n: lexicographic(on_circle(random, n))[::-1],
    "grid": lambda random, n: random.integers(0, 300, (n, 2)).astype(float),
    "two columns": lambda random, n: np.stack([random.integers(0, 2, n), random.random(n)], axis=1),
    "one column": lambda random, n: np.stack([np.full(n, 0.1), random.random(n)], axis=1),
    "one line": lambda random, n: random.random((n, 1)) * [0.1, 0.3],
    "clusters": lambda random, n: random.random((20, 2))[random.integers(0, 20, n)] + 1e-9 * random.random((n, 2)),
    "narrow": lambda random, n: [5, 0] + [1e-12, 1] * random.random((n, 2)),
    "powers of two": lambda random, n: np.exp2(random.uniform(-1000, 1000, (n, 2))) * random.choice([-1, 1], (n, 2)),
    "huge": lambda random, n: 1.7e308 * (2 * random.random((n, 2)) - 1),
    "subnormal": lambda random, n: 5e-324 * random.integers(-1000, 1000, (n, 2)),
    "a dense half": lambda random, n: np.concatenate(
        [random.random((n // 2, 2)), 1e-6 * random.random((n - n // 2, 2))]
    ),
    "a vertex seen late": lambda random, n: np.concatenate([random.random((n - 1, 2)), [[0.5, 1.5]]]),
}


def points_of(cloud):
    return CLOUDS[cloud](np.random.default_rng(17), LARGE)


@cache
def plain_chain(cloud):
    return tuples(static.monotone_chain(points_of(cloud)))


@pytest.mark.every(4)
@every
@pytest.mark.parametrize("cloud", CLOUDS)
def test_large(hull_of, cloud):
    assert tuples(hull_of(points_of(cloud))) == plain_chain(cloud)


@pytest.mark.parametrize("cloud", CLOUDS)
def test_large_by_chan(cloud):
    assert tuples(static.chan(points_of(cloud))) == plain_chain(cloud)


@pytest.mark.parametrize("cloud", ["uniform", "gaussian", "circle", "grid", "clusters"])
def test_huge(cloud):
    n = HUGE if cloud != "circle" else HUGE // 5  # all of them are vertices
    xy = CLOUDS[cloud](np.random.default_rng(18), n)
    before = xy.copy()
    vertices = convex_hull(xy)
    assert tuples(vertices) == tuples(static.chan(xy)) == tuples(DynamicHull(xy).vertices())
    np.testing.assert_array_equal(xy, before)


@every
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("n", [1, 2, 1000, LARGE])
def test_the_first_row_that_is_not_finite_is_named(hull_of, bad, n):
    xy = np.random.default_rng(3).random((n, 2))
    xy[n // 3, 1] = xy[n - 1, 0] = bad
    with pytest.raises(ValueError, match=rf"points row {n // 3} is \(.*\): coordinates must be finite"):
        hull_of(xy)


def test_any_layout():
    square = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4], [2, 2]])
    corners = square[:4].tolist()
    packed = np.zeros(5, np.dtype([("flag", "i1"), ("xy", "f8", 2)]))  # its doubles stand on odd addresses
    packed["xy"] = square
    read_only = square.copy()
    read_only.setflags(write=False)
    for xy in (
        square.tolist(),
        square.astype(int),
        square.astype(np.float32),
        square.astype(">f8"),
        np.asfortranarray(square),
        square[::-1],
        np.repeat(square, 2, axis=0)[::2],
        packed["xy"],
        np.frombuffer(b"-" + square.tobytes(), np.uint8)[1:].view(np.float64).reshape(5, 2),
        read_only,
        iter(square.tolist()),
    ):
        assert convex_hull(xy).tolist() == corners
    assert convex_hull(np.empty((0, 2))).shape == convex_hull([]).shape == (0, 2)


@every
def test_the_result_is_independent_of_the_input(hull_of):
    xy = np.array([[0.0, 0], [1, 0], [0, 1]])
    vertices = hull_of(xy)
    xy[:] = 7
    assert vertices.tolist() == [[0, 0], [1, 0], [0, 1]]
    vertices[:] = 8
    assert xy.tolist() == [[7, 7]] * 3


def test_points_that_change_meanwhile_do_no_harm():
    """The hull is then of no particular state, but it is an array of finite points."""
    random = np.random.default_rng(4)
    xy = on_circle(random, HUGE // 5)
    done = threading.Event()

    def disturb():
        while not done.is_set():
            xy[random.integers(0, len(xy), 1000)] = random.uniform(-1e300, 1e300, (1000, 2))

    thread = threading.Thread(target=disturb)
    thread.start()
    try:
        for _ in range(20):
            assert np.isfinite(convex_hull(xy)).all()
    finally:
        done.set()
        thread.join()
