"""Random lives of fences, whose crossings are compared with a model that decides by rational arithmetic."""

from math import isnan

import fence_oracle
import numpy as np
import oracle
import pytest
from cases import one_of
from hulls import KEYED_HULLS
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from dynhull import FenceIndex
from dynhull.keys import PackedKeys

KEYS = {"str": ["a", "b", "ab", "é", "日本", "z" * 255, "\U0001f600"], "int": [0, 1, 7, 2**53 + 1, 2**63, 2**64 - 1]}
FENCES = [-(2**63), -1, 0, 5, 2**63 - 1]
# What the small integers of the shapes below become. On all of these, the shapes stay valid.
SCALES = {
    "integers": lambda k: float(k),
    "tenths": lambda k: k * 0.1,
    "tiny": lambda k: k * 5e-324,
    "near underflow": lambda k: k * 1e-160,
    "huge": lambda k: (k - 6) * 1.4e307,
    "next to each other": lambda k: 1.0 + k * 2.0**-52,
    "far and near": lambda k: (k - 6) ** 5 * 1e30,
}
SQUARE = [(0, 0), (4, 0), (4, 4), (0, 4)]
SHAPES = {
    "triangle": [[[(0, 0), (5, 1), (2, 4)]]],
    "square, clockwise": [[SQUARE[::-1]]],
    "bay": [[[(0, 0), (6, 0), (6, 6), (0, 6), (0, 4), (4, 4), (4, 2), (0, 2)]]],
    "ring": [[[(0, 0), (6, 0), (6, 6), (0, 6)], [(2, 2), (4, 2), (4, 4), (2, 4)]]],
    "two holes": [[[(0, 0), (6, 0), (6, 6), (0, 6)], [(1, 1), (2, 1), (1, 2)], [(4, 4), (4, 5), (5, 5)]]],
    "a hole that touches": [[[(0, 0), (6, 0), (6, 6), (0, 6)], [(0, 3), (3, 2), (3, 4)]]],
    "two that overlap": [[SQUARE], [[(2, 2), (6, 2), (6, 6), (2, 6)]]],
    "two that share an edge": [[SQUARE], [[(4, 0), (6, 0), (6, 4), (4, 4)]]],
    "one in the hole of another": [
        [[(0, 0), (6, 0), (6, 6), (0, 6)], [(1, 1), (5, 1), (5, 5), (1, 5)]],
        [[(2, 2), (4, 2), (4, 4), (2, 4)]],
    ],
}
number = st.integers(0, 12)
place = st.tuples(number, number)


