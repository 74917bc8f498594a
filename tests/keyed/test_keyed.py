"""Keyed hulls: what is refused changes nothing; many entities at one place; what they share with other hulls."""

import pickle
from decimal import Decimal
from math import inf, nan

import numpy as np
import pytest
from hulls import KEYED_HULLS

from dynhull import DuplicateKeyError, DynamicHull, KeyedHull, MissingKeyError, Put, gjk
from dynhull.keys import PackedKeys


@pytest.fixture(params=KEYED_HULLS)
def make(request):
    return KEYED_HULLS[request.param]


@pytest.fixture
def hull(make):
    return make.from_entities(["a", "b", "c"], [[0, 0], [4, 0], [0, 4]], [1, nan, 2])


FINE, TWO = ["x", "y"], [[1, 1], [2, 2]]

BAD = [
    (["x", ""], TWO, None, ValueError, "keys row 1 is ''"),
    (["x", 5], TWO, None, TypeError, "keys row 1 is 5: must be a string"),
    ([1, 2], TWO, None, TypeError, "keys row 0 is 1: must be a string"),
    (np.array([1, 2], np.uint64), TWO, None, TypeError, "keys row 0 is 1: must be a string"),
    (FINE, [[1, 1], [nan, 2]], None, ValueError, r"points row 1 is \(nan, 2.0\): coordinates must be finite"),
    (FINE, np.array([[1, 1], [inf, 2]]), None, ValueError, r"points row 1 is \(inf, 2.0\): coordinates must be finite"),
    (FINE, [[1, 1], [2, 2**53 + 1]], None, ValueError, "points row 1 is 9007199254740993"),
    (FINE, [1, 2], None, ValueError, r"points must have shape \(n, 2\)"),
    (None, TWO, None, TypeError, "keys is None: must be a list or an array of keys"),
    (FINE, None, None, (ValueError, TypeError), "points"),
    (FINE, [[1, 1]], None, ValueError, "points must have one row for each key: 2, got 1"),
    (FINE, TWO, [1, nan], ValueError, "times row 1 is nan: times must be finite"),
    (FINE, TWO, np.array([-inf, nan]), ValueError, "times row 0 is -inf: times must be finite"),
    (FINE, TWO, [1, 2**53 + 1], ValueError, "times row 1 is 9007199254740993: no double has this value"),
    (FINE, TWO, [1, 10**400], ValueError, "times row 1 is 1000.*too large for a double"),
    (FINE, TWO, [1, "2"], TypeError, "times row 0|times row 1 is '2': a time is a real number"),
    (FINE, TWO, [1, True, 2], ValueError, "times must have one row for each key: 2, got 3"),
    (FINE, TWO, [[1], [2]], ValueError, r"times must have shape \(k,\), got \(2, 1\)"),
    (FINE, TWO, np.array(["2020-01-01"] * 2, "M8[D]"), TypeError, "times row 0 is .*: a time is a real number"),
    (["x", "a", "x"], [[1, 1]] * 3, None, ValueError, "keys rows 0 and 2 are both 'x': a batch holds a key once"),
    (["a", "x", "b", "b", "a"], [[1, 1]] * 5, None, ValueError, "keys rows 2 and 3 are both 'b'"),
    (["x", "a", "a", "x"], [[1, 1]] * 4, None, ValueError, "keys rows 1 and 2 are both 'a'"),
    (["x", "a", "x", "a"], [[1, 1]] * 4, None, ValueError, "keys rows 0 and 2 are both 'x'"),
]


