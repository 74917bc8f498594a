"""Keyed hulls on the kernel that are held in less memory, and answer as if they were not."""

from concurrent.futures import ThreadPoolExecutor
from inspect import getattr_static
from itertools import pairwise, takewhile
from threading import Event

import numpy as np
import pytest

from dynhull import FenceIndex, GeoKeyedHull, KeyedHull
from dynhull._implementation import kernel

if kernel is None:
    pytest.skip("the implementation in Python holds them in one way", allow_module_level=True)

PLACES = np.random.default_rng(5).random((100, 2))
NAMES = [f"vehicle-{number}" for number in range(100)]


def filled(make=KeyedHull, key_type="str", times=None):
    hull = make(key_type)
    hull.update(NAMES if key_type == "str" else range(100), PLACES, times)
    return hull


ANY = [[0.5, 0.5]]
CALLS = {
    "put": lambda hull: hull.put("new", 0.5, 7),
    "put_many": lambda hull: hull.put_many(["vehicle-3", "new"], [[9, 9], [8, 8]]),
    "update": lambda hull: hull.update(NAMES, PLACES[::-1]),
    "remove": lambda hull: hull.remove("vehicle-3"),
    "remove_many": lambda hull: hull.remove_many(NAMES[:30]),
    "expire": lambda hull: hull.expire(20),
    "evict": lambda hull: hull.evict(60),
    "clear": lambda hull: hull.clear(),
    "position": lambda hull: hull.position("vehicle-7"),
    "positions": lambda hull: hull.positions(NAMES).tolist(),
    "times": lambda hull: hull.times(NAMES).tolist(),
    "entities": lambda hull: [list(column) for column in hull.entities()[:1]],
    "keys": lambda hull: list(hull.keys()),
    "oldest": lambda hull: hull.oldest(),
    "vertex_keys": lambda hull: hull.vertex_keys(),
    "keys_at": lambda hull: hull.keys_at(PLACES[:5]),
    "copy": lambda hull: hull.copy() == hull,
    "__len__": len,
    "__contains__": lambda hull: "vehicle-7" in hull,
    "__eq__": lambda hull: hull == filled(),
    "__reduce__": lambda hull: hull.__getstate__()[0],
    "distinct": lambda hull: hull.distinct,
    "changes": lambda hull: hull.changes,
    "count": lambda hull: hull.count(*PLACES[3]),
    "count_many": lambda hull: hull.count_many(PLACES).tolist(),
    "points": lambda hull: hull.points().tolist(),
    "vertices": lambda hull: hull.vertices().tolist(),
    "locate": lambda hull: hull.locate(ANY * 500).tolist(),
    "upper": lambda hull: hull.upper().tolist(),
    "lower": lambda hull: hull.lower().tolist(),
    "support": lambda hull: hull.support(ANY).tolist(),
    "tangents": lambda hull: hull.tangents([[5, 5]]).tolist(),
    "distance": lambda hull: hull.distance([[5, 5]]).tolist(),
    "intersect_lines": lambda hull: hull.intersect_lines(ANY, [[5, 6]]).tolist(),
    "layers": lambda hull: [layer.tolist() for layer in hull.layers(3)],
    "influence": lambda hull: hull.influence().tolist(),
    "sketch": lambda hull: hull.sketch(5)[0].tolist(),
    "area": lambda hull: hull.area,
    "check": lambda hull: hull.check(),
}


@pytest.mark.parametrize("name", CALLS)
def test_each_call_finds_what_was_packed(name):
    times = np.arange(100.0)
    packed, other = filled(times=times), filled(times=times)
    assert packed.pack()
    assert CALLS[name](packed) == CALLS[name](other)
    assert packed == other
    assert packed.changes == other.changes
    packed.check()


def test_every_call_is_tried():
    """Of the methods that read or change the tree: those that it has, under their own names."""
    native = {name for name in dir(kernel.Entities) if callable(getattr_static(kernel.Entities, name))}
    native -= {name for name in native if name.startswith("_")}
    elsewhere = {
        "pack": None,
        "begin_load": None,  # nobody has the hull before it is loaded
        "end_load": None,
        "packed": None,
        "load": "update",
        "apply_all": "update",
        "apply_each": "update",
        "has": "__contains__",
        "chain": "upper",
        "insert": "put",
        "take_vertices": "vertices",
        "vertex_taker": "vertices",
        "take_vertices_if": "vertices",
    }
    assert native - elsewhere.keys() - CALLS.keys() == set()


