"""A hull on the globe that one thread changes and others read: each answer belongs to one state."""

from concurrent.futures import ThreadPoolExecutor
from threading import Event

import numpy as np
import pytest
from globes import around

from dynhull import GeoHull, GeoKeyedHull, GeoWindowHull

CENTER, OTHER = (179.0, 60.0), (-170.0, 40.0)
SIZE = 3000


def states():
    """Two sets of places, as many in each, without common ones."""
    rng = np.random.default_rng(3)
    return around(rng, CENTER, 20, SIZE), around(rng, CENTER, 25, SIZE)


def toggles(kind):
    """A hull with the first set, and what makes it have the second and then the first again."""
    first, _ = states()
    ops = np.repeat(np.array([1, -1], np.int8), SIZE)
    if kind == "places":
        hull = GeoHull(first, center=CENTER)
        return hull, lambda new, old: hull.apply(ops, np.concatenate([new, old]))
    if kind == "entities":
        hull = GeoKeyedHull("int", center=CENTER)
        hull.put_many(np.arange(SIZE), first)
        return hull, lambda new, _: hull.put_many(np.arange(SIZE), new)
    hull = GeoWindowHull(max_points=SIZE, center=CENTER)
    hull.add(first)
    return hull, lambda new, _: hull.add(new)


@pytest.mark.parametrize("kind", ["places", "entities", "window"])
def test_readers_see_one_state(kind):
    hull, toggle = toggles(kind)
    sets = states()
    vertices = [GeoHull(each, center=CENTER).vertices().tobytes() for each in sets]
    points = [each[np.lexsort(each.T[::-1])].tobytes() for each in sets]
    inside = [GeoHull(each, center=CENTER).locate(sets[1]).tobytes() for each in sets]
    done = Event()

    def read():
        rounds = 0
        while not done.is_set() or rounds < 3:
            assert hull.vertices().tobytes() in vertices
            assert hull.points().tobytes() in points
            assert hull.locate(sets[1]).tobytes() in inside
            assert hull.center in (CENTER, OTHER)
            assert len(hull) == SIZE
            if kind == "entities":
                assert len(hull.vertex_keys()) in [len(each) // 16 for each in vertices]
            rounds += 1

    with ThreadPoolExecutor(2) as pool:
        readers = [pool.submit(read) for _ in range(2)]
        try:
            for turn in range(12):
                toggle(sets[1 - turn % 2], sets[turn % 2])
                hull.recenter(OTHER if turn % 3 else CENTER)
        finally:
            done.set()
        for reader in readers:
            reader.result()
    hull.check()


def test_the_first_batches_of_two_threads_choose_one_centre():
    rng = np.random.default_rng(4)
    batches = [around(rng, CENTER, 5, 500) for _ in range(8)]
    for _ in range(10):
        hull = GeoHull()
        with ThreadPoolExecutor(4) as pool:
            list(pool.map(hull.insert_many, batches))
        assert len(hull) == 4000
        assert hull.center is not None
        hull.check()
