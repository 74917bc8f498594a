"""DynamicHull against definitions in rational arithmetic."""

import copy
import pickle
from collections import Counter
from fractions import Fraction

import numpy as np
import oracle
import pytest
from hulls import HULLS
from hypothesis import example, given
from hypothesis import strategies as st
from inputs import CIRCLE, point, points

EXAMPLE = [[0, 0], [4, 0], [5, 2], [4, 4], [2, 3], [0, 4], [1, 2], [2, 1]]
CORNERS = [[0, 0], [4, 0], [5, 2], [4, 4], [0, 4]]

both = pytest.mark.parametrize("make", HULLS.values(), ids=HULLS.keys())


def tuples(array):
    return list(map(tuple, array.tolist()))


def build(make, rows, how):
    """The same points by three ways."""
    if how == "bulk":
        return make(rows) if rows else make()
    hull = make()
    for x, y in rows:
        hull.insert(x, y)
    if how == "twice, half deleted":
        for x, y in rows:
            hull.insert(x, y)
        for x, y in rows[::-1]:
            hull.delete(x, y)
    return hull


@both
@pytest.mark.parametrize("how", ["bulk", "one by one", "twice, half deleted"])
@given(rows=points(40))
@example(rows=[])
@example(rows=[(1.0, 1.0)] * 3)
@example(rows=CIRCLE)
@example(rows=[(0.0, float(y)) for y in range(9)] + [(1.0, float(y)) for y in range(9)])
def test_vertices(make, how, rows):
    hull = build(make, rows, how)
    hull.check()
    corners = oracle.hull(rows)
    assert tuples(hull.vertices()) == corners
    assert hull.vertices().shape == (len(corners), 2)
    assert tuples(hull.points()) == sorted((x + 0.0, y + 0.0) for x, y in rows)
    assert len(hull) == len(rows)
    assert hull.distinct == len(oracle.distinct(rows))
    if corners:
        turning = corners.index(max(corners))
        assert tuples(hull.lower()) == corners[: turning + 1]
        assert tuples(hull.upper()) == ([corners[0], *corners[turning:][::-1]] if turning else corners)


@both
@given(rows=points(30), queries=st.lists(point, max_size=10))
def test_locate(make, rows, queries):
    hull = make(rows)
    queries = queries + rows[:5]
    corners = oracle.hull(rows)
    expected = [oracle.locate(corners, q) for q in queries]
    assert hull.locate(queries).tolist() == expected
    assert hull.locate(queries).dtype == np.int8
    assert hull.contains(queries).tolist() == [where >= 0 for where in expected]


@both
@given(rows=points(30).filter(bool), directions=st.lists(point.filter(any), max_size=10))
def test_support(make, rows, directions):
    hull = make(rows)
    corners = oracle.hull(rows)
    for d, found in zip(directions, tuples(hull.support(directions)), strict=True):
        best = max(oracle.dot(d, p) for p in corners)
        assert found == min(p for p in corners if oracle.dot(d, p) == best)


@both
@given(rows=points(30).filter(bool), queries=st.lists(point, max_size=10))
def test_tangents(make, rows, queries):
    hull = make(rows)
    corners = oracle.hull(rows)
    result = hull.tangents(queries)
    assert result.shape == (len(queries), 2, 2)
    for q, (left, right) in zip(queries, result.tolist(), strict=True):
        if oracle.locate(corners, q) >= 0:
            assert np.isnan([left, right]).all()
            continue
        assert tuple(left) == farthest(q, [v for v in corners if all(oracle.turn(q, v, w) <= 0 for w in corners)])
        assert tuple(right) == farthest(q, [v for v in corners if all(oracle.turn(q, v, w) >= 0 for w in corners)])


def farthest(q, candidates):
    """Of points on one ray from q the one that lies beyond the others; seen along a flat hull, the ray is one line."""

    def distance(p):
        return (Fraction(p[0]) - Fraction(q[0])) ** 2 + (Fraction(p[1]) - Fraction(q[1])) ** 2

    return max(candidates, key=distance)


@both
@given(rows=points(60), seed=st.randoms(use_true_random=False))
def test_changed_is_exact(make, rows, seed):
    hull, live, changes = make(), [], 0
    for p in rows + rows:
        before = hull.vertices()
        if live and seed.random() < 0.5:
            changed = hull.delete(*live.pop(seed.randrange(len(live))))
        else:
            changed = hull.insert(*p)
            live.append(p)
        assert changed == (not np.array_equal(before, hull.vertices()))
        changes += changed
        assert hull.changes == changes


@both
@given(rows=points(30), batch=st.lists(st.tuples(st.sampled_from([1, -1]), point), max_size=30), more=points(10))
def test_a_batch_is_a_set(make, rows, batch, more):
    batch = batch + [(-1, p) for p in rows[:8]] + [(op, p) for p in more for op in (1, -1)]
    ops = np.array([op for op, _ in batch], np.int8)
    xy = np.array([p for _, p in batch]).reshape(-1, 2)
    hull = make(rows)
    before, changes = hull.vertices(), hull.changes
    wanted = Counter((x + 0.0, y + 0.0) for x, y in rows)
    wanted.update((x + 0.0, y + 0.0) for op, (x, y) in batch if op > 0)
    missing = []
    for row, (op, (x, y)) in enumerate(batch):
        p = x + 0.0, y + 0.0
        if op < 0:
            if wanted[p]:
                wanted[p] -= 1
            else:
                missing.append(row)
    if missing:
        with pytest.raises(KeyError, match=f"row {missing[0]}") as error:
            hull.apply(ops, xy)
        assert error.value.row == missing[0]
        assert hull == make(rows)
        assert hull.changes == changes
    assert hull.apply(ops, xy, missing="ignore") == len(batch) - len(missing)
    hull.check()
    assert tuples(hull.points()) == sorted(wanted.elements())
    assert tuples(hull.vertices()) == oracle.hull(wanted.elements())
    assert hull.changes == changes + (not np.array_equal(before, hull.vertices()))