@pytest.mark.parametrize("make", [KeyedHull, GeoKeyedHull])
@pytest.mark.parametrize("key_type", ["str", "int"])
@pytest.mark.parametrize("timed", [False, True])
def test_packed_again_and_again(make, key_type, timed):
    hull = filled(make, key_type, np.arange(100.0) if timed else None)
    hull.remove_many(NAMES[10:20] if key_type == "str" else range(10, 20))
    twin = hull.copy()
    for number in range(3):
        assert hull.pack()
        assert hull.pack(), "it is, already"
        assert hull.changes == twin.changes
        for each in (hull, twin):
            each.put("late" if key_type == "str" else 1000, 2 + number, 3, 5.0)
        assert hull == twin
        assert hull.changes == twin.changes
        assert hull.vertex_keys() == twin.vertex_keys()
        hull.check()


def test_empty_and_at_one_place():
    hull = KeyedHull()
    assert hull.pack()
    assert len(hull) == 0
    hull.put_many(["a", "b", "c"], [[1, 1]] * 3)
    assert hull.pack()
    assert hull.count(1, 1) == 3
    assert hull.keys_at([[1, 1]]) == ["a"]
    hull.clear()
    assert hull.pack()
    assert hull.oldest() is None


def test_keys_that_begin_alike_or_not():
    long = "x" * 255
    keys = [long, long[:254] + "y", "x", "xy", "y", "yé", "yè", "y\0", "\0", "zz", "z", long[:128], long[:129]]
    hull, twin = KeyedHull(), KeyedHull()
    for each in (hull, twin):
        each.update(keys, PLACES[: len(keys)])
    assert hull.pack()
    assert hull == twin
    assert [hull.position(key) for key in keys] == [tuple(place) for place in PLACES[: len(keys)].tolist()]
    hull.check()


def test_idle_is_since_the_last_call():
    hull = filled()
    assert not hull.pack(idle=True)
    assert hull.pack(idle=True)
    hull.position("vehicle-3")
    assert not hull.pack(idle=True)
    assert hull.changes == 1, "which packed hulls know"
    assert hull.pack(idle=True)
    hull.put("new", 0, 0)
    assert hull.pack(), "whoever used it"


def test_not_while_an_index_compares_them():
    hull = filled()
    assert hull.pack()
    index = FenceIndex(hull)
    assert not hull.pack()
    index.set_polygons(1, [[[[-1, -1], [2, -1], [2, 2], [-1, 2]]]])
    assert index.count(1) == 100
    hull.put("vehicle-3", 9, 9)
    assert list(index.take().keys) == ["vehicle-3"]
    index.detach()
    assert hull.pack()


def test_memory():
    """Less than a third of it: what differs in each column, and of each key what the one before has not."""
    hull = filled()
    _, before = hull._tree.memory
    assert hull.pack()
    used, packed = hull._tree.memory
    in_common = sum(
        len(list(takewhile(lambda pair: pair[0] == pair[1], zip(*two, strict=False)))) for two in pairwise(NAMES)
    )
    # Places between 0 and 1 have their first byte in common, and no key has a time; names have different lengths.
    assert used == packed == 4 * 8 + 100 * 2 * 7 + 8 + 100 * 2 + sum(map(len, NAMES)) - in_common
    assert packed < before / 3
    hull.locate(ANY)
    assert hull._tree.memory[1] <= before
    times = filled(times=np.arange(100.0), key_type="int")
    assert times.pack()
    assert times._tree.memory[1] == 4 * 8 + 100 * (2 * 7 + 1 + 8) + 8
    alike = KeyedHull()
    alike.put_many([f"key-{number:03}" for number in range(100)], PLACES)
    assert alike.pack()
    assert alike._tree.memory[1] == 4 * 8 + 100 * 2 * 7 + 8 + 100 + len("key-") + 3 + 9 * 2 + 90


