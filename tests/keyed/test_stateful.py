"""Random lives of a keyed hull, checked after every step against a dictionary and rational arithmetic."""

import pickle
from math import isnan, nan

import numpy as np
import oracle
import pytest
from cases import one_of
from hulls import KEYED_HULLS
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from inputs import point

from dynhull import DuplicateKeyError, MissingKeyError, Put
from dynhull._entities import Entities
from dynhull.keys import PackedKeys

KEYS = {
    "str": ["a", "b", "ab", "é", "日本", "\x00", "z" * 255, "\U0001f600", "ß", "aa"],
    "int": [0, 1, 2, 7, 2**32, 2**53 + 1, 2**63, 2**64 - 1],
}
moment = st.one_of(st.integers(-3, 9).map(float), st.sampled_from([5e-324, -1e300, 2.0**53, 0.5]))
only = st.sampled_from([None, None, "absent", "present"])


class KeyedMachine(RuleBasedStateMachine):
    make = None

    @initialize(key_type=st.sampled_from(["str", "int"]), ordered=st.booleans(), packs=st.booleans())
    def start(self, key_type, ordered, packs):
        self.hull = self.make(key_type, ordered=ordered)
        self.key_type, self.ordered, self.packs = key_type, ordered, packs
        self.model = {}  # key: (place, time)
        self.corners = []

    def expect_change(self, changed):
        before, self.corners = self.corners, oracle.hull([p for p, _ in self.model.values()])
        assert changed == (before != self.corners)

    def a_key(self, data):
        return data.draw(st.sampled_from(KEYS[self.key_type]))

    def some_keys(self, data, most=8):
        return data.draw(st.lists(st.sampled_from(KEYS[self.key_type]), max_size=most, unique=True))

    def a_time(self, data):
        return data.draw(moment if self.ordered else st.one_of(st.none(), moment))

    def passed(self, keys):
        """The keys in one of the forms in which a batch may come."""
        if self.key_type == "int":
            return np.array(keys, np.uint64) if len(keys) % 2 else keys
        return PackedKeys.pack(keys) if len(keys) % 2 else keys

    def put_into_model(self, key, p, time, only):
        time = nan if time is None else time
        held = self.model.get(key)
        if (only == "absent" and held) or (only == "present" and not held):
            return "skipped"
        if held and self.ordered and time < held[1]:
            return "stale"
        p = p[0] + 0.0, p[1] + 0.0
        self.model[key] = p, time
        return "new" if not held else "moved" if held[0] != p else "unmoved"

    @rule(data=st.data(), p=point, only=only)
    def put(self, data, p, only):
        key, time = self.a_key(data), self.a_time(data)
        changed = self.hull.put(key, *p, time, only=only)
        self.put_into_model(key, p, time, only)
        self.expect_change(changed)

    @rule(data=st.data(), only=only)
    def update(self, data, only):
        keys = self.some_keys(data)
        places = data.draw(st.lists(point, min_size=len(keys), max_size=len(keys)))
        times = data.draw(st.lists(moment, min_size=len(keys), max_size=len(keys)))
        if not self.ordered and data.draw(st.booleans()):
            times = None
        before = self.hull.changes
        counts = self.hull.update(self.passed(keys), places, times, only=only)
        rows = [self.put_into_model(*row, only) for row in zip(keys, places, times or [None] * len(keys), strict=True)]
        assert counts == Put(*map(rows.count, ("new", "moved", "unmoved", "stale", "skipped")))
        assert self.hull.changes - before <= 1
        self.expect_change(self.hull.changes > before)

    @precondition(lambda self: len(self.model) > 1)
    @rule()
    def go_round(self):
        """Every entity goes to where the next one was."""
        keys = sorted(self.model)
        places = [self.model[key][0] for key in keys[1:] + keys[:1]]
        before = self.hull.changes
        assert self.hull.put_many(self.passed(keys), places, [2.0**60] * len(keys)) == 0
        for key, place in zip(keys, places, strict=True):
            self.put_into_model(key, place, 2.0**60, None)
        self.expect_change(self.hull.changes > before)

    @precondition(lambda self: self.model)
    @rule(data=st.data())
    def remove(self, data):
        key = data.draw(st.sampled_from(sorted(self.model)))
        changed = self.hull.remove(key)
        del self.model[key]
        self.expect_change(changed)

    @rule(data=st.data())
    def remove_missing(self, data):
        key = self.a_key(data)
        if key not in self.model:
            for method in (self.hull.remove, self.hull.position):
                with pytest.raises(MissingKeyError) as refused:
                    method(key)
                assert (refused.value.key, refused.value.row) == (key, None)

    @rule(data=st.data(), ignore=st.booleans())
    def remove_many(self, data, ignore):
        keys = self.some_keys(data)
        gone = [key for key in keys if key in self.model]
        before = self.hull.changes
        if len(gone) < len(keys) and not ignore:
            with pytest.raises(MissingKeyError) as refused:
                self.hull.remove_many(self.passed(keys))
            row = next(row for row, key in enumerate(keys) if key not in self.model)
            assert (refused.value.key, refused.value.row) == (keys[row], row)
            return
        assert self.hull.remove_many(self.passed(keys), "ignore" if ignore else "raise") == len(gone)
        for key in gone:
            del self.model[key]
        self.expect_change(self.hull.changes > before)

    @rule(data=st.data(), p=point)
    def refuse(self, data, p):
        """A key twice, whether it is there or not; a place or a key that is bad."""
        keys = self.some_keys(data)
        if not keys:
            return
        first = data.draw(st.integers(0, len(keys) - 1))
        twice = [*keys, keys[first]]
        with pytest.raises(DuplicateKeyError) as refused:
            self.hull.put_many(self.passed(twice), [p] * len(twice), [1.0] * len(twice))
        assert (refused.value.key, refused.value.rows) == (keys[first], (first, len(keys)))
        with pytest.raises(DuplicateKeyError):
            self.hull.remove_many(self.passed(twice), "ignore")
        with pytest.raises(ValueError, match=rf"points row {len(keys) - 1} .*finite"):
            self.hull.put_many(keys, [p] * (len(keys) - 1) + [(0.0, nan)], [1.0] * len(keys))
        with pytest.raises(ValueError, match="times row 0 is nan"):
            self.hull.put_many(keys, [p] * len(keys), [nan] * len(keys))
        with pytest.raises(TypeError, match=rf"keys row {len(keys)} is None"):
            self.hull.put_many([*keys, None], [p] * (len(keys) + 1), [1.0] * (len(keys) + 1))

    @rule(until=moment)
    def expire(self, until):
        gone = [key for key, (_, time) in self.model.items() if time <= until]
        before = self.hull.changes
        assert self.hull.expire(until) == len(gone)
        for key in gone:
            del self.model[key]
        self.expect_change(self.hull.changes > before)

    @rule(count=st.integers(0, 5))
    def evict(self, count):
        def age(key):
            time = self.model[key][1]
            return (0, 0, key) if isnan(time) else (1, time, key)

        gone = sorted(self.model, key=age)[:count]
        before = self.hull.changes
        assert self.hull.evict(count) == len(gone)
        for key in gone:
            del self.model[key]
        self.expect_change(self.hull.changes > before)

    @rule(data=st.data())
    def ask(self, data):
        keys = self.some_keys(data)
        nothing = (nan, nan), nan
        held = [self.model.get(key, nothing) for key in keys]
        expected = np.array([p for p, _ in held]).reshape(-1, 2)
        np.testing.assert_array_equal(self.hull.positions(self.passed(keys)), expected)
        np.testing.assert_array_equal(self.hull.times(self.passed(keys)), [time for _, time in held])
        for key in keys:
            assert (key in self.hull) == (key in self.model)
            if key in self.model:
                assert self.hull.position(key) == self.model[key][0]

    def least(self, places):
        return [min((key for key, (q, _) in self.model.items() if q == p), default=None) for p in places]

    @rule(places=st.lists(point, max_size=4))
    def name_places(self, places):
        asked = places + [p for p, _ in self.model.values()]
        assert self.hull.keys_at(asked) == self.least(asked)

    @rule(how=st.sampled_from(["copy", "pickle", "from_entities"]))
    def become_another(self, how):
        old = self.hull
        if how == "from_entities":
            self.hull = self.make.from_entities(*old.entities(), self.key_type, ordered=self.ordered)
            self.hull._tree.changes = old.changes
        else:
            self.hull = old.copy() if how == "copy" else pickle.loads(pickle.dumps(old))
        assert self.hull == old
        assert (self.hull.key_type, self.hull.ordered) == (self.key_type, self.ordered)
        assert self.hull.changes == old.changes
        old.clear()
        assert len(old) == 0

    @rule()
    def clear(self):
        before = self.hull.changes
        self.hull.clear()
        self.model.clear()
        self.expect_change(self.hull.changes > before)

    @invariant()
    def the_hull_is_right(self):
        if not hasattr(self, "hull"):
            return
        self.hull.check()
        places = [p for p, _ in self.model.values()]
        assert list(map(tuple, self.hull.vertices().tolist())) == self.corners
        assert self.hull.vertex_keys() == self.least(self.corners)
        assert self.hull.points().tolist() == sorted(map(list, places))
        assert len(self.hull) == len(self.model)
        assert self.hull.keys() == sorted(self.model)
        times = [time for _, time in self.model.values() if not isnan(time)]
        assert self.hull.oldest() == min(times, default=None)
        if self.packs:  # so that every step finds them packed
            assert self.hull.pack() != isinstance(self.hull._tree, Entities)


def machine(make):
    case = type("Case", (KeyedMachine,), {"make": make}).TestCase
    case.settings = one_of(2, stateful_step_count=30)
    return case


for _name, _make in KEYED_HULLS.items():
    globals()[f"Test{_name.title().replace(', ', '').replace(' ', '')}"] = machine(_make)
