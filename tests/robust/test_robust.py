"""Layers, depth, influence, the hull of the nearest points and sketches, against definitions in rational arithmetic."""

from fractions import Fraction
from math import floor, inf, nextafter
from threading import Event, Thread

import numpy as np
import oracle
import pytest
from cases import one_of
from hulls import HULLS, KEYED_HULLS
from hypothesis import example, given
from hypothesis import strategies as st
from inputs import CIRCLE, cloud, point, points, questions

from dynhull import DynamicHull, WindowHull

both = pytest.mark.parametrize("make", HULLS.values(), ids=HULLS.keys())
NESTED = [(x * r, y * r) for r in (1.0, 2.0, 3.0) for x, y in [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)]]


def tuples(array):
    return list(map(tuple, array.tolist()))


def peeled(rows):
    """Every layer, by definition."""
    rest = set(oracle.distinct(rows))
    while rest:
        layer = oracle.hull(rest)
        yield layer
        rest -= set(layer)


def area(corners):
    exact = list(map(oracle.exact, corners))
    return sum(px * qy - py * qx for (px, py), (qx, qy) in zip(exact, exact[1:] + exact[:1], strict=True)) / 2


def nearest_double(value):
    try:
        return float(value)
    except OverflowError:
        return inf


@both
@given(rows=points(30), k=st.integers(0, 6))
@example(rows=NESTED, k=9)
@example(rows=CIRCLE, k=2)
def test_layers(make, rows, k):
    hull = make(rows + rows[:3])
    before = hull.changes
    assert list(map(tuples, hull.layers(k))) == list(peeled(rows))[:k]
    assert (len(hull), hull.changes, tuples(hull.vertices())) == (len(rows) + len(rows[:3]), before, oracle.hull(rows))
    hull.check()


@both
@given(asked=questions(8), k=st.integers(0, 4))
@one_of(2)
def test_depth(make, asked, k):
    rows, queries = asked
    layers = list(peeled(rows))[:k]
    expected = [sum(oracle.locate(layer, q) >= 0 for layer in layers) for q in queries]
    assert make(rows).depth(np.reshape(queries, (-1, 2)), k).tolist() == expected


@both
@given(rows=points(25))
@example(rows=NESTED)
@example(rows=CIRCLE)
@example(rows=[(0.0, 0.0), (1.7e308, -1.7e308), (-1.7e308, -1.7e308)])
@example(rows=[(0.0, 0.0), (5e-324, 1.0), (5e-324, 0.0)])
def test_influence(make, rows):
    corners = oracle.hull(rows)
    expected = [
        nearest_double(area(corners) - area(oracle.hull(set(oracle.distinct(rows)) - {corner}))) for corner in corners
    ]
    assert make(rows + rows[:5]).influence().tolist() == expected


@both
@given(
    rows=points(25),
    percent=st.one_of(st.integers(0, 100), st.floats(1, 100)),
    center=st.sampled_from(["mean", "median"]),
)
@example(rows=NESTED, percent=34, center="mean")
@example(rows=[(0.0, 0.0), (0.0, 0.0), (1e16, 1.0)], percent=99.99, center="median")
def test_mcp(make, rows, percent, center):
    exact = sorted(map(oracle.exact, rows))

    def middle(values):
        ordered = sorted(values)
        half = len(ordered) // 2
        return sum(ordered) / len(ordered) if center == "mean" else (ordered[half] + ordered[~half]) / 2

    kept = []
    if rows:
        cx, cy = middle([x for x, _ in exact]), middle([y for _, y in exact])
        squares = [(Fraction(x) - cx) ** 2 + (Fraction(y) - cy) ** 2 for x, y in rows]
        most = sorted(squares)[floor((len(rows) - 1) * Fraction(percent) / 100)]
        kept = [p for p, square in zip(rows, squares, strict=True) if square <= most]
    assert tuples(make(rows).mcp(percent, center)) == oracle.hull(kept)


def squared_distance(corners, p):
    """From p to a convex polygon, a segment or a point."""
    if oracle.locate(corners, p) >= 0:
        return Fraction(0)
    least = None
    px, py = oracle.exact(p)
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        (ax, ay), (bx, by) = oracle.exact(a), oracle.exact(b)
        dx, dy = bx - ax, by - ay
        squared = dx * dx + dy * dy
        share = min(max(((px - ax) * dx + (py - ay) * dy) / squared, 0), 1) if squared else 0
        here = (px - ax - share * dx) ** 2 + (py - ay - share * dy) ** 2
        least = here if least is None else min(least, here)
    return least


@both
@given(rows=points(40), k=st.integers(1, 12))
@example(rows=CIRCLE, k=6)
@example(rows=CIRCLE, k=3)
@example(rows=[(0.0, 0.0), (10.0, -1.0), (0.5, -1.2), (1.0, 0.0)], k=2)
@example(rows=[(0.0, 0.0), (0.0, 1.0), (5e-324, 0.0)], k=3)
def test_sketch(make, rows, k):
    corners = oracle.hull(rows)
    found, error = make(rows).sketch(k)
    shown = tuples(found)
    assert shown == [corner for corner in corners if corner in shown]  # in the same order
    assert len(shown) == min(k, len(corners)) or (error == 0 and len(shown) <= k)
    worst = max((squared_distance(shown, p) for p in corners), default=Fraction(0))
    assert error == inf or Fraction(error) ** 2 >= worst
    assert error == 0 or Fraction(nextafter(error, 0)) ** 2 < worst


