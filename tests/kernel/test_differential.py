"""The kernel and the reference give the same answers after the same operations, to the last bit."""

from dataclasses import dataclass

import numpy as np
import oracle
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from inputs import cloud, point, points

from dynhull import DynamicHull, _kernel
from dynhull import _tree as tree


def rows(pairs, columns=2):
    return np.array(pairs, dtype=np.float64).reshape(len(pairs), columns) + 0.0


def outcome(action, *arguments):
    try:
        return action(*arguments)
    except KeyError as error:
        return error.args
    except (ValueError, TypeError) as error:
        return type(error)


@dataclass
class Both:
    """Two trees that run the same operations."""

    reference: tree.HullTree
    kernel: _kernel.HullTree

    def __call__(self, method, *arguments):
        expected = outcome(getattr(self.reference, method), *arguments)
        answer = outcome(getattr(self.kernel, method), *arguments)
        np.testing.assert_array_equal(answer, expected)
        assert type(answer) is type(expected)
        return answer

    def agree(self):
        assert len(self.kernel) == len(self.reference)
        assert self.kernel.distinct == self.reference.distinct
        assert self.kernel.changes == self.reference.changes
        for method in ("points", "vertices"):
            self(method)
        for side in (0, 1):
            self("chain", side)
        self.kernel.check()


class Twins(RuleBasedStateMachine):
    @initialize(pairs=points(100))
    def start(self, pairs):
        self.both = Both(tree.HullTree(rows(pairs)), _kernel.HullTree(rows(pairs)))

    def some_present(self, data, most):
        present = sorted(set(map(tuple, self.both.reference.points().tolist())))
        return data.draw(st.lists(st.sampled_from(present), max_size=most)) if present else []

    @rule(p=point)
    def insert(self, p):
        self.both("insert", *p)

    @rule(p=point)
    def delete(self, p):
        self.both("delete", *p)

    @rule(p=point)
    def count(self, p):
        self.both("count", *p)

    @rule(data=st.data())
    def delete_present(self, data):
        for p in self.some_present(data, 5):
            self.both("delete", *p)

    @rule(data=st.data(), new=points(40), ignore=st.booleans())
    def batch(self, data, new, ignore):
        old = self.some_present(data, 40)
        pairs = data.draw(st.permutations(new + old))
        ops = data.draw(st.lists(st.sampled_from([1, -1]), min_size=len(pairs), max_size=len(pairs)))
        self.both("apply", np.array(ops, np.int8), rows(pairs), ignore)

    @rule(new=points(150))
    def insert_many(self, new):
        self.both("apply", +1, rows(new), False)

    @rule()
    def delete_half(self):
        half = self.both.reference.points()[::2].copy()
        self.both("apply", -1, half, False)

    @rule(queries=points(30), repeat=st.sampled_from([1, 20]))
    def locate(self, queries, repeat):
        corners = self.both.reference.vertices().tolist()
        self.both("locate", np.tile(rows(queries + corners), (repeat, 1)))

    @rule(queries=points(10))
    def tangents_and_distance(self, queries):
        self.both("tangents", rows(queries))
        self.both("distance", rows(queries))

    @rule(starts=points(10), ends=points(10))
    def intersect_lines(self, starts, ends):
        lines = rows([(*p, *q) for p, q in zip(starts, ends, strict=False) if p != q], 4)
        self.both("intersect_lines", lines[:, :2].copy(), lines[:, 2:].copy())

    @rule(queries=points(10))
    def count_many(self, queries):
        self.both("count_many", rows(queries + self.both.reference.points()[::3].tolist()))

    @precondition(lambda self: len(self.both.reference))
    @rule(directions=points(10))
    def support(self, directions):
        vectors = rows(directions)
        self.both("support", np.ascontiguousarray(vectors[vectors.any(axis=1)]))

    @rule()
    def copy(self):
        self.both = Both(self.both.reference.copy(), self.both.kernel.copy())

    @rule()
    def clear(self):
        self.both("clear")

    @invariant()
    def same(self):
        if hasattr(self, "both"):
            self.both.agree()


TestTwins = Twins.TestCase
TestTwins.settings = settings(stateful_step_count=30)


