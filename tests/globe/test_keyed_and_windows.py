"""Entities and windows on the globe: random lives against a model and rational arithmetic, and what is refused."""

import copy
import pickle
from collections import Counter

import numpy as np
import oracle
import pytest
from cases import one_of
from globes import GEO_KEYED_HULLS, GEO_WINDOW_HULLS
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from dynhull import (
    DuplicateKeyError,
    FenceIndex,
    GeoKeyedHull,
    GeoWindowHull,
    KeyedHull,
    MissingKeyError,
    MissingPointError,
    WindowHull,
)
from dynhull._globe import Gnomonic

FIJI = [(177.4, -17.8), (178.4, -18.1), (-179.9, -16.8), (179.4, -16.4), (179.0, -17.2)]
NAMES = ["Nadi", "Suva", "Taveuni", "Labasa", "Levuka"]

lon = st.sampled_from([180.0, -180.0, 170.0, 190.0, -170.0, 0.0, 90.0, 135.0])
lat = st.sampled_from([90.0, 80.0, 85.0, 70.0, 60.0, 75.5])
place = st.tuples(lon, lat)
center = st.sampled_from([(0.0, 90.0), (180.0, 80.0), (45.0, 89.0)])
key = st.sampled_from(["a", "b", "c", "dd", "e", "é", "g", "h"])
moment = st.integers(-5, 5).map(float)


@pytest.fixture(params=GEO_KEYED_HULLS)
def keyed(request):
    return GEO_KEYED_HULLS[request.param]


@pytest.fixture(params=GEO_WINDOW_HULLS)
def windowed(request):
    return GEO_WINDOW_HULLS[request.param]


def expected_vertices(center, pairs):
    """By rational arithmetic on the projections."""
    names = {}
    for pair in sorted(set(pairs), reverse=True):
        ((x, y),), _ = Gnomonic(center).project(np.array([pair]))
        names[x.item(), y.item()] = pair
    ring = [names[corner] for corner in oracle.hull(names)]
    start = ring.index(min(ring)) if ring else 0
    return ring[start:] + ring[:start]


def rows(points):
    return [tuple(row) for row in points.tolist()]


class Machine(RuleBasedStateMachine):
    """A model of pairs; `changes` grows by one when the vertices of an update are others."""

    make = None

    def pairs(self):
        raise NotImplementedError

    def expect(self):
        before, self.vertices = self.vertices, expected_vertices(self.hull.center, self.pairs())
        before_changes, self.changes = self.changes, self.hull.changes
        assert self.changes - before_changes == (before != self.vertices)

    @rule(center=center)
    def recenter(self, center):
        self.hull.recenter(center)
        self.expect()

    @rule()
    def copy(self):
        twin = self.hull.copy()
        assert twin == self.hull
        self.hull = twin

    @invariant()
    def is_right(self):
        self.hull.check()
        assert rows(self.hull.vertices()) == self.vertices
        assert rows(self.hull.points()) == sorted(self.pairs())
        assert (len(self.hull), self.hull.distinct) == (len(self.pairs()), len(set(self.pairs())))
        asked = [*set(self.pairs()), (33.0, 66.0)]
        copies = Counter(self.pairs())
        assert self.hull.count_many(asked).tolist() == [copies[pair] for pair in asked]


class KeyedMachine(Machine):
    @initialize(center=center)
    def start(self, center):
        self.hull = self.make(center=center)
        self.model, self.vertices, self.changes = {}, [], 0

    def pairs(self):
        return [pair for pair, _ in self.model.values()]

    @rule(key=key, pair=place, time=st.none() | moment)
    def put(self, key, pair, time):
        before = self.hull.changes
        changed = self.hull.put(key, *pair, time)
        assert changed == (self.hull.changes > before)
        self.model[key] = pair, time
        self.expect()

    @rule(batch=st.dictionaries(key, st.tuples(place, moment), max_size=6), only=st.sampled_from([None, "absent"]))
    def update(self, batch, only):
        done = self.hull.update(list(batch), [p for p, _ in batch.values()], [t for _, t in batch.values()], only)
        there = {key for key in batch if key in self.model}
        written = {key: entity for key, entity in batch.items() if only is None or key not in there}
        moved = sum(key in there and self.model[key][0] != pair for key, (pair, _) in written.items())
        assert done == (len(batch) - len(there), moved, len(written) - len(batch) + len(there) - moved, 0,
                        len(batch) - len(written))  # fmt: skip
        self.model.update(written)
        self.expect()

    @rule(keys=st.sets(key, max_size=4))
    def remove(self, keys):
        assert self.hull.remove_many(sorted(keys), missing="ignore") == len(keys & set(self.model))
        for key in keys:
            self.model.pop(key, None)
        self.expect()

    @rule(until=moment)
    def expire(self, until):
        gone = [key for key, (_, time) in self.model.items() if time is not None and time <= until]
        assert self.hull.expire(until) == len(gone)
        for key in gone:
            del self.model[key]
        self.expect()

    @invariant()
    def names_are_right(self):
        assert self.hull.vertex_keys() == [
            min((key for key, (pair, _) in self.model.items() if pair == vertex), key=str.encode)
            for vertex in self.vertices
        ]
        assert self.hull.keys() == sorted(self.model, key=str.encode)
        places = [pair for _, (pair, _) in sorted(self.model.items(), key=lambda each: each[0].encode())]
        assert rows(self.hull.positions(self.hull.keys())) == places
        holders = [
            sorted(k for k, (pair, _) in self.model.items() if pair == p) for p in ((180.0, 90.0), (170.0, 80.0))
        ]
        assert self.hull.keys_at([(180, 90), (170, 80)]) == [
            min(each, key=str.encode, default=None) for each in holders
        ]


