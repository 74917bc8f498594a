"""Entities on the kernel and in the reference live the same lives and answer the same, errors and all."""

from concurrent.futures import ThreadPoolExecutor
from itertools import cycle
from threading import Event

import numpy as np
import pytest
from inputs import cloud

from dynhull import KeyedHull, _kernel
from dynhull._entities import Entities
from dynhull.keys import PackedKeys


class Both:
    """Two sets of entities that are asked the same."""

    def __init__(self, *arguments):
        self.reference, self.kernel = Entities(*arguments), _kernel.Entities(*arguments)

    def __call__(self, method, *arguments):
        expected, answer = (outcome(getattr(each, method), *arguments) for each in (self.reference, self.kernel))
        if isinstance(expected, np.ndarray):
            np.testing.assert_array_equal(answer, expected)
        else:
            assert answer == expected
            assert type(answer) is type(expected)
        return answer

    def agree(self):
        assert len(self.kernel) == len(self.reference)
        assert self.kernel.distinct == self.reference.distinct
        assert self.kernel.changes == self.reference.changes
        keys, places, times = self.reference.entities()
        same_keys, same_places, same_times = self.kernel.entities()
        assert (keys == same_keys) if isinstance(keys, PackedKeys) else (keys == same_keys).all()
        np.testing.assert_array_equal(same_places, places)
        np.testing.assert_array_equal(same_times, times)
        self("vertices")
        self("vertex_keys")
        self("keys_at", np.concatenate([places[::7], places[::7] + 1]))
        self("oldest")
        self.kernel.check()


def outcome(action, *arguments):
    try:
        return action(*arguments)
    except (ValueError, TypeError, KeyError) as error:
        return type(error), str(error), vars(error)