class FenceMachine(RuleBasedStateMachine):
    make = None

    @initialize(
        key_type=st.sampled_from(["str", "int"]), scale=st.sampled_from([*SCALES]), born=st.lists(place, max_size=6)
    )
    def start(self, key_type, scale, born):
        self.key_type, self.scale = key_type, SCALES[scale]
        self.hull = self.make(key_type)
        self.model = fence_oracle.Model()
        for key, p in zip(KEYS[key_type], born, strict=False):
            self.move([(key, p)], 0)
        self.model.before = dict(self.model.places)
        self.index = FenceIndex(self.hull)

    def at(self, p):
        return self.scale(p[0]), self.scale(p[1])

    def move(self, rows, time):
        self.hull.put_many([key for key, _ in rows], [self.at(p) for _, p in rows], [time] * len(rows))
        for key, p in rows:
            self.model.put(key, self.at(p))

    def some_keys(self, data):
        return data.draw(st.lists(st.sampled_from(KEYS[self.key_type]), max_size=5, unique=True))

    @rule(data=st.data(), time=st.integers(0, 9))
    def put_many(self, data, time):
        keys = self.some_keys(data)
        self.move([(key, data.draw(place)) for key in keys], float(time))

    @rule(data=st.data(), p=place)
    def put(self, data, p):
        key = data.draw(st.sampled_from(KEYS[self.key_type]))
        self.hull.put(key, *self.at(p))
        self.model.put(key, self.at(p))

    @rule(data=st.data())
    def remove(self, data):
        keys = self.some_keys(data)
        self.hull.remove_many(keys, missing="ignore")
        for key in keys:
            if key in self.model.places:
                self.model.remove(key, 8)

    @rule(data=st.data())
    def remove_one(self, data):
        if self.model.places:
            key = data.draw(st.sampled_from(sorted(self.model.places)))
            self.hull.remove(key)
            self.model.remove(key, 8)

    @rule(until=st.integers(0, 9), count=st.integers(0, 2), expire=st.booleans())
    def expire(self, until, count, expire):
        if expire:
            self.hull.expire(until)
        else:
            self.hull.evict(count)
        for key in [key for key in self.model.places if key not in self.hull]:
            self.model.remove(key, 16)

    @rule(sure=st.integers(0, 5))
    def clear(self, sure):
        if sure == 0:
            self.hull.clear()
            for key in [*self.model.places]:
                self.model.remove(key, 8)

    @rule(
        data=st.data(),
        fence=st.sampled_from(FENCES),
        kind=st.sampled_from(["polygons", "polygons", "circle", "hull", "own", "subjects' hull"]),
        closed=st.booleans(),
        margin=st.sampled_from([0, 0, 1, 3]),
        cross=st.booleans(),
        restored=st.sampled_from([False, False, False, True]),
    )
    def set(self, data, fence, kind, closed, margin, cross, restored):
        margin = abs(self.scale(margin) - self.scale(0))
        own = kind == "own" and margin > 0
        closed = closed or own
        inside = self.some_keys(data) if restored else None
        common = {"closed": closed, "margin": margin, "cross": cross, "inside": inside}
        if kind == "polygons":
            dx, dy = data.draw(st.tuples(st.integers(0, 6), st.integers(0, 6)))
            shape = SHAPES[data.draw(st.sampled_from([*SHAPES]))]
            described = [[[self.at((x + dx, y + dy)) for x, y in ring] for ring in polygon] for polygon in shape]
            try:
                self.index.set_polygons(fence, described, **common)
            except ValueError:
                assert self.scale in (SCALES["tenths"], SCALES["far and near"], SCALES["near underflow"])
                return
            described = ("polygons", described)
        elif kind == "circle":
            center, radius = self.at(data.draw(place)), abs(self.scale(data.draw(number)) - self.scale(0))
            self.index.set_circle(fence, *center, radius, **common)
            described = ("circle", center, radius)
        else:
            points = [self.at(p) for p in data.draw(st.lists(place, max_size=7))]
            vertices = oracle.hull(self.model.places.values() if kind == "subjects' hull" else points)
            self.index.set_hull(fence, np.reshape(vertices, (-1, 2)), without_self=own, **common)
            described = ("hull", vertices)
        self.model.set(fence, fence_oracle.Fence(described, closed, margin, cross, own), inside)

    @rule(data=st.data())
    def drop(self, data):
        if self.model.fences:
            fence = data.draw(st.sampled_from(sorted(self.model.fences)))
            assert self.listed(self.index.drop(fence)) == self.model.drop(fence)

    @rule()
    def take(self):
        expected = self.model.take()
        crossings = self.index.take()
        assert len(crossings) == len(expected)
        rows = zip(
            crossings.fences.tolist(),
            crossings.changes.tolist(),
            crossings.causes.tolist(),
            self.listed(crossings.keys),
            strict=True,
        )
        assert [*rows] == [row[:4] for row in expected]
        for row, (*_, p, previous, area) in enumerate(expected):
            same(crossings.points[row], p)
            same(crossings.previous[row], previous)
            if area is None:
                assert isnan(crossings.distances[row])
            else:
                assert area.is_rounded_distance(p, float(crossings.distances[row]))
        assert len(self.index.take()) == 0

    @rule()
    def look(self):
        if hasattr(self.index._fences, "check"):
            self.index._fences.check()
        assert len(self.index) == len(self.model.fences)
        for fence in FENCES:
            assert (fence in self.index) == (fence in self.model.fences)
        for fence, keys in self.model.inside.items():
            assert self.listed(self.index.inside(fence)) == sorted(keys)
            assert self.index.count(fence) == len(keys)

    def teardown(self):
        if hasattr(self, "index"):
            self.take()
            self.look()
            self.hull.check()

    def listed(self, keys):
        assert isinstance(keys, PackedKeys if self.key_type == "str" else np.ndarray)
        return list(keys) if self.key_type == "str" else keys.tolist()


def same(row, p):
    if p is None:
        assert np.isnan(row).all()
    else:
        assert tuple(row.tolist()) == p


@pytest.mark.timeout(600)
@pytest.mark.parametrize("kind", [kind for kind in KEYED_HULLS if kind != "python, tiny leaves"])
def test_lives(kind):
    machine = type("Machine", (FenceMachine,), {"make": KEYED_HULLS[kind]}).TestCase
    machine.settings = one_of(2, stateful_step_count=25)
    machine().runTest()