@pytest.mark.parametrize(("keys", "xy", "times", "error", "message"), BAD)
@pytest.mark.parametrize("only", [None, "absent", "present"])
def test_bad_batches_change_nothing(hull, keys, xy, times, error, message, only):
    before, changes = hull.copy(), hull.changes
    for rows in (keys, PackedKeys.pack(keys)) if error is ValueError and keys and all(keys) else (keys,):
        with pytest.raises(error, match=message):
            hull.put_many(rows, xy, times, only=only)
        with pytest.raises(error, match=message):
            hull.update(rows, xy, times, only=only)
    assert hull == before
    assert hull.changes == changes
    hull.check()
    if "times row 1 is nan" not in message:  # which means no time there
        with pytest.raises(error, match=message):
            type(hull).from_entities(keys, xy, times)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (("", 0, 0), ValueError, "key is ''"),
        ((1, 0, 0), TypeError, "key is 1: must be a string"),
        ((None, 0, 0), TypeError, "key is None"),
        (("a", nan, 0), ValueError, "x is nan: coordinates must be finite"),
        (("a", 0, "1"), TypeError, "y: coordinates must be real numbers"),
        (("a", 0, 0, inf), ValueError, "time is inf: times must be finite"),
        (("a", 0, 0, "now"), TypeError, "time is 'now': a time is a real number"),
        (("a", 0, 0, True), TypeError, "time is True: a time is a real number"),
        (("a", 0, 0, 2**53 + 1), ValueError, "time is 9007199254740993: no double"),
        (("a", 0, 0, Decimal("0.1")), ValueError, r"time is Decimal\('0.1'\): no double"),
    ],
)
def test_bad_puts_change_nothing(hull, arguments, error, message):
    before = hull.copy()
    with pytest.raises(error, match=message):
        hull.put(*arguments)
    assert hull == before


def test_other_refusals(make, hull):
    before = hull.copy()
    for call, error, message in [
        (lambda: make("float"), ValueError, 'key_type must be "str" or "int", got \'float\''),
        (lambda: hull.put("a", 0, 0, only="new"), ValueError, 'only must be None, "absent" or "present", got \'new\''),
        (lambda: hull.remove_many(["a"], "skip"), ValueError, 'missing must be "raise" or "ignore"'),
        (lambda: hull.remove_many([["a"]]), TypeError, r"keys row 0 is \['a'\]"),
        (lambda: hull.evict(-1), ValueError, "count is -1: must not be negative"),
        (lambda: hull.evict(1.5), TypeError, "integer"),
        (lambda: hull.expire(nan), ValueError, "until is nan: times must be finite"),
        (lambda: hull.expire("now"), TypeError, "until is 'now': a time is a real number"),
        (lambda: (0, 0) in hull, TypeError, r"key is \(0, 0\): must be a string"),
        (lambda: hull.positions([1]), TypeError, "keys row 0 is 1"),
        (lambda: hull.times(None), TypeError, "keys is None: must be a list"),
        (lambda: hull.remove_many(None), TypeError, "keys is None: must be a list"),
        (lambda: hull.keys_at([1, 2]), ValueError, r"points must have shape \(n, 2\)"),
        (lambda: make(ordered=True).put("a", 0, 0), ValueError, "time is None: a hull with ordered=True needs a time"),
        (lambda: make(ordered=True).put_many(["a"], [[0, 0]]), ValueError, "times is None: a hull with ordered=True"),
        (lambda: make.from_entities(["a"], [[0, 0]], [nan], ordered=True), ValueError, "times row 0 is nan"),
        (lambda: make.from_entities(["a"], [[0, 0]], [inf]), ValueError, "times row 0 is inf"),
        (lambda: make("int").put(-1, 0, 0), ValueError, "key is -1: a key is from 0"),
    ]:
        with pytest.raises(error, match=message):
            call()
    assert hull == before


def test_a_loader_gives_the_hull_of_all_batches():
    for key_type, keys in (("str", ["a", "b", "c", "d"]), ("int", [1, 2, 3, 4])):
        loader = KeyedHull.loader(key_type)
        loader.update(keys[:3], [[0, 0], [4, 0], [0, 4]], [1, nan, 2])
        loader.update(keys[1:3], [[5, 0], [0, 4]])
        loader.remove_many(keys[:1] + keys[3:])
        for bad in (lambda: loader.update(keys[:2], [[1, 1]] * 3), lambda: loader.update(keys[:1] * 2, [[1, 1]] * 2)):  # noqa: B023
            with pytest.raises(ValueError, match=r"points must have one row|both"):
                bad()
        loader.update(keys[3:], [[9, 9]], [3])
        hull = loader.hull()
        hull.check()
        assert hull == KeyedHull.from_entities(keys[1:], [[5, 0], [0, 4], [9, 9]], [nan, nan, 3], key_type)
        for call in (loader.hull, lambda: loader.update(keys[:1], [[1, 1]]), lambda: loader.remove_many(keys)):  # noqa: B023
            with pytest.raises(ValueError, match="the loader has given its hull away"):
                call()
        assert len(hull) == 3
    with pytest.raises(ValueError, match="times is None"):
        KeyedHull.loader(ordered=True).update(["a"], [[0, 0]])
    with pytest.raises(ValueError, match="key_type must be"):
        KeyedHull.loader("float")
    with pytest.raises(ValueError, match=r"^room must be a number of entities, got -1$"):
        KeyedHull.loader(room=-1)


