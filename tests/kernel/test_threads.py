"""Several threads use one hull: readers together, one writer, and the interpreter goes on meanwhile."""

import os
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from itertools import cycle

import numpy as np
import pytest
from cases import slow
from inputs import cloud

from dynhull import DynamicHull, FenceIndex, KeyedHull, _kernel

ROWS = 4000


@pytest.fixture
def impatient():
    """Switch threads at every chance."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


@pytest.fixture
def polite():
    """Never switch threads: a thread has to release the interpreter itself."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000)
    yield
    sys.setswitchinterval(interval)


@pytest.mark.usefixtures("impatient")
def test_writers_and_readers():
    """Every writer has points of its own, so the final content is known."""
    tree = _kernel.HullTree(np.random.default_rng(0).random((1000, 2)))
    before = tree.points()
    wrong = []

    def write(number):
        random = np.random.default_rng(number)
        mine = random.random((ROWS, 2)) + number
        for _ in range(10):
            tree.apply(+1, mine, False)
            tree.insert(*mine[0])
            tree.apply(-1, mine, False)
            tree.delete(*mine[0])
        tree.apply(+1, mine[:100], False)

    def read(number):
        random = np.random.default_rng(number)
        queries = random.random((ROWS, 2))
        for _ in range(30):
            if not (tree.locate(before) >= 0).all():
                wrong.append("a point of the beginning was outside")
            tree.support(queries)
            tree.tangents(queries)
            if len(tree.vertices()) < 3 or len(tree) < 1000 or not tree.count(*before[0]):
                wrong.append("the hull was in pieces")
            tree.copy().check()

    with ThreadPoolExecutor(8) as pool:
        jobs = [pool.submit(write, number) for number in range(1, 5)] + [pool.submit(read, n) for n in range(4)]
        for job in jobs:
            job.result()
    assert not wrong
    tree.check()
    expected = [before] + [np.random.default_rng(n).random((ROWS, 2))[:100] + n for n in range(1, 5)]
    np.testing.assert_array_equal(tree.points(), _kernel.HullTree(np.concatenate(expected)).points())


@pytest.mark.usefixtures("impatient")
def test_fences_of_several_threads():
    """Writers move subjects of their own, others set, drop and read fences, and one takes: no crossing gets lost."""
    hull = KeyedHull(key_type="int")
    index = FenceIndex(hull)
    index.set_polygons(0, [[[[0, 0], [1, 0], [1, 1], [0, 1]]]])
    moving = 4
    changes = {key: [] for key in range(moving * 50)}

    def move(number):
        random = np.random.default_rng(number)
        keys = np.arange(50, dtype=np.uint64) + 50 * number
        for _ in range(100):
            hull.put_many(keys, 2 * random.random((50, 2)))

    def redraw(number):
        for step in range(100):
            index.set_circle(number, 0.5, 0.5, 0.1 + step / 200)
            assert index.count(number) <= len(index.inside(number)) + moving * 50
            assert len(index.drop(number)) <= moving * 50

    def note(found):
        rows = found.fences == 0
        for key, change in zip(found.keys[rows].tolist(), found.changes[rows].tolist(), strict=True):
            changes[key].append(change)

    with ThreadPoolExecutor(moving + 2) as pool:
        jobs = [pool.submit(move, n) for n in range(moving)] + [pool.submit(redraw, n) for n in (1, 2)]
        while not all(job.done() for job in jobs):
            note(index.take())
        for job in jobs:
            job.result()
    note(index.take())
    keys = np.array(hull.keys(), np.uint64)
    inside = sorted(keys[(hull.positions(keys) <= 1).all(axis=1)].tolist())
    assert index.inside(0).tolist() == inside
    assert len(index) == 1
    for key, each in changes.items():
        assert all(change == (-1 if number % 2 else 1) for number, change in enumerate(each))
        assert (len(each) % 2 == 1) == (key in inside)