def test_threads_that_use_it_meanwhile():
    """One that packs it all the time, others that read and move; they see whole batches."""
    keys, begun, end = [f"key-{number}" for number in range(200)], Event(), Event()
    hull = KeyedHull()
    hull.put_many(keys, np.zeros((200, 2)))

    def pack():
        times = 0
        while not end.is_set():
            times += hull.pack()
            begun.set()
        return times

    def read():
        for _ in range(300):
            places = hull.positions(keys)
            assert (places == places[0]).all()
            assert len(hull.vertices()) == 1

    def move():
        for number in range(300):
            assert hull.put_many(keys, np.full((200, 2), float(number))) == 0

    with ThreadPoolExecutor(5) as threads:
        packing = threads.submit(pack)
        assert begun.wait(60)
        works = [threads.submit(work) for work in (read, move, read)]
        try:
            for work in works:
                work.result()
        finally:
            end.set()
        assert packing.result() > 0
    hull.check()


COLUMNS = {
    "alike": np.array([[13.37 + i / 1e4, 52.51 - i / 1e4] for i in range(100)]),
    "one place": np.full((100, 2), 0.1),
    "far apart": np.array([[(-1) ** i * 10.0 ** (i - 50), i * 5e-324] for i in range(100)]),
    "one axis": np.array([[i, 7.0] for i in range(100)]),
    "zeros": np.array([[0.0, -0.0]] * 100),
}
KEYS = {
    "in a row": list(range(10**6, 10**6 + 100)),
    "far apart": [(2**64 - 1) // 99 * i for i in range(100)],
    "one length": [f"key-{i:03}" for i in range(100)],
    "all lengths": ["é" * (i + 1) + "x" for i in range(100)],
}


@pytest.mark.parametrize("columns", COLUMNS)
@pytest.mark.parametrize("of", KEYS)
def test_every_bit_of_the_columns_comes_back(columns, of):
    keys, places = KEYS[of], COLUMNS[columns]
    hull = KeyedHull("str" if isinstance(keys[0], str) else "int")
    hull.update(keys, places, places[:, 0])
    vertices = hull.vertices()
    assert hull.pack()
    assert hull.vertices().tobytes() == vertices.tobytes()
    assert hull.positions(keys).tobytes() == (places + 0.0).tobytes()
    assert hull.times(keys).tobytes() == (places[:, 0]).tobytes()
    hull.check()


def test_the_vertices_leave_it_packed_once():
    hull, twin = filled(), filled()
    assert hull.pack()
    _, packed = hull._tree.memory
    for taken_out in (False, True):
        assert hull.vertices().tolist() == twin.vertices().tolist()
        assert (hull._tree.memory[1] > packed) is taken_out
    hull.put("new", 9, 9)
    twin.put("new", 9, 9)
    assert hull.pack()
    assert hull.vertices().tolist() == twin.vertices().tolist()
    assert hull == twin


@pytest.mark.parametrize("key_type", ["str", "int"])
@pytest.mark.parametrize("ordered", [False, True])
def test_a_loader_packs_what_it_has(key_type, ordered):
    loader, twin = (KeyedHull.loader(key_type, ordered=ordered) for _ in range(2))
    keys, times = NAMES if key_type == "str" else list(range(100)), np.arange(100.0)
    for each in (loader, twin):
        each.update(keys, PLACES, times)
        each.update(keys[:50], PLACES[50:], times[:50] - 25)
        each.remove_many(keys[90:])
    assert loader.packed(89) is None, "it goes on"
    packed, expected = loader.packed(90), twin.hull()
    assert (len(packed), packed.distinct, packed.vertex_count) == (
        *(len(expected), expected.distinct),
        len(expected.vertices()),
    )
    first, second = (KeyedHull.unpacked(packed) for _ in range(2))
    assert first.ordered is ordered
    assert first == expected
    first.check()
    first.clear()
    assert second == expected, "one is not the other"
    for call in (loader.hull, lambda: loader.packed(100), lambda: loader.update(keys, PLACES, times)):
        with pytest.raises(ValueError, match="the loader has given its hull away"):
            call()


def test_a_loader_that_has_nothing():
    packed = KeyedHull.loader().packed(0)
    assert (len(packed), packed.distinct, packed.vertex_count) == (0, 0, 0)
    hull = KeyedHull.unpacked(packed)
    assert hull.vertices().tolist() == []
    hull.put("a", 1, 2)
    assert hull.keys() == ["a"]
    with pytest.raises(ValueError, match="only what is being loaded is packed so"):
        hull._tree.packed(1)
