"""Areas of many corners, polygons and holes: an event looks at what is nearby, and says what all of the area would."""

from time import thread_time

import fence_oracle
import numpy as np
import pytest
from hulls import KEYED_HULLS

from dynhull import FenceIndex, KeyedHull, convex_hull
from dynhull.globe import Boundary, distance

kinds = pytest.mark.parametrize("make", [kind for kind in KEYED_HULLS if kind != "python, tiny leaves"], indirect=True)


@pytest.fixture
def make(request):
    return KEYED_HULLS[request.param]


def coast(corners, size=100.0, seed=1):
    """A star-shaped polygon of that many corners around the origin."""
    angles = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    radii = size * (1 + 0.1 * np.sin(5 * angles) + np.random.default_rng(seed).random(corners) * 2 / corners)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


def staircase(steps):
    """A polygon between two stairs, with corners at integers: ways between such points often meet corners."""
    lower = [(x, y) for step in range(steps) for x, y in ((step, step), (step + 1, step))]
    upper = [(x, y + 4) for step in reversed(range(steps)) for x, y in ((step + 1, step + 1), (step, step + 1))]
    return [*lower, (steps, steps), *upper]


STAIRS = staircase(7)
# They touch the stairs, each other, and a diagonal way between.
HOLES = [[(k, k + 1), (k + 1, k + 1), (k + 1, k + 2), (k, k + 2)] for k in range(1, 6)]
ISLANDS = [[[(x, y), (x + 1, y), (x, y + 1)]] for x in range(0, 12, 2) for y in range(0, 15, 5)]
CIRCLE = [(round(4 * np.cos(a), 3) + 5, round(4 * np.sin(a), 3) + 5) for a in np.linspace(0, 2 * np.pi, 30, False)]
AREAS = {
    "stairs": ("polygons", [[STAIRS]]),
    "holes": ("polygons", [[STAIRS, *HOLES]]),
    "islands": ("polygons", ISLANDS),
    "hull": ("hull", convex_hull(CIRCLE).tolist()),
}


def lay(index, number, described, **options):
    kind, parts = described
    (index.set_hull if kind == "hull" else index.set_polygons)(number, parts, **options)


@pytest.mark.every(3)
@kinds
@pytest.mark.parametrize("described", AREAS.values(), ids=AREAS)
@pytest.mark.parametrize("closed", [True, False], ids=["closed", "open"])
def test_events_equal_those_of_rational_numbers(make, described, closed):
    random = np.random.default_rng(5)
    area = fence_oracle.Area(described, closed)
    places = np.vstack([random.integers(-1, 11, (14, 2)), np.round(random.random((4, 2)) * 10, 2)]).astype(float)
    keys = [f"{number:02}" for number in range(len(places))]
    hull = make.from_entities(keys, places)
    index = FenceIndex(hull)
    lay(index, 1, described, closed=closed, cross=True)
    seen = set()
    for _ in range(2):
        before, places = places, random.permutation(places)
        hull.put_many(keys, places)
        found = index.take()
        told = dict(zip(found.keys, zip(found.changes.tolist(), found.distances.tolist(), strict=True), strict=True))
        for key, p, q in zip(keys, before.tolist(), places.tolist(), strict=True):
            was, now = area.holds(p), area.holds(q)
            change = now - was if now != was else 0 if not was and p != q and area.meets(p, q) else None
            assert told.get(key, (None,))[0] == change, (p, q)
            if change is not None:
                assert area.is_rounded_distance(q, told[key][1]), (q, told[key])
                seen.add(change)
    assert seen


@kinds
def test_distances_far_off_and_at_odd_scales(make):
    """The tree around the edges rounds, and still no edge is left out that may be the nearest."""
    random = np.random.default_rng(8)
    for scale in (1.0, 1e-160, 1e160):
        corners = coast(60) * scale / 128
        area = fence_oracle.Area(("polygons", [[corners.tolist()]]), closed=True)
        index = FenceIndex(make())
        index.set_polygons(1, [[corners]])
        points = np.vstack([random.normal(size=(3, 2)), random.normal(size=(2, 2)) * 1e-9 + [0.9, 0]]) * scale
        for p, value in zip(points.tolist(), index.distances(1, points).tolist(), strict=True):
            assert area.is_rounded_distance(p, value), (scale, p)