class WindowMachine(Machine):
    MAX_AGE, MAX_POINTS = 4.0, 12

    @initialize(center=center)
    def start(self, center):
        self.hull = self.make(max_age=self.MAX_AGE, max_points=self.MAX_POINTS, center=center)
        self.model, self.vertices, self.changes, self.now = [], [], 0, -np.inf  # pairs and times, oldest first

    def pairs(self):
        return [pair for pair, _ in self.model]

    def settle(self):
        self.model = [row for row in sorted(self.model, key=lambda row: row[1]) if row[1] > self.now - self.MAX_AGE]
        self.model = self.model[max(0, len(self.model) - self.MAX_POINTS) :]
        self.expect()

    @rule(batch=st.lists(st.tuples(place, st.integers(0, 40).map(float)), max_size=8))
    def add(self, batch):
        self.hull.add([p for p, _ in batch], [t for _, t in batch])
        self.now = max([self.now, *(time for _, time in batch)])
        self.model += batch
        self.settle()

    @rule(step=st.floats(0, 3))
    def advance(self, step):
        if np.isfinite(self.now):
            self.now += step
            self.hull.advance(self.now)
            self.settle()

    @rule(data=st.data())
    def delete(self, data):
        pair = data.draw(st.sampled_from(self.pairs()) if self.model else place)
        if pair in self.pairs():
            self.hull.delete(*pair)
            del self.model[self.pairs().index(pair)]
        else:
            with pytest.raises(MissingPointError):
                self.hull.delete(*pair)
        self.expect()

    @rule(asked=st.lists(place, max_size=5))
    def delete_many(self, asked):
        removed = Counter(asked) & Counter(self.pairs())
        assert self.hull.delete_many(asked, missing="ignore") == removed.total()
        for pair in removed.elements():
            del self.model[self.pairs().index(pair)]
        self.expect()

    @invariant()
    def times_are_right(self):
        assert list(zip(rows(self.hull.points()), self.hull.times().tolist(), strict=True)) == sorted(self.model)
        points, times = self.hull.oldest_first()
        assert sorted(zip(rows(points), times.tolist(), strict=True)) == sorted(self.model)
        assert times.tolist() == sorted(times.tolist())


@pytest.mark.parametrize("kind", GEO_KEYED_HULLS)
def test_random_lives_of_entities(kind):
    live(KeyedMachine, GEO_KEYED_HULLS[kind])


@pytest.mark.parametrize("kind", GEO_WINDOW_HULLS)
def test_random_lives_of_windows(kind):
    live(WindowMachine, GEO_WINDOW_HULLS[kind])


def live(machine, make):
    case = type("Lives", (machine,), {"make": staticmethod(make)}).TestCase
    case.settings = one_of(2, stateful_step_count=20)
    case("runTest").runTest()


def test_entities_that_share_a_place_under_two_names(keyed):
    hull = keyed(center=(175, 0))
    hull.put_many(["b", "a", "c", "d"], [(180, 0), (-180, 0), (170, 5), (170, -5)])
    assert hull.vertices().tolist() == [[-180, 0], [170, 5], [170, -5]]
    assert hull.vertex_keys() == ["a", "c", "d"]
    changes = hull.changes
    assert hull.put("a", 180, 0)  # the vertex stays where it is, and has another name
    assert hull.changes == changes + 1
    assert hull.vertices().tolist() == [[170, -5], [180, 0], [170, 5]]
    assert hull.vertex_keys() == ["d", "a", "c"]
    assert not hull.put("a", 180, 0, 5.0)
    assert hull.remove("c")
    assert not hull.remove("a")
    assert hull.keys_at([(180, 0), (-180, 0)]) == ["b", None]


