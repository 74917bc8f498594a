"""Random lives of a hull, checked against a multiset and rational arithmetic after every step."""

from collections import Counter

import numpy as np
import oracle
import pytest
from hulls import HULLS
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from inputs import point, points


class HullMachine(RuleBasedStateMachine):
    make = None

    @initialize(rows=points(20))
    def start(self, rows):
        self.hull = self.make(rows)
        self.model = Counter((x + 0.0, y + 0.0) for x, y in rows)
        self.corners = oracle.hull(self.model)

    def expect_change(self, changed):
        before, self.corners = self.corners, oracle.hull(self.model.elements())
        assert changed == (before != self.corners)

    @rule(p=point)
    def insert(self, p):
        changed = self.hull.insert(*p)
        self.model[p[0] + 0.0, p[1] + 0.0] += 1
        self.expect_change(changed)

    @precondition(lambda self: self.model)
    @rule(data=st.data())
    def delete(self, data):
        p = data.draw(st.sampled_from(sorted(self.model)))
        changed = self.hull.delete(*p)
        self.model -= Counter([p])
        self.expect_change(changed)

    @precondition(lambda self: self.corners)
    @rule(data=st.data())
    def delete_a_vertex(self, data):
        p = data.draw(st.sampled_from(self.corners))
        changed = self.hull.delete(*p)
        self.model -= Counter([p])
        self.expect_change(changed)

    @rule(p=point)
    def delete_missing(self, p):
        if (p[0] + 0.0, p[1] + 0.0) not in self.model:
            with pytest.raises(KeyError):
                self.hull.delete(*p)

    @rule(rows=points(12))
    def insert_many(self, rows):
        before = self.hull.changes
        assert self.hull.insert_many(rows) == len(rows)
        self.model.update((x + 0.0, y + 0.0) for x, y in rows)
        self.expect_change(self.hull.changes > before)

    @rule(bad=st.sampled_from([np.nan, np.inf, "x", None]), p=point)
    def refuse(self, bad, p):
        with pytest.raises((ValueError, TypeError)):
            self.hull.insert_many([p, (0.0, bad)])

    @rule(q=point)
    def locate(self, q):
        assert self.hull.locate([q]).tolist() == [oracle.locate(self.corners, q)]
        assert ((q in self.hull) and 1) == ((q in self.model) and 1)

    @invariant()
    def the_hull_is_right(self):
        if hasattr(self, "hull"):
            self.hull.check()
            assert list(map(tuple, self.hull.vertices().tolist())) == self.corners
            assert len(self.hull) == self.model.total()
            assert self.hull.distinct == len(self.model)


def machine(make):
    case = type("Case", (HullMachine,), {"make": make}).TestCase
    case.settings = settings(stateful_step_count=40)
    return case


for _make in HULLS.values():
    globals()[f"Test{_make.__name__}"] = machine(_make)
