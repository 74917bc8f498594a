"""Sorting through a hull: numbers on a parabola come out of it in order."""

import numpy as np
import pytest
from hulls import ALGORITHMS, HULLS, ONE_SHOT
from hypothesis import given
from hypothesis import strategies as st

from dynhull import DynamicHull

# Up to 2**26 a square is a double.
numbers = st.lists(st.integers(-(2**26), 2**26), max_size=40)


def on_parabola(values):
    return [(float(x), float(x) ** 2) for x in values]


@pytest.mark.parametrize("hull_of", {**ALGORITHMS, **ONE_SHOT}.values(), ids=[*ALGORITHMS, *ONE_SHOT])
@given(numbers)
def test_a_static_hull_sorts(hull_of, values):
    assert hull_of(on_parabola(values))[:, 0].tolist() == sorted(set(values))


@pytest.mark.parametrize("hull_type", HULLS.values(), ids=HULLS)
@given(numbers)
def test_a_live_hull_sorts(hull_type, values):
    hull = hull_type()
    for x, y in on_parabola(values):
        hull.insert(x, y)
    assert hull.lower()[:, 0].tolist() == sorted(set(values))


def test_a_live_hull_is_a_sorted_set():
    random = np.random.default_rng(3)
    values = random.permutation(2000).astype(float)
    hull = DynamicHull(np.column_stack([values, values**2]))
    hull.delete_many(np.column_stack([values[:1000], values[:1000] ** 2]))
    assert hull.vertices()[:, 0].tolist() == sorted(values[1000:])
    # The least number that is not below 500: the tangent of the parabola above it is the support in its direction.
    above = hull.support([[2 * 500, -1]])[0, 0]
    assert above == min(values[1000:], key=lambda v: (v - 500) ** 2)