@both
def test_a_sketch_of_a_circle_improves_fourfold_with_twice_the_vertices(make):
    hull = make(cloud("circle", 3000, np.random.default_rng(5)))
    errors = [hull.sketch(k)[1] for k in (16, 32, 64)]
    assert 3 < errors[0] / errors[1] < 6
    assert 3 < errors[1] / errors[2] < 6


@pytest.mark.parametrize("make", KEYED_HULLS.values(), ids=KEYED_HULLS.keys())
def test_keyed_hulls_and_windows(make):
    rows = [p for p in NESTED for _ in range(2)]
    keyed = make()
    keyed.put_many([str(i) for i in range(len(rows))], rows)
    window = WindowHull(max_points=len(rows))
    window.add(rows, np.arange(len(rows)))
    plain = DynamicHull(rows)
    for hull in (keyed, window):
        assert list(map(tuples, hull.layers(9))) == list(peeled(rows))
        assert hull.influence().tolist() == plain.influence().tolist()
        assert hull.depth([[0, 0], [2, 0], [9, 9]], 3).tolist() == [3, 2, 0]
        assert tuples(hull.mcp(50)) == tuples(plain.mcp(50))
        assert tuples(hull.sketch(4)[0]) == tuples(plain.sketch(4)[0])


@pytest.mark.every(5)
@both
@pytest.mark.parametrize("kind", ["uniform", "grid", "columns", "clusters"])
def test_many_points(make, kind):
    rows = cloud(kind, 3000, np.random.default_rng(7))
    hull, rest = make(rows), make(rows)
    for layer in hull.layers(12):
        assert np.array_equal(layer, rest.vertices())
        for x, y in layer.tolist():
            rest.delete_many([[x, y]] * rest.count(x, y))
    others = []
    for x, y in hull.vertices().tolist():
        copies = hull.count(x, y)
        hull.delete_many([[x, y]] * copies)
        others.append(area(tuples(hull.vertices())))
        hull.insert_many([[x, y]] * copies)
    whole = area(tuples(hull.vertices()))
    assert hull.influence().tolist() == [nearest_double(whole - other) for other in others]


@both
def test_readers_go_on_while_layers_are_peeled(make):
    hull = make(cloud("uniform", 20_000 if "Kernel" in make.__name__ else 2000, np.random.default_rng(3)))
    expected, stop, wrong = hull.vertices(), Event(), []

    def read():
        while not stop.is_set():
            if not np.array_equal(hull.vertices(), expected):
                wrong.append("the hull changed")

    reader = Thread(target=read)
    reader.start()
    first = hull.layers(30)
    for _ in range(3):
        assert all(map(np.array_equal, hull.layers(30), first))
        hull.influence()
    stop.set()
    reader.join()
    assert not wrong


@both
def test_odd_arguments(make):
    hull = make([[0, 0], [1, 0], [0, 1]])
    for call, kind, words in (
        (lambda: hull.layers(-1), ValueError, "k is -1: must be at least 0"),
        (lambda: hull.layers(1.5), TypeError, "k must be an integer, got 1.5"),
        (lambda: hull.depth([[0, 0]], None), TypeError, "k must be an integer, got None"),
        (lambda: hull.depth([[0, np.nan]], 1), ValueError, "row 0"),
        (lambda: hull.sketch(0), ValueError, "k is 0: must be at least 1"),
        (lambda: hull.mcp(101), ValueError, "percent is 101.0: must be from 0 to 100"),
        (lambda: hull.mcp(float("nan")), ValueError, "percent is nan: must be from 0 to 100"),
        (lambda: hull.mcp(0.95), ValueError, r"percent is 0\.95, less than one percent: for a share of 0\.95 give 95"),
        (lambda: hull.mcp("95"), TypeError, "percent must be a real number, got '95'"),
        (lambda: hull.mcp(95, "mode"), ValueError, 'center must be "mean" or "median", got \'mode\''),
    ):
        with pytest.raises(kind, match=words):
            call()
    assert len(hull.layers(2**80)) == 1
    empty = make()
    assert (empty.layers(3), empty.influence().tolist(), empty.mcp(95).shape) == ([], [], (0, 2))
    assert (empty.depth([[0, 0]], 2).tolist(), empty.sketch(5)[0].shape, empty.sketch(1)[1]) == ([0], (0, 2), 0.0)


@both
@given(rows=st.lists(point, min_size=1, max_size=4), copies=st.integers(1, 3))
@one_of(3)
def test_copies_go_together(make, rows, copies):
    assert list(map(tuples, make(rows * copies).layers(5))) == list(peeled(rows))
