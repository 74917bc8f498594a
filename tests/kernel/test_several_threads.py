"""Calls that use several threads of their own give the results of one thread."""

import os
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from inputs import cloud

from dynhull import DynamicHull, FenceIndex, KeyedHull, set_threads


@pytest.fixture(autouse=True)
def three_threads():
    set_threads(3)
    yield
    set_threads(None)


def alone(work):
    set_threads(1)
    try:
        return work()
    finally:
        set_threads(3)


def state(hull):
    return hull.points().tobytes(), hull.vertices().tobytes(), hull.changes, len(hull), hull.distinct


def batch(hull, points, random):
    """New points, in a narrow strip now and then; the same number of old ones leave."""
    new = points(3000) * (0.01 if random.random() < 0.3 else 1, 1)
    old = random.permutation(hull.points())[:3000]
    return np.repeat(np.array([1, -1], np.int8), [len(new), len(old)]), np.concatenate([new, old])


def test_the_number_of_threads():
    for threads in (1, 64, None):
        set_threads(threads)
    for wrong in (0, 65, -1):
        with pytest.raises(ValueError, match=f"threads must be from 1 to 64, got {wrong}"):
            set_threads(wrong)
    with pytest.raises(TypeError):
        set_threads("two")


@pytest.mark.parametrize("kind", ["square", "circle", "grid"])
def test_batches(kind):
    random = np.random.default_rng(0)

    def points(count):
        if kind == "grid":
            return random.integers(0, 60, (count, 2)).astype(float)
        return random.random((count, 2)) if kind == "square" else cloud("circle", count, random)

    first = points(20_000)
    together, one = DynamicHull(first), alone(lambda: DynamicHull(first))
    assert state(together) == state(one)
    for _ in range(10):
        ops, rows = batch(one, points, random)
        together.apply(ops, rows)
        alone(lambda ops=ops, rows=rows: one.apply(ops, rows))
        together.check()
        assert state(together) == state(one)
    for hull in (together, one):
        hull.delete_many(hull.points())
        assert state(hull)[:2] == (b"", b"")


def test_a_bad_batch_changes_nothing():
    random = np.random.default_rng(0)
    hull = DynamicHull(random.random((20_000, 2)))
    before = state(hull)
    rows = np.concatenate([hull.points()[:5000], random.random((2, 2)), hull.points()[5000:9000]])
    with pytest.raises(KeyError) as missing:
        hull.delete_many(rows)
    assert missing.value.args == (tuple(rows[5000].tolist()), 5000)
    rows[7000, 1] = np.nan
    with pytest.raises(ValueError, match="row 7000"):
        hull.insert_many(rows)
    hull.check()
    assert state(hull) == before


@pytest.mark.parametrize("kind", ["square", "circle"])
def test_locate(kind):
    random = np.random.default_rng(0)
    hull = DynamicHull(cloud("circle", 2000, random) if kind == "circle" else random.random((2000, 2)))
    queries = np.concatenate([2.4 * random.random((60_000, 2)) - 1.2, hull.points()])
    assert (hull.locate(queries) == alone(lambda: hull.locate(queries))).all()


def test_locate_names_the_first_bad_row():
    random = np.random.default_rng(0)
    hull = DynamicHull(random.random((2000, 2)))
    queries = random.random((60_000, 2))
    queries[[41_000, 59_000], [0, 1]] = np.nan, np.inf
    for _ in range(2):  # without an index, and with one
        with pytest.raises(ValueError, match="points row 41000 is"):
            hull.locate(queries)
        hull.locate(queries[:40_000])


def fenced(places, random, crossing=0.3):
    """A keyed hull with polygons and circles over it, some with a margin, some that report who passes through."""
    hull = KeyedHull.from_entities(np.arange(len(places), dtype=np.uint64), places, key_type="int")
    index = FenceIndex(hull)
    for fence in range(120):
        center, size = random.random(2), 0.01 + 0.05 * random.random()
        options = {"margin": 0.01 * (fence % 2), "cross": random.random() < crossing}
        if fence % 3:
            corners = center + size * np.array([[0, 0], [1, 0.2], [1.2, 1], [0.3, 0.6]])
            index.set_polygons(fence, [[corners]], **options)
        else:
            index.set_circle(fence, *center, size, **options)
    return hull, index


