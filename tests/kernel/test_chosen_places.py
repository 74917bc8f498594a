"""Who chooses the places cannot make the kernel's tables slow: no place has the same hash in every process."""

import time

import numpy as np

from dynhull import DynamicHull

PLACES = 20_000
# Its bits, turned by half, were a constant of the hash, and made the product zero for every x.
UNLUCKY = np.array([0x78BD642FA0761D64], np.uint64).view(np.float64)[0]


def test_places_that_share_an_unlucky_coordinate_cost_what_others_cost():
    """Where all have one hash, as many repeated places took 30 times as long, by the square of their number."""

    def spent(y):
        places = np.column_stack([np.random.default_rng(1).random(PLACES), np.full(PLACES, y)])
        began = time.thread_time()
        DynamicHull(np.concatenate([places, places]))
        return time.thread_time() - began

    usual, unlucky = (min(spent(y) for _ in range(3)) for y in (1.5, UNLUCKY))
    assert unlucky < 8 * usual
