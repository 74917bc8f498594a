"""Random lives of a window, checked against a list and rational arithmetic after every step."""

import pickle
from math import inf, nextafter

import numpy as np
import oracle
import pytest
from cases import one_of
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from inputs import point, points
from windows import WINDOWS, Model, assert_as

# Times of one kind a life: close ones, neighbours around 1 and 2**53, negative, subnormal, very far apart, any.
CLOCKS = {
    "whole": st.integers(-10, 40).map(float),
    "neighbours": st.integers(-6, 6).map(lambda i: 1 + i * 2.0**-53),
    "large": st.integers(-20, 20).map(lambda i: 2.0**53 + i),
    "subnormal": st.integers(-9, 9).map(lambda i: i * 5e-324),
    "extreme": st.sampled_from([0.0, -0.0, 1.0, 5e-324, 1e300, -1e300, 1.7e308, -1.7e308, -1.0, 2.0**53]),
    "any": st.floats(allow_nan=False, allow_infinity=False),
}
AGES = st.sampled_from([5e-324, 2.0**-54, 2.0**-53, 0.1, 1.0, 3.0, 10.0, 1e300, 1.7e308])


class WindowMachine(RuleBasedStateMachine):
    make = None

    @initialize(age=AGES | st.none(), most=st.integers(1, 12) | st.none(), kind=st.sampled_from(sorted(CLOCKS)))
    def start(self, age, most, kind):
        most = 7 if age is None and most is None else most
        self.time = CLOCKS[kind]
        self.window = self.make(max_age=age, max_points=most)
        self.model = Model(age, most)

    def times_of(self, data, count, extra=()):
        time = self.time | st.sampled_from(extra) if extra else self.time
        return data.draw(st.lists(time, min_size=count, max_size=count))

    def edges(self):
        """Times at which a point of the window is just old enough to leave, or just not."""
        if self.model.max_age is None or self.model.now is None:
            return []
        edge = self.model.now - self.model.max_age
        return [t for t in (edge, nextafter(edge, inf), nextafter(edge, -inf)) if abs(t) < inf]

    def expect_one_change(self, update):
        corners, before = oracle.hull(self.model.points()), self.window.changes
        update()
        assert self.window.changes - before == (corners != oracle.hull(self.model.points()))

    @rule(data=st.data(), rows=points(10))
    def add(self, data, rows):
        times = self.times_of(data, len(rows), self.edges())
        self.expect_one_change(lambda: self.add_both(rows, times))

    @rule(data=st.data(), rows=points(10))
    def add_in_order(self, data, rows):
        times = sorted(self.times_of(data, len(rows)))
        self.expect_one_change(lambda: self.add_both(rows, times))

    def add_both(self, rows, times):
        assert self.window.add(rows, times) == self.model.add(rows, times)

    @rule(rows=points(10))
    def add_without_times(self, rows):
        if self.model.max_age is None:
            self.expect_one_change(lambda: self.add_both(rows, None))
        else:
            with pytest.raises(ValueError, match="times is None"):
                self.window.add(rows)

    @rule(data=st.data())
    def advance(self, data):
        (time,) = self.times_of(data, 1)
        if self.model.now is not None and time < self.model.now:
            with pytest.raises(ValueError, match="time does not go back"):
                self.window.advance(time)
        else:
            self.expect_one_change(lambda: self.advance_both(time))

    def advance_both(self, time):
        assert self.window.advance(time) == self.model.advance(time)

    @rule(data=st.data())
    def expire(self, data):
        (until,) = self.times_of(data, 1)
        self.expect_one_change(lambda: self.expire_both(until))

    def expire_both(self, until):
        assert self.window.expire(until) == self.model.expire(until)

    @precondition(lambda self: self.model.items)
    @rule(data=st.data())
    def delete(self, data):
        p = data.draw(st.sampled_from(sorted(self.model.points())))
        corners = oracle.hull(self.model.points())
        self.model.delete(p)
        assert self.window.delete(*p) == (corners != oracle.hull(self.model.points()))

    @rule(p=point)
    def delete_missing(self, p):
        if (p[0] + 0.0, p[1] + 0.0) not in self.model.points():
            with pytest.raises(KeyError):
                self.window.delete(*p)

    @rule(data=st.data(), missing=points(2))
    def delete_many(self, data, missing):
        present = [p for _, _, p in self.model.items]
        rows = data.draw(st.lists(st.sampled_from(present), max_size=6)) if present else []
        rows = data.draw(st.permutations(rows + missing))
        model = Model()
        model.items = list(self.model.items)
        found = [model.delete((x + 0.0, y + 0.0)) for x, y in rows]
        if not all(found):
            with pytest.raises(KeyError, match=f"row {found.index(False)}: "):
                self.window.delete_many(rows)
        self.expect_one_change(lambda: self.delete_both(rows, model, sum(found)))

    def delete_both(self, rows, model, found):
        assert self.window.delete_many(rows, missing="ignore") == found
        self.model.items = model.items

    @rule(bad=st.sampled_from([np.nan, np.inf, "x", None]), p=point, in_times=st.booleans())
    def refuse(self, bad, p, in_times):
        with pytest.raises((ValueError, TypeError)):
            self.window.add([p, p], [1e9, bad]) if in_times else self.window.add([p, (0.0, bad)], [1e9, 1e9])

    @rule(bad=st.sampled_from([np.nan, np.inf, -np.inf, "x", None]))
    def refuse_to_advance(self, bad):
        with pytest.raises((ValueError, TypeError)):
            self.window.advance(bad)
        with pytest.raises((ValueError, TypeError)):
            self.window.expire(bad)

    @rule(copied=st.booleans())
    def go_on_with_a_copy(self, copied):
        other = self.window.copy() if copied else pickle.loads(pickle.dumps(self.window))
        assert other == self.window
        assert other.changes == self.window.changes
        self.window.clear()
        self.window = other

    @precondition(lambda self: len(self.model.items) > 8)
    @rule()
    def clear(self):
        self.window.clear()
        self.model.items = []

    @invariant()
    def the_window_is_right(self):
        if hasattr(self, "window"):
            assert_as(self.window, self.model)


def machine(make):
    case = type("Case", (WindowMachine,), {"make": make}).TestCase
    case.settings = one_of(2, stateful_step_count=30)
    return case


for _make in WINDOWS.values():
    globals()[f"Test{_make.__name__}"] = machine(_make)