def test_crossings():
    """Afterwards those are inside who are so for an index that is new, where no margin keeps others."""
    random = np.random.default_rng(0)
    places = random.random((20_000, 2))
    many, one = (fenced(places, np.random.default_rng(1)) for _ in range(2))
    for _ in range(6):
        moved = random.permutation(len(places))[:6000]
        places[moved] += 0.03 * random.normal(size=(len(moved), 2))
        found = []
        for hull, index in (many, one):
            set_threads(3 if hull is many[0] else 1)
            hull.put_many(moved.astype(np.uint64), places[moved])
            found.append(index.take())
        assert len(found[0]) > 1000
        for column in ("fences", "changes", "causes", "keys", "points", "previous", "distances"):
            assert getattr(found[0], column).tobytes() == getattr(found[1], column).tobytes()
    _, again = fenced(places, np.random.default_rng(1))
    for fence in range(0, 120, 2):
        assert sorted(many[1].inside(fence)) == sorted(one[1].inside(fence)) == sorted(again.inside(fence))


def change(turn, hull, index, keys, places):
    """Something else that a hull or its index is asked before crossings are taken."""
    match turn:
        case 1:
            index.inside(7)
        case 2:
            index.set_polygons(8, [[[[0.5, 0.5], [0.6, 0.5], [0.5, 0.6]]]])
        case 3:
            index.drop(9)
        case 4:
            hull.put_many(keys[:3], places[:3] + 0.1)
        case 5:
            hull.remove_many(keys[:2000])
        case 6:
            hull.put_many(keys[:2000], 1 - places[:2000])


def test_crossings_are_found_beside_the_update():
    """The same as after it, whatever is asked of the index in between."""
    random = np.random.default_rng(0)
    places = random.random((20_000, 2))
    beside, one = (fenced(places, np.random.default_rng(1), crossing=0) for _ in range(2))
    for turn in range(8):
        places_of = random.permutation(25_000)[:6000].astype(np.uint64)  # some of them are new
        places = random.random((6000, 2)) if turn % 2 else np.random.default_rng(turn).random((6000, 2)) * 0.2
        found = []
        for hull, index in (beside, one):
            set_threads(1, beside=hull is beside[0])
            hull.put_many(places_of, places)
            change(turn, hull, index, places_of, places)
            found.append(index.take())
        assert len(found[0]) > 1000
        for column in ("fences", "changes", "causes", "keys", "points", "previous", "distances"):
            assert getattr(found[0], column).tobytes() == getattr(found[1], column).tobytes()
    for fence in set(range(120)) - {9}:
        assert sorted(beside[1].inside(fence)) == sorted(one[1].inside(fence))


def test_many_callers_share_the_threads():
    """Who finds them busy works alone: nobody waits, and every hull is right."""
    random = np.random.default_rng(0)
    start = threading.Barrier(4)
    rows = random.random((4, 30_000, 2))

    def live(number):
        hull = DynamicHull(rows[number])
        start.wait()
        for i in range(0, 30_000, 2000):
            old = rows[number][i : i + 2000]
            hull.apply(np.repeat(np.array([1, -1], np.int8), 2000), np.concatenate([1 - old, old]))
            hull.locate(rows[number])
        hull.check()
        return hull

    with ThreadPoolExecutor(4) as pool:
        for number, hull in enumerate(pool.map(live, range(4))):
            assert (hull.points() == DynamicHull(1 - rows[number]).points()).all()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on this system")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_child_has_threads_of_its_own():
    random = np.random.default_rng(0)
    hull = DynamicHull(random.random((40_000, 2)))
    child = os.fork()
    if child == 0:
        status = 1
        try:
            before = threads_of_this_process()  # gRPC, if a test has used it, has begun some in the child
            hull.insert_many(random.random((40_000, 2)))
            hull.check()
            status = 0 if before is None or threads_of_this_process() == before + 2 else 2
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    hull.insert_many(random.random((40_000, 2)))
    hull.check()


def threads_of_this_process():
    tasks = Path("/proc/self/task")
    return len(list(tasks.iterdir())) if tasks.is_dir() else None
