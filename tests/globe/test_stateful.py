"""Random lives of a hull on the globe, checked against a multiset and rational arithmetic after every step."""

from collections import Counter

import numpy as np
import oracle
import pytest
from cases import one_of
from globes import GEO_HULLS
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from dynhull import MissingPointError
from dynhull._globe import Gnomonic

lon = st.sampled_from([180.0, -180.0, 170.0, 190.0, -170.0, 0.0, 90.0, 135.0, 178.5])
lat = st.sampled_from([90.0, 80.0, 85.0, 70.0, 60.0, 89.999999, 75.5])
place = st.tuples(lon, lat)
center = st.sampled_from([(0.0, 90.0), (180.0, 80.0), (45.0, 89.0)])


class GlobeMachine(RuleBasedStateMachine):
    make = None

    @initialize(points=st.lists(place, max_size=20), center=center)
    def start(self, points, center):
        self.hull = self.make(points, center=center)
        self.model = Counter(points)
        self.vertices = self.expected()

    def expected(self):
        names = {}
        for pair in sorted(self.model, reverse=True):
            ((x, y),), _ = Gnomonic(self.hull.center).project(np.array([pair]))
            names[x.item(), y.item()] = pair
        ring = [names[corner] for corner in oracle.hull(names)]
        start = ring.index(min(ring)) if ring else 0
        return ring[start:] + ring[:start]

    def expect_change(self, changed):
        before, self.vertices = self.vertices, self.expected()
        assert changed == (before != self.vertices)

    @rule(p=place)
    def insert(self, p):
        changed = self.hull.insert(*p)
        self.model[p] += 1
        self.expect_change(changed)

    @precondition(lambda self: self.model)
    @rule(data=st.data())
    def delete(self, data):
        p = data.draw(st.sampled_from(sorted(self.model)))
        changed = self.hull.delete(*p)
        self.model -= Counter([p])
        self.expect_change(changed)

    @rule(p=place)
    def delete_missing(self, p):
        if p not in self.model:
            with pytest.raises(MissingPointError):
                self.hull.delete(*p)

    @rule(rows=st.lists(st.tuples(st.sampled_from([1, -1]), place), max_size=12))
    def apply(self, rows):
        """A delete takes what the batch inserts, whatever the order; the rest is ignored."""
        net = Counter(p for op, p in rows if op > 0)
        held = self.model + net
        removed = Counter(p for op, p in rows if op < 0) & held
        before = self.hull.changes
        applied = self.hull.apply([op for op, _ in rows], [p for _, p in rows], missing="ignore")
        assert applied == net.total() + removed.total()
        self.model = held - removed
        self.expect_change(self.hull.changes > before)

    @rule(center=center)
    def recenter(self, center):
        before = self.hull.changes
        self.hull.recenter(center)
        self.expect_change(self.hull.changes > before)

    @rule()
    def copy(self):
        self.hull = self.hull.copy()

    @invariant()
    def is_right(self):
        assert [tuple(row) for row in self.hull.vertices().tolist()] == self.vertices
        assert [tuple(row) for row in self.hull.points().tolist()] == sorted(self.model.elements())
        assert (len(self.hull), self.hull.distinct) == (self.model.total(), len(self.model))
        self.hull.check()


@pytest.mark.parametrize("kind", GEO_HULLS)
def test_random_lives(kind):
    machine = type("Machine", (GlobeMachine,), {"make": GEO_HULLS[kind]}).TestCase
    machine.settings = one_of(2, stateful_step_count=25)
    machine("runTest").runTest()