def test_a_far_row_changes_nothing(keyed):
    hull = keyed()
    with pytest.raises(ValueError, match="the mean direction of the first points"):
        hull.put_many(["a", "b", "c"], [(0, 0), (90, 0), (180, 0)])
    with pytest.raises(DuplicateKeyError):
        hull.put_many(["a", "a"], [(0, 0), (1, 0)])
    assert hull.center is None
    assert hull.locate([(0, 0)]).tolist() == [-1]
    hull.put_many(NAMES, FIJI)
    assert 178 < hull.center[0] < 180
    before = hull.copy()
    message = r"points row 1 is \(0\.0, 0\.0\): 1\d\d\.\d+ degrees from the centre \(.*\); a hull reaches 85 degrees"
    for only in (None, "absent", "present"):
        with pytest.raises(ValueError, match=message):
            hull.update(["Nadi", "far"], [(177, -17), (0, 0)], only=only)
    with pytest.raises(ValueError, match=r"the point is \(0\.0, 0\.0\)"):
        hull.put("far", 0, 0)
    with pytest.raises(ValueError, match="a latitude must be from -90 to 90"):
        hull.put("far", 0, 91)
    with pytest.raises(ValueError, match=r"points row 0 is \(361\.0, 0\.0\): a longitude must be"):
        hull.put_many(["far"], [(361, 0)])
    with pytest.raises(ValueError, match="points must have one row for each key: 1, got 2"):
        hull.put_many(["far"], [(0, 0), (0, 91 - 1)])
    with pytest.raises(MissingKeyError):
        hull.remove("far")
    with pytest.raises(ValueError, match="points row 0 is"):
        hull.recenter((0, 0))
    assert hull == before
    assert hull.changes == before.changes
    assert len(hull.vertex_keys()) == len(hull.vertices())


def test_a_far_row_of_a_window_changes_nothing(windowed):
    window = windowed(max_age=10.0)
    with pytest.raises(ValueError, match="the mean direction of the first points"):
        window.add([(0, 0), (90, 0), (180, 0)], [1.0, 2.0, 3.0])
    assert window.center is None
    assert window.now is None
    window.add(FIJI, [5.0] * 5)
    before = window.copy()
    with pytest.raises(ValueError, match=r"points row 1 is \(0\.0, 0\.0\)"):  # also if it is late
        window.add([(178, -17), (0, 0)], [20.0, 1.0])
    with pytest.raises(ValueError, match=r"points row 0 is \(0\.0, 95\.0\): a latitude"):
        window.add([(0, 95)], [20.0])
    assert window.delete_many([(0, 0)], missing="ignore") == 0
    with pytest.raises(MissingPointError, match=r"row 1: point \(0\.0, 0\.0\)"):
        window.delete_many([FIJI[0], (0, 0)])
    assert window == before
    assert window.now == 5.0


def test_measures_and_maps(keyed, windowed):
    fleet, window = keyed(), windowed(max_points=5)
    fleet.put_many(NAMES, FIJI)
    window.add(FIJI)
    for hull in (fleet, window):
        assert 2.1e10 < hull.area < 2.2e10
        assert hull.geojson()["type"] == "MultiPolygon"
        assert hull.distance([(177.4, -17.8), (0, 0)])[0] == 0
        assert hull.tangents([(170, -17)]).tolist() == [[[179.4, -16.4], [178.4, -18.1]]]


def test_as_values():
    fleet, window = GeoKeyedHull("int", ordered=True, center=(190, 0)), GeoWindowHull(max_age=9.0)
    fleet.put_many([7, 5, 9], FIJI[:3], [1.0, 2.0, 3.0])
    window.add([*FIJI, FIJI[0]], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    for hull in (fleet, window):
        back = pickle.loads(pickle.dumps(hull))
        assert back == copy.deepcopy(hull) == hull
        assert (back.changes, back.center, repr(back)) == (hull.changes, hull.center, repr(hull))
        assert np.array_equal(back.vertices(), hull.vertices())
        back.recenter((170, 0))
        assert back != hull
    assert GeoKeyedHull.from_entities(*fleet.entities(), "int", ordered=True, center=(190, 0)) == fleet
    plane = KeyedHull.from_entities(*fleet.entities(), "int", ordered=True)
    assert plane != fleet
    assert fleet != plane
    young = WindowHull(max_age=9.0)
    young.add(*window.oldest_first())
    assert young != window
    with pytest.raises(ValueError, match="a window needs at least one"):
        GeoWindowHull()
    with pytest.raises(ValueError, match="key_type must be"):
        GeoKeyedHull("float")
    with pytest.raises(TypeError, match="GeoKeyedHull"):
        FenceIndex(fleet)