@kinds
def test_distances_of_other_areas(make):
    index = FenceIndex(make.from_entities(["a", "b"], [[0, 0], [1, 1]]))
    index.set_circle(1, 0, 0, 2)
    index.set_hull(2, [[0, 0], [0, 4]])
    index.set_hull(3, [], margin=1)
    index.set_hull(4, [], margin=1.0, without_self=True)
    points = [[3, 4], [0, 1], [0, 2]]
    assert [index.distances(number, points).tolist() for number in (1, 2)] == [[3.0, 0.0, 0.0], [3.0, 0.0, 0.0]]
    assert index.distances(3, points).tolist() == [np.inf] * 3
    assert index.distances(1, np.empty((0, 2))).tolist() == []
    assert index.distances(4, [[0, 0], [1, 1], [3, 4]]).tolist() == [2**0.5, 2**0.5, 13**0.5]
    with pytest.raises(KeyError, match="there is no fence 5"):
        index.distances(5, points)
    with pytest.raises(ValueError, match=r"xy row 1 is \(nan, 0.0\)"):
        index.distances(1, [[0, 0], [np.nan, 0]])


def seconds_of_events(corners):
    """The least CPU time in which forty leave, go through and come back, of several."""
    hull = KeyedHull("int")
    hull.put_many(np.arange(40, dtype=np.uint64), np.zeros((40, 2)))
    index = FenceIndex(hull)
    index.set_polygons(1, [[coast(corners)]], cross=True)
    turns = np.linspace(0, 6, 40)[:, None]
    out = np.hstack([np.cos(turns), np.sin(turns)]) * 130
    least = np.inf
    for _ in range(5):
        spent = 0.0
        for places in (out, -out, out * 0):
            hull.put_many(np.arange(40, dtype=np.uint64), places)
            start = thread_time()
            found = index.take()
            spent += thread_time() - start
            assert len(found) == 40
        least = min(least, spent)
    return least


@pytest.mark.skipif("cpp" not in KEYED_HULLS, reason="the kernel is not built")
def test_an_event_does_not_look_at_all_corners():
    """A look at all of them makes it 500 times as slow for 1,000 times as many."""
    assert seconds_of_events(100_000) < 50 * seconds_of_events(100)


def rough_ring(corners, lon, lat, size):
    ring = coast(corners, 1.0) * size + [lon, lat]
    return np.column_stack([(ring[:, 0] + 180) % 360 - 180, np.clip(ring[:, 1], -90, 90)])


def test_distances_on_the_globe_look_at_all_that_is_near():
    """Rings of many edges, of the whole globe, at a pole and over 180 degrees, against each edge by itself."""
    random = np.random.default_rng(2)
    for ring in (rough_ring(700, 10, 50, 3), rough_ring(700, 179.9, -60, 20), rough_ring(700, 0, 89.9, 0.5)):
        center = ring.mean(axis=0)
        places = center + random.normal(size=(3, 2)) * 10
        places = np.column_stack([(places[:, 0] + 180) % 360 - 180, np.clip(places[:, 1], -90, 90)])
        pieces = [ring[start : start + 50] for start in range(0, 700, 49)]  # overlapping by an edge
        open_ways = np.min([distance(np.vstack([piece, piece[-2:0:-1]]), places) for piece in pieces], axis=0)
        closing = distance(ring[[-1, 0]], places)
        np.testing.assert_allclose(Boundary([ring]).distance(places), np.minimum(open_ways, closing), atol=1e-6)
    holes = [rough_ring(5, *at, 0.01) for at in random.random((60, 2)) * 5]
    places = random.random((5, 2)) * 7
    expected = np.min([distance(hole, places) for hole in holes], axis=0)
    np.testing.assert_allclose(Boundary(holes).distance(places), expected, atol=1e-6)
    assert Boundary([]).distance(places).tolist() == [np.inf] * 5