@pytest.mark.parametrize("kind", ["uniform", "circle", "grid", "columns", "clusters"])
def test_a_window_that_moves(kind):
    """Leaves fill, split, empty and merge; batches of every size, from one row to more than there are points."""
    random = np.random.default_rng(7)
    # In a column all points are on one line: the reference needs exact arithmetic for every turn.
    share = 4 if kind == "columns" else 1
    window = cloud(kind, 3000 // share, random)
    both = Both(tree.HullTree(window), _kernel.HullTree(window))
    for size in (1, 5, 30, 200, 1500 // share, 40, 2500 // share, 6000 // share, 300):
        fresh = cloud(kind, size, random)
        old = window[:size]
        ops = np.concatenate([np.ones(len(fresh), np.int8), np.full(len(old), -1, np.int8)])
        order = random.permutation(len(ops))
        both("apply", ops[order], np.concatenate([fresh, old])[order], False)
        window = np.concatenate([window[size:], fresh])
        both.agree()
        both("locate", cloud(kind, 500, random))
    strip = window[np.argsort(window[:, 0])][: len(window) // 3]
    both("apply", -1, strip, True)
    both.agree()
    both("apply", +1, strip[:300], False)
    both.agree()
    both("apply", -1, window, True)
    both.agree()


@pytest.mark.parametrize("n", [6_000, 150_000])  # by one thread, by two
@pytest.mark.parametrize("kind", ["uniform", "grid", "columns", "clusters"])
def test_build_from_many_points(kind, n):
    rows = cloud(kind, n, np.random.default_rng(3))
    rows[rows == 0] = -0.0
    hull = DynamicHull(np.asfortranarray(rows))
    hull.check()
    expected = rows[np.lexsort(rows.T[::-1])] + 0.0
    assert hull.points().tobytes() == expected.tobytes()
    assert hull.distinct == len(np.unique(rows, axis=0))
    rows[n - 2, 1] = np.nan
    with pytest.raises(ValueError, match=rf"^points row {n - 2} is \(.*, nan\): coordinates must be finite$"):
        DynamicHull(rows)


@pytest.mark.parametrize("kind", ["uniform", "circle", "grid", "columns", "clusters"])
def test_locate_in_one_batch_or_many(kind):
    random = np.random.default_rng(5)
    hull = _kernel.HullTree(cloud(kind, 500, random))
    around = hull.vertices().mean(axis=0) + 1.2 * (cloud(kind, 15_000, random) - hull.vertices().mean(axis=0))
    queries = np.concatenate([around, hull.points(), hull.vertices()])
    parts = [hull.copy().locate(part) for part in np.array_split(queries, len(queries) // 100)]
    np.testing.assert_array_equal(hull.locate(queries), np.concatenate(parts))


@pytest.mark.every(4)
@pytest.mark.parametrize("scale", [1.0, 2.0**600, 1.7e308, 2.0**-600, 5e-321])
@pytest.mark.parametrize("kind", ["uniform", "circle", "grid", "columns", "clusters"])
def test_queries_around_a_hull(kind, scale):
    """Beyond all, on the boundary, and a few doubles beside it; hulls of many leaves."""
    random = np.random.default_rng(11)
    unit = cloud(kind, 2300, random)
    unit /= 4 * np.abs(unit).max()
    whole, around = scale * unit[:2000], scale * (2 * unit[2000:] - 0.25)
    both = Both(tree.HullTree(whole), _kernel.HullTree(whole))
    corners = both.reference.vertices()
    share = random.choice([0, 0.5, 1], (len(corners), 1))
    edges = corners * (1 - share) + np.roll(corners, -1, axis=0) * share
    near = [edges, np.nextafter(edges, np.inf), np.nextafter(edges, -np.inf)]
    asked = random.permutation(np.concatenate([*near, corners, around, whole[:50]]))[:400] + 0.0
    for method in ("locate", "tangents", "distance", "count_many"):
        both(method, asked)
    p = np.concatenate([asked, np.roll(corners, -1, axis=0)[:100]])
    q = np.concatenate([asked[::-1], corners[:100]])
    different = (p != q).any(axis=1)
    both("intersect_lines", p[different], q[different])


@given(a=point, b=point, c=point)
def test_orientation(a, b, c):
    assert _kernel.orientation(a, b, c) == oracle.turn(a, b, c)
    assert _kernel.orientations(rows([a]), rows([b]), rows([c])).tolist() == [oracle.turn(a, b, c)]


@given(d=point, a=point, b=point)
def test_direction_sign(d, a, b):
    difference = oracle.dot(d, b) - oracle.dot(d, a)
    assert _kernel.direction_sign(d, a, b) == (difference > 0) - (difference < 0)