@both
def test_a_batch_that_empties_the_hull_on_the_way(make):
    """The least points go first, the greatest come last, twice."""
    hull = make([[0, 0], [1, 0]])
    assert hull.apply([-1, -1, 1, 1], [[0, 0], [1, 0], [2, 3], [2, 3]]) == 4
    hull.check()
    assert (len(hull), hull.distinct, hull.count(2, 3)) == (2, 1, 2)
    assert hull.vertices().tolist() == [[2, 3]]


@both
def test_example(make):
    hull = make(EXAMPLE)
    assert hull.vertices().tolist() == CORNERS
    assert hull.area == 18.0
    assert hull.bounds == (0.0, 0.0, 5.0, 4.0)
    assert hull.perimeter == pytest.approx(4 + 4 + 4 + 2 * 5**0.5, rel=1e-15)
    assert hull.centroid == (61 / 27, 2.0)
    assert hull.tangents([[10, 2]]).tolist() == [[[4, 0], [4, 4]]]
    assert hull.tangents([[2, 10]]).tolist() == [[[5, 2], [0, 4]]]


@both
def test_counts(make):
    hull = make()
    assert hull.insert(1, 2) is True
    assert hull.insert(1.0, 2.0) is False
    assert hull.insert_many([[1, 2], [0, 0]]) == 2
    assert (len(hull), hull.distinct, hull.count(1, 2), hull.count(5, 5)) == (4, 2, 3, 0)
    assert hull.count_many([[1, 2], [5, 5], [-0.0, 0]]).tolist() == [3, 0, 1]
    assert hull.count_many([]).shape == make().count_many([]).shape == (0,)
    assert (1, 2) in hull
    assert (2, 1) not in hull
    assert hull.delete_many([[1, 2], [1, 2]]) == 2
    assert hull.delete(1, 2) is True
    assert hull.delete(0, 0) is True
    assert hull.vertices().shape == (0, 2)
    assert hull.locate([[0, 0]]).tolist() == [-1]
    assert np.isnan(hull.tangents([[0, 0]])).all()
    assert hull.area == 0.0


@both
def test_both_zeros_are_one_point(make):
    hull = make([[0.0, -0.0]])
    hull.insert(-0.0, 0.0)
    assert hull.distinct == 1
    assert hull.count(-0.0, -0.0) == 2
    assert not np.signbit(hull.points()).any()


@both
def test_delete_missing(make):
    hull = make(EXAMPLE)
    with pytest.raises(KeyError, match=r"point \(9\.0, 9\.0\) is missing"):
        hull.delete(9, 9)
    with pytest.raises(KeyError, match=r"row 2: point \(4\.0, 4\.0\)"):
        hull.delete_many([[4, 4], [0, 0], [4, 4]])
    with pytest.raises(KeyError):
        make().delete(0, 0)
    assert hull == make(EXAMPLE)
    assert hull.changes == 0
    assert hull.delete_many([[4, 4], [0, 0], [4, 4], [7, 7]], missing="ignore") == 2
    with pytest.raises(ValueError, match="missing must be"):
        hull.delete_many([[4, 4]], missing="skip")


@both
def test_values(make):
    hull = make(EXAMPLE)
    hull.insert(9, 9)
    for twin in (hull.copy(), copy.copy(hull), copy.deepcopy(hull), pickle.loads(pickle.dumps(hull))):
        assert twin == hull
        assert twin.changes == hull.changes == 1
        assert type(twin) is type(hull)
        twin.delete(9, 9)
        assert twin != hull
        assert twin.vertices().tolist() == CORNERS
    assert hull.vertices().tolist() != CORNERS
    assert hull != "a hull"
    with pytest.raises(TypeError, match="unhashable"):
        hash(hull)
    hull.clear()
    assert (len(hull), hull.distinct, hull.changes) == (0, 0, 2)
    hull.clear()
    assert hull.changes == 2
    assert "0 points" in repr(hull)


@both
def test_area_is_rounded_once(make):
    tiny = make([[0, 0], [1e-200, 0], [0, 1e-100]])
    assert tiny.area == 5e-301
    assert make([[0, 0], [1e300, 0], [0, 1e300]]).area == float("inf")
    sliver = make([[1e16, 1e16], [1e16 + 2, 1e16], [1e16 + 2, 1e16 + 2]])
    assert sliver.area == 2.0
    assert make([[0, 0], [4, 2]]).centroid == (2.0, 1.0)
    assert make([[0, 0], [3, 4]]).perimeter == 10.0
    assert make([[0, 0], [1.7e308, 0], [1.7e308, 1]]).perimeter == float("inf")
    assert make([[7, 8]]).bounds == (7.0, 8.0, 7.0, 8.0)


@both
def test_many_points_through_splits_and_merges(make):
    """Enough points for a tree of several levels, all deleted again, in an order that empties it from one side."""
    rng = np.random.default_rng(7)
    rows = np.concatenate([rng.random((1500, 2)), rng.integers(0, 12, (500, 2)).astype(float)])
    hull = make()
    for x, y in rows:
        hull.insert(x, y)
    hull.check()
    assert tuples(hull.vertices()) == oracle.hull(tuples(rows))
    for i, (x, y) in enumerate(sorted(tuples(rows))):
        hull.delete(x, y)
        if i % 250 == 0:
            hull.check()
    assert len(hull) == 0
    hull.check()