@pytest.mark.parametrize("room", [0, 3, 500, 5000])
def test_a_loader_has_room_for_some_entities_and_takes_more(room):
    keys, places = [f"key {number}" for number in range(2000)], np.random.default_rng(2).random((2000, 2))
    loader = KeyedHull.loader(room=room)
    for first in range(0, 2000, 300):
        loader.update(keys[first : first + 300], places[first : first + 300])
    hull = loader.hull()
    hull.check()
    assert hull == KeyedHull.from_entities(keys, places)


def test_missing_keys(hull):
    with pytest.raises(MissingKeyError, match=r"^keys row 1: the key 'z' is missing; nothing was changed$"):
        hull.remove_many(["a", "z"])
    with pytest.raises(KeyError, match=r"^the key 'z' is missing; nothing was changed$"):
        hull.remove("z")
    assert hull.remove_many(["a", "z", "b"], missing="ignore") == 2
    assert hull.keys() == ["c"]
    for error in (MissingKeyError("é", 3), MissingKeyError(7), DuplicateKeyError("a", (1, 2))):
        copy = pickle.loads(pickle.dumps(error))
        assert (str(copy), type(copy), copy.key) == (str(error), type(error), error.key)


def test_times_of_event(make):
    """Older rows change nothing; of equal times the later arrival wins."""
    hull = make("int", ordered=True)
    assert hull.update([1, 2], [[0, 0], [1, 1]], [5, 5]) == Put(new=2, moved=0, unmoved=0, stale=0, skipped=0)
    assert hull.update([1, 2, 3], [[9, 9], [8, 8], [7, 7]], [4.5, 5, -1]) == Put(1, 1, 0, 1, 0)
    assert hull.positions([1, 2, 3]).tolist() == [[0, 0], [8, 8], [7, 7]]
    assert not hull.put(2, 20, 20, 4)
    assert hull.put(2, 20, 20, 5)
    assert hull.update([2], [[20, 20]], [6]) == Put(0, 0, 1, 0, 0)
    assert hull.times([1, 2, 3]).tolist() == [5, 6, -1]
    assert hull.update([1, 4], [[1, 0], [2, 0]], [9, 9], only="present") == Put(0, 1, 0, 0, 1)
    assert hull.update([1, 4], [[3, 0], [2, 0]], [1, 1], only="absent") == Put(1, 0, 0, 0, 1)
    assert (hull.oldest(), hull.expire(1), hull.keys(), hull.oldest()) == (-1, 2, [1, 2], 6)


def test_put_without_a_time_takes_the_time_away(hull):
    hull.put("a", 0, 0)
    assert np.isnan(hull.times(["a", "b", "z"])).all()
    assert hull.evict(2) == 2
    assert hull.keys() == ["c"]


