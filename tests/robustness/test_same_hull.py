"""Every way to a hull gives the vertices that rational arithmetic gives, on the inputs made to prevent it."""

from functools import cache
from itertools import combinations, permutations, product

import numpy as np
import oracle
import pytest
from cases import slow
from hulls import ALGORITHMS, HULLS, ONE_SHOT
from inputs import ULP
from killers import KILLERS, PUBLISHED, nearly_collinear


def tuples(array):
    return list(map(tuple, array.tolist()))


def bulk(make, rows):
    return make(rows)


def one_by_one(make, rows):
    hull = make()
    for x, y in rows:
        hull.insert(x, y)
    return hull


def half_deleted(make, rows):
    """Insert as many other points as well, around and among them, then delete these."""
    others = [(y, -x) for x, y in rows]
    hull = make()
    for (x, y), (v, w) in zip(rows, others[::-1], strict=True):
        hull.insert(v, w)
        hull.insert(x, y)
    for x, y in others:
        hull.delete(x, y)
    return hull


STATIC = ALGORITHMS | ONE_SHOT
DYNAMIC = {
    f"{name}, {build.__name__}": (make, build)
    for (name, make), build in product(HULLS.items(), (bulk, one_by_one, half_deleted))
}

every_static = pytest.mark.parametrize("algorithm", STATIC.values(), ids=STATIC.keys())
every_dynamic = pytest.mark.parametrize(("make", "build"), DYNAMIC.values(), ids=DYNAMIC.keys())
every_input = pytest.mark.parametrize("name", KILLERS)


@cache
def vertices(name):
    return oracle.hull(KILLERS[name])


@cache
def boundary(name):
    return oracle.boundary(KILLERS[name])


def orders(rows):
    """As given, from both ends of x and of y, and shuffled."""
    by_x, by_y = sorted(rows), sorted(rows, key=lambda p: (p[1], p[0]))
    shuffled = np.random.default_rng(len(rows)).permutation(np.array(rows)).tolist()
    return [rows, by_x, by_x[::-1], by_y, by_y[::-1], list(map(tuple, shuffled))]


@pytest.mark.every(4)
@every_input
@every_static
def test_static(algorithm, name):
    for rows in orders(KILLERS[name]):
        assert tuples(algorithm(rows)) == vertices(name)
        if algorithm in ALGORITHMS.values():
            assert tuples(algorithm(rows, collinear="keep")) == boundary(name)


@pytest.mark.every(4)
@every_input
@every_dynamic
def test_dynamic(make, build, name):
    for rows in orders(KILLERS[name])[:: 1 if len(KILLERS[name]) < 100 else 3]:
        hull = build(make, rows)
        assert len(hull) == len(rows)
        assert tuples(hull.vertices()) == vertices(name)
    hull.check()


@slow
@pytest.mark.parametrize("rows", PUBLISHED.values(), ids=PUBLISHED.keys())
def test_published_killers_in_every_order_of_four(rows):
    for four in combinations(rows, 4):
        expected = oracle.hull(four)
        for order in permutations(four):
            for algorithm in STATIC.values():
                assert tuples(algorithm(order)) == expected
            for make in HULLS.values():
                assert tuples(one_by_one(make, order).vertices()) == expected


def test_one_unit_in_the_last_place_in_every_order():
    """Triples that floating point gets wrong, built the way the published ones were, with a point on each side."""
    rng = np.random.default_rng(5)
    wrong = 0
    for _ in range(40):
        a, b = tuples(rng.uniform(-1, 1, (2, 2)))
        rounded = [p for p in nearly_collinear(a, b, rng.random())[2:] if naive(a, b, p) != oracle.turn(a, b, p)]
        wrong += len(rounded)
        for p in rounded[:2]:
            rows = [a, b, p, (a[1], -b[0])]
            expected = oracle.hull(rows)
            for order in permutations(rows):
                for algorithm in STATIC.values():
                    assert tuples(algorithm(order)) == expected
                for make in HULLS.values():
                    assert tuples(one_by_one(make, order).vertices()) == expected
    assert wrong > 40


def naive(a, b, c):
    (ax, ay), (bx, by), (cx, cy) = a, b, c
    return int(np.sign((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)))


@every_static
def test_triangles_of_the_perturbation_grid(algorithm):
    """A point next to (0.5, 0.5), (12, 12) and (24, 24): every eighth of the 256 steps each way, and the diagonal."""
    cells = set(product(range(0, 256, 8), repeat=2)) | {(i, i + d) for i in range(255) for d in (0, 1)}
    for i, j in sorted(cells):
        rows = [(0.5 + i * ULP, 0.5 + j * ULP), (12.0, 12.0), (24.0, 24.0)]
        turn = oracle.turn(*rows)
        expected = sorted(rows) if turn else [min(rows), max(rows)]
        if turn < 0:
            expected[1:] = expected[:0:-1]
        assert tuples(algorithm(rows)) == expected


def test_floating_point_alone_gets_these_wrong():
    """Each published input has a triple whose rounded sign is wrong."""
    for rows in PUBLISHED.values():
        assert any(naive(*triple) != oracle.turn(*triple) for triple in permutations(rows, 3))