@pytest.mark.every(3)
@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("key_type", ["str", "int"])
@pytest.mark.parametrize("kind", ["uniform", "circle", "grid", "columns", "clusters"])
def test_a_fleet(kind, key_type, ordered):
    """Batches of every size, keys that are there and that are not, in every form; names are asked again and again."""
    random = np.random.default_rng(7)
    both = Both(key_type, ordered)
    pool = np.unique(random.integers(0, 2**64, 4000, dtype=np.uint64))
    for step, size in enumerate((1500, 1, 30, 700, 2, 2500, 64, 65, 300, 1200)):
        keys = random.permutation(pool[: 500 * (step + 1)])[:size]
        if key_type == "str":
            keys = [f"{key}é" if key % 3 == 0 else f"flight {key % 100} of {key}" for key in keys.tolist()]
            keys = PackedKeys.pack(keys) if step % 2 else keys
        places = cloud(kind, len(keys), random)
        times = random.integers(0, 50, len(keys)).astype(float) if ordered or step % 3 else None
        only = (None, "present", None, "absent")[step % 4]
        both("update", keys, places, times, only)
        both.agree()
        asked = [*keys][: len(keys) // 3]
        both("positions", asked)
        both("times", asked)
        both("update", [*keys, *keys][: len(keys) + 2], np.zeros((len(keys) + 2, 2)), np.zeros(len(keys) + 2), None)
        both("remove_many", asked, bool(step % 2))
        both("expire", float(step))
        both("evict", step)
        both("put", next(iter(keys)), 5, -step, float(step), None)
        both("remove", next(iter(keys)))
        both("remove", next(iter(keys)))
        both.agree()


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("key_type", ["str", "int"])
def test_a_hull_that_is_loaded_in_several_batches(key_type, ordered):
    """It is as one that has had them one after the other, and what is refused meanwhile changes nothing."""
    random = np.random.default_rng(11)
    loaded, updated = Both(key_type, ordered), Both(key_type, ordered)
    loaded("begin_load")
    for step, size in enumerate((900, 30, 700, 64, 0, 1)):
        numbers = random.permutation(1000)[:size].astype(np.uint64)
        keys = PackedKeys.pack([f"key {each}" for each in numbers]) if key_type == "str" else numbers
        places, times = cloud("grid", size, random), random.integers(0, 50, size).astype(float)
        for both in (loaded, updated):
            both("load", keys, places, times)
            both("remove_many", [*keys][: size // 5], True)
            both("load", [*keys, *keys][: size + 2], np.zeros((size + 2, 2)), np.zeros(size + 2))
            both("remove_many", [*keys, *keys][: size + 1], True) if size else None
        if step == 3:
            loaded("load", keys, np.full((size, 2), np.nan), times)
    loaded("end_load")
    loaded.agree()
    for each in ("points", "entities", "vertices", "vertex_keys"):
        same_as, found = getattr(updated.reference, each)(), getattr(loaded.reference, each)()
        assert repr(found) == repr(same_as)
    loaded("begin_load")  # it is not empty any more
    keys = [*updated.reference.entities()[0]][:20]
    for both in (loaded, updated):
        both("update", keys, cloud("circle", 20, np.random.default_rng(1)), np.full(20, 60.0), None)
        both("expire", 30.0)
        both.agree()


CLOCKS = {
    "in order": lambda now, size, random: now + np.sort(random.random(size)),
    "stragglers": lambda now, size, random: now - random.exponential(3, size),
    "one time a batch": lambda now, size, _: np.full(size, now),
    "one device far ahead": lambda now, size, random: np.where(random.random(size) < 0.01, 1e300, now),
    "backwards": lambda now, size, random: -now - random.random(size),
}


@pytest.mark.parametrize("key_type", ["str", "int"])
@pytest.mark.parametrize("clock", CLOCKS)
def test_the_oldest_leave(clock, key_type):
    """Entities come, move, leave and come again while the oldest leave, by time and by number."""
    random = np.random.default_rng(11)
    both = Both(key_type)
    for step in range(15):
        keys = random.permutation(1500)[: (400, 40, 1)[step % 3]].astype(np.uint64)
        if key_type == "str":
            keys = [f"{key:040}" for key in keys.tolist()]
        times = CLOCKS[clock](float(step), len(keys), random)
        both("update", keys, cloud("uniform", len(keys), random), times, None)
        both("remove_many", [*keys][::5], False)
        both("oldest")
        if step % 2:
            both("expire", float(np.quantile(both.reference.entities()[2], 0.2)))
        else:
            both("evict", step)
        if step % 5 == 4:
            both("update", [*keys], cloud("uniform", len(keys), random), None, None)
            both("evict", 1)
        both.agree()
    both("expire", 1e300)
    both.agree()


def test_names_while_the_hull_shrinks_and_grows():
    """The vertices leave again and again, then entities come from far away."""
    random = np.random.default_rng(3)
    both = Both("int")
    keys = np.arange(4000, dtype=np.uint64)
    both("update", keys, cloud("uniform", 4000, random) - 0.5, None, None)
    for _ in range(60):
        gone = both("vertex_keys")
        both("remove_many", gone, False)
        both("keys_at", np.concatenate([both.reference.vertices(), both.reference.points()[:20]]))
    for scale in (2.0, 50.0, 1e300):
        both("update", keys[:1500], scale * (cloud("uniform", 1500, random) - 0.5), None, None)
        both.agree()
        both("update", keys[1500:], cloud("uniform", 2500, random), None, None)
        both.agree()


def test_readers_see_whole_batches():
    """A fleet moves to and fro as one batch, without a pause: every answer is of one moment."""
    random = np.random.default_rng(0)
    n = 5000
    keys = np.arange(n, dtype=np.uint64)
    here, there = cloud("circle", n, random), 3 * cloud("circle", n, random)
    hull = KeyedHull.from_entities(keys, here, key_type="int")
    names = [KeyedHull.from_entities(keys, places, key_type="int").vertex_keys() for places in (here, there)]
    done = Event()

    def move():
        for places in cycle([there, here]):
            if done.is_set():
                return
            hull.put_many(keys, places)

    with ThreadPoolExecutor(1) as pool:
        moving = pool.submit(move)
        try:
            for _ in range(40):
                positions = hull.positions(keys)
                assert any(np.array_equal(positions, places) for places in (here, there))
                assert hull.vertex_keys() in names
                copy = hull.copy()
                copy.check()
                assert copy.entities()[1].tobytes() in (here.tobytes(), there.tobytes())
        finally:
            done.set()
        moving.result()
    hull.check()


def test_keys_that_another_thread_changes_meanwhile():
    """Which keys come is anybody's guess; the table stays whole, and a batch is taken or refused as one."""
    n = 50_000
    first, second = np.arange(n, dtype=np.uint64), np.arange(n, dtype=np.uint64)[::-1] + np.uint64(n // 2)
    keys = first.copy()
    places = np.random.default_rng(0).random((n, 2))
    done = Event()

    def change():
        for order in cycle([first, second]):
            if done.is_set():
                return
            keys[:] = order

    with ThreadPoolExecutor(1) as pool:
        changing = pool.submit(change)
        try:
            hull = KeyedHull("int")
            for _ in range(10):
                before = len(hull)
                try:
                    new = hull.put_many(keys, places)
                except ValueError:  # a mixture of both orders holds keys twice
                    new = 0
                assert len(hull) == before + new
                hull.check()
        finally:
            done.set()
        changing.result()


def test_memory_of_those_who_left_is_used_again():
    """A fleet whose keys are new every day: what left makes room, in slots, table and strings."""
    hull = KeyedHull()
    for day in range(60):
        hull.put_many(
            [f"{'flight' * 20}{day} {i}" for i in range(1000)], cloud("uniform", 1000, np.random.default_rng(day))
        )
        if day:
            hull.remove_many([f"{'flight' * 20}{day - 1} {i}" for i in range(1000)])
        if day == 9:
            early = hull._tree.memory[1]
    assert hull._tree.memory[1] <= 1.5 * early


def test_times_that_shrink_do_not_fill_memory():
    """The order of times forgets where an entity was before."""
    hull = KeyedHull("int")
    keys = np.arange(1000, dtype=np.uint64)
    for step in range(300):
        hull.put_many(keys, cloud("uniform", 1000, np.random.default_rng(step)), np.full(1000, -float(step)))
        assert hull.oldest() == -step
        if step == 20:
            early = hull._tree.memory[1]
    assert hull._tree.memory[1] <= 1.5 * early