def test_many_entities_at_one_place(make):
    """20,000 at (0, 0): the least names it, and each can go."""
    n = 20_000
    hull = make("int")
    keys = np.arange(n, dtype=np.uint64)[::-1]
    assert hull.put_many(keys, np.zeros((n, 2))) == n
    assert (len(hull), hull.distinct, hull.vertex_keys()) == (n, 1, [0])
    for key in range(20):
        assert not hull.remove(key)
        assert hull.vertex_keys() == [key + 1]
    assert not hull.put(7, -0.0, 0)
    assert hull.keys_at([[0, -0.0], [1, 1]]) == [7, None]
    assert hull.update(keys[: n // 2], np.ones((n // 2, 2))) == Put(0, n // 2, 0, 0, 0)
    assert hull.vertex_keys() == [7, n // 2]
    assert hull.remove_many(keys[: n // 2]) == n // 2
    hull.check()


def test_keys_that_hash_alike_or_share_their_start(make):
    """Lengths around the widths that a hash reads at a time, and integers in steps."""
    strings = [prefix * length for prefix in "ab" for length in range(1, 256)] + [f"{'x' * 40}{i}" for i in range(500)]
    hull = make()
    places = np.random.default_rng(0).random((len(strings), 2))
    hull.put_many(strings, places)
    np.testing.assert_array_equal(hull.positions(strings), places)
    assert hull.keys() == sorted(strings)
    numbers = [step * i for step in (2**32, 2**20, 1) for i in range(1, 700)]
    numbers = sorted(set(numbers))
    counted = make("int")
    counted.put_many(numbers, np.zeros((len(numbers), 2)))
    assert counted.keys() == numbers
    assert counted.remove_many(numbers[::2]) == len(numbers[::2])
    assert counted.keys() == numbers[1::2]
    counted.check()


def test_a_fleet_that_comes_and_goes(make):
    """The key table grows and shrinks, and strings of those who left make room."""
    random = np.random.default_rng(1)
    hull, model = make(), {}
    for day in range(9):
        keys = [f"{'flight' * (i % 9)} {day % 5} {i}" for i in random.permutation(3000)[: 100 + 150 * (day % 7)]]
        places = random.random((len(keys), 2))
        hull.put_many(keys, places, np.full(len(keys), float(day)))
        model.update(zip(keys, map(tuple, places.tolist()), strict=True))
        if day % 3 == 2:
            leaving = sorted(model)[:: 2 + day % 2]
            hull.remove_many(leaving)
            for key in leaving:
                del model[key]
        assert hull.keys() == sorted(model)
    hull.check()
    assert list(map(tuple, hull.positions(sorted(model)).tolist())) == [model[key] for key in sorted(model)]
    points = DynamicHull(list(model.values()))
    np.testing.assert_array_equal(hull.vertices(), points.vertices())
    assert [model[key] for key in hull.vertex_keys()] == list(map(tuple, points.vertices().tolist()))


def test_reads_are_those_of_a_hull(hull):
    points = DynamicHull([[0, 0], [4, 0], [0, 4]])
    assert hull.area == points.area
    assert hull.support([[1, 0]]).tolist() == [[4, 0]]
    assert hull.locate([[1, 1], [0, 0], [9, 9]]).tolist() == [1, 0, -1]
    assert (hull.count(4, 0), hull.count_many([[0, 4], [1, 1]]).tolist()) == (1, [1, 0])
    assert gjk.contact(hull, DynamicHull([[6, 0]])).distance == 2
    assert repr(hull).endswith("KeyedHull of 3 points, 3 vertices>")
    assert hull != points
    assert hull != type(hull)("int")


def test_equality_is_that_of_keys_places_and_times(make, hull):
    assert hull == KeyedHull.from_entities(["c", "a", "b"], [[0, 4], [0, 0], [4, 0]], [2, 1, nan])
    for keys, times in [(["a", "b", "d"], [1, nan, 2]), (["a", "b", "c"], [1, 1, 2]), (["a", "c", "b"], [1, nan, 2])]:
        assert hull != make.from_entities(keys, [[0, 0], [4, 0], [0, 4]], times)
    copy = hull.copy()
    copy.put("a", 1, 1, 1)
    assert hull != copy
    with pytest.raises(TypeError, match="unhashable"):
        hash(hull)


def test_pickles_pass_between_implementations(hull):
    hull.put("é", 9, 9)
    for other in KEYED_HULLS.values():
        states = pickle.loads(pickle.dumps(hull)).__getstate__()
        again = other.__new__(other)
        again.__setstate__(states)
        assert again == hull
        assert again.changes == hull.changes
        again.check()


def test_keys_of_unusual_memory(make):
    """Unaligned, read-only, of the other byte order, of a class of the caller's own."""
    unaligned = np.frombuffer(b"x" + np.arange(3, dtype=np.uint64).tobytes(), np.uint8)[1:].view(np.uint64)
    assert not unaligned.flags.aligned

    class Ids(np.ndarray):
        pass

    hull = make("int")
    for keys in (unaligned, np.arange(3, dtype=">u8"), np.arange(3, dtype=np.uint64).view(Ids)):
        hull.put_many(keys, [[0, 0], [1, 0], [0, 1]])
        assert hull.positions(keys).tolist() == [[0, 0], [1, 0], [0, 1]]
        assert hull.remove_many(keys) == 3

    class Names(PackedKeys):
        pass

    named = make()
    names = Names(b"\1\1", b"ab")
    named.put_many(names, [[0, 0], [1, 0]])
    assert named.remove_many(names) == 2
