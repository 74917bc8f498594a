"""What it costs to let subjects go over from one index to another."""

import time

import numpy as np
import pytest
from hulls import KEYED_HULLS

from dynhull import FenceIndex

FEW, TIMES = 100, 16


def seconds(make, n):
    """The processor time in which n keys go over."""
    yard, road = make("int"), make("int")
    before, after = FenceIndex(yard), FenceIndex(road)
    for fences in (before, after):
        fences.set_circle(7, 0, 0, 5)
    keys, places = np.arange(n, dtype=np.uint64), np.random.default_rng(0).random((n, 2))
    yard.put_many(keys, places)
    before.take()
    yard.remove_many(keys)
    road.put_many(keys, places)
    begun = time.process_time()
    carried = after.carry(before, keys)
    took = time.process_time() - begun
    assert carried.all()
    assert len(after.take()) == n
    assert len(before.take()) == 0
    return took


@pytest.mark.parametrize("kind", [kind for kind in KEYED_HULLS if kind != "python, tiny leaves"])
def test_who_changes_hulls_costs_the_same_among_many(kind):
    make = KEYED_HULLS[kind]
    few, many = (min(seconds(make, n) for _ in range(3)) for n in (FEW, TIMES * FEW))
    assert many < 4 * TIMES * few  # with the square it would be 16 times as many times