@pytest.mark.usefixtures("impatient")
def test_a_query_sees_no_half_of_an_update():
    """Many points come and go as one batch, without a pause: every answer belongs to the hull with them or without.

    That the test ends shows that a writer that never pauses lets readers in.
    """
    random = np.random.default_rng(0)
    circle, far = cloud("circle", 1000, random), 3 * cloud("circle", 300, random)
    queries = 5 * random.random((100, 2)) - 2.5
    hull = DynamicHull(circle)

    def ask(hull):
        lines = hull.intersect_lines(queries[:-1], queries[1:])
        return [answer.tobytes() for answer in (hull.distance(queries), lines, hull.count_many(far))]

    allowed = list(map(set, zip(ask(hull), ask(DynamicHull(np.concatenate([circle, far]))), strict=True)))
    done = threading.Event()

    def change():
        for update in cycle([hull.insert_many, hull.delete_many]):
            if done.is_set():
                return
            update(far)

    with ThreadPoolExecutor(1) as pool:
        changing = pool.submit(change)
        try:
            for _ in range(50):
                assert all(answer in known for answer, known in zip(ask(hull), allowed, strict=True))
        finally:
            done.set()
        changing.result()


def test_other_threads_run_during_a_batch():
    """A batch releases the interpreter: another thread counts while it runs."""
    rows = np.random.default_rng(0).random((1_000_000, 2))
    counted = []
    done = threading.Event()

    def count():
        steps = 0
        while not done.is_set():
            steps += 1
        counted.append(steps)

    counter = threading.Thread(target=count)
    tree = _kernel.HullTree()
    counter.start()
    began = len(counted)
    tree.apply(+1, rows, False)
    done.set()
    counter.join()
    assert began == 0
    assert counted[0] > 1000


@pytest.mark.usefixtures("polite")
@pytest.mark.parametrize("method", ["locate", "support", "tangents", "distance", "intersect_lines", "count_many"])
def test_other_threads_run_during_queries(method):
    random = np.random.default_rng(0)
    tree = _kernel.HullTree(cloud("circle", 1000, random))
    rows = random.random((2, 20_000, 2))
    steps = []
    done = threading.Event()

    def count():
        while not done.is_set():
            steps.append(None)
            time.sleep(0)  # lets go

    counter = threading.Thread(target=count)
    counter.start()
    try:
        before = len(steps)
        for _ in range(100):  # the system may be slow to run the other
            getattr(tree, method)(*rows[: 2 if method == "intersect_lines" else 1])
            if len(steps) > before:
                break
        else:
            pytest.fail("the counter stood still")
    finally:
        done.set()
        counter.join()


@slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on this system")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.usefixtures("impatient")
def test_fork_during_batches():
    """At whatever moment a process forks, the child's hull is consistent, and both processes continue."""
    tree = _kernel.HullTree(np.random.default_rng(0).random((1000, 2)))
    stop = threading.Event()
    rows = np.random.default_rng(1).random((ROWS, 2))

    def write():
        while not stop.is_set():
            tree.apply(+1, rows, False)
            tree.apply(-1, rows, False)

    writer = threading.Thread(target=write)
    writer.start()
    try:
        for _ in range(20):
            child = os.fork()
            if child == 0:
                status = 1
                try:
                    tree.check()
                    tree.apply(+1, rows, False)
                    tree.insert(0.5, 0.5)
                    tree.check()
                    status = 0
                finally:
                    os._exit(status)
            assert os.waitpid(child, 0)[1] == 0
    finally:
        stop.set()
        writer.join()
    tree.check()
    assert len(tree) == 1000


@pytest.mark.parametrize("before", [0, 1000])
def test_points_that_another_thread_changes_meanwhile(before):
    """The hull inserts some mixture of the arrays, or refuses it: all of the points or none."""
    random = np.random.default_rng(0)
    points, few = random.random((200_000, 2)), random.random((before, 2))
    spoiled = points.copy()
    spoiled[::1000] = np.nan
    orders = points.copy(), points[::-1].copy(), spoiled
    done = threading.Event()

    def change():
        while not done.is_set():
            for order in orders:
                points[:] = order

    with ThreadPoolExecutor(1) as pool:
        changing = pool.submit(change)
        try:
            for _ in range(8):
                hull = DynamicHull(few)
                try:
                    added = hull.insert_many(points) if before else len(hull := DynamicHull(points))
                except ValueError:
                    added = 0
                assert len(hull) == before + added
                assert np.isfinite(hull.points()).all()
                hull.check()
        finally:
            done.set()
        changing.result()
