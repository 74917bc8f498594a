"""FenceIndex from outside: areas, states, crossings, and what is refused."""

import pickle
import re
from functools import cache
from math import inf

import fence_oracle
import numpy as np
import pytest
from cases import slow
from hulls import KEYED_HULLS

from dynhull import Crossings, FenceIndex, _rings
from dynhull.keys import key_list

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
HOLE = [[1, 1], [2, 1], [2, 2], [1, 2]]

kinds = pytest.mark.parametrize("make", [kind for kind in KEYED_HULLS if kind != "python, tiny leaves"], indirect=True)


@pytest.fixture
def make(request):
    return KEYED_HULLS[request.param]


def rows(crossings):
    keys = crossings.keys.tolist() if isinstance(crossings.keys, np.ndarray) else list(crossings.keys)
    return [*zip(crossings.fences.tolist(), keys, crossings.changes.tolist(), crossings.causes.tolist(), strict=True)]


@kinds
def test_a_first_state_is_not_reported(make):
    hull = make.from_entities(["a", "b"], [[1, 1], [9, 9]])
    index = FenceIndex(hull)
    index.set_polygons(1, [[SQUARE]])
    assert list(index.inside(1)) == ["a"]
    assert rows(index.take()) == []
    hull.put_many(["a", "b", "c"], [[8, 8], [2, 2], [3, 3]])
    crossings = index.take()
    assert rows(crossings) == [(1, "a", -1, 1), (1, "b", 1, 1), (1, "c", 1, 4)]
    assert crossings.distances.tolist() == [np.hypot(4, 4), 0, 0]
    assert crossings.previous.tolist()[:2] == [[1, 1], [9, 9]]
    assert index.take() == index.take()


@kinds
@pytest.mark.parametrize("place", [(1, 1e-20), (1, 1e-150), (1e20, 2), (3, 1e-9)])
def test_a_distance_far_below_the_radius(make, place):
    """The rounded difference of distance and radius says nothing about it: the search begins far off, and ends."""
    x, y = place
    hull = make.from_entities(["a"], [[0, 0]])
    index = FenceIndex(hull)
    index.set_circle(1, 0, 0, x)
    hull.put("a", x, y)
    (distance,) = index.take().distances.tolist()
    assert distance == pytest.approx(y * y / (2 * x), rel=1e-15)


@kinds
def test_only_the_states_before_and_after_count(make):
    hull = make.from_entities([1, 2], [[1, 1], [9, 9]], key_type="int")
    index = FenceIndex(hull)
    index.set_circle(5, 0, 0, 2)
    hull.put(1, 7, 7)
    hull.put(1, 0, 1)
    hull.put(2, 0, 0)
    hull.remove(2)
    hull.put(3, 0, 0)
    hull.expire(0)
    hull.remove(3)
    index.set_circle(5, 8, 8, 2)
    index.set_circle(5, 0, 0, 2)
    assert rows(index.take()) == []
    hull.remove(1)
    hull.put(1, 5, 5)
    assert rows(index.take()) == [(5, 1, -1, Crossings.MOVED)]


@kinds
def test_causes(make):
    hull = make.from_entities(["a", "b", "c"], [[1, 1], [1, 2], [6, 6]], [1.0, 2.0, 3.0])
    index = FenceIndex(hull)
    index.set_polygons(1, [[SQUARE]])
    hull.expire(1)
    hull.remove("b")
    index.set_polygons(1, [[[[5, 5], [8, 5], [5, 8]]]])
    hull.put("d", 5, 5)
    assert rows(index.take()) == [
        (1, "a", -1, Crossings.EXPIRED | Crossings.AREA),
        (1, "b", -1, Crossings.REMOVED | Crossings.AREA),
        (1, "c", 1, Crossings.AREA),
        (1, "d", 1, Crossings.APPEARED | Crossings.AREA),
    ]
    hull.clear()
    assert rows(index.take()) == [(1, "c", -1, Crossings.REMOVED), (1, "d", -1, Crossings.REMOVED)]


@kinds
def test_a_margin_keeps_subjects_inside(make):
    hull = make.from_entities(["a"], [[2, 2]])
    index = FenceIndex(hull)
    index.set_polygons(1, [[SQUARE]], margin=1.0)
    for x, expected in ((5.0, []), (np.nextafter(5.0, 6.0), [-1]), (5.0, []), (4.0, [1]), (4.5, [])):
        hull.put("a", x, 2)
        assert index.take().changes.tolist() == expected


@kinds
def test_an_empty_area_is_infinitely_far(make):
    hull = make.from_entities(["a"], [[2, 2]])
    index = FenceIndex(hull)
    index.set_hull(1, [[2, 2]], margin=9.0)
    index.set_hull(1, np.empty((0, 2)), margin=9.0)
    crossings = index.take()
    assert rows(crossings) == [(1, "a", -1, Crossings.AREA)]
    assert crossings.distances.tolist() == [inf]


@kinds
def test_one_who_leaves_the_pack(make):
    hull = make.from_entities(["a", "b", "c", "d"], [[0, 0], [4, 0], [0, 4], [1, 1]])
    index = FenceIndex(hull)
    index.set_hull(1, hull.vertices(), margin=3.0, without_self=True, inside=["a", "b", "c", "d"])
    assert rows(index.take()) == [(1, "b", -1, Crossings.AREA), (1, "c", -1, Crossings.AREA)]
    hull.put("d", 3, 3)  # beyond the edge from b to c, but near the hull of the others
    assert rows(index.take()) == []
    hull.put("d", 9, 9)
    crossings = index.take()
    assert rows(crossings) == [(1, "d", -1, Crossings.MOVED | Crossings.AREA)]
    assert crossings.distances.tolist() == [np.sqrt(98)]


@kinds
def test_a_restored_fence_goes_on(make):
    hull = make.from_entities([1, 2, 3], [[1, 1], [4.5, 2], [9, 9]], key_type="int")
    index = FenceIndex(hull)
    index.set_polygons(1, [[SQUARE]], margin=1.0, inside=np.array([1, 2, 77], np.uint64))
    assert index.inside(1).tolist() == [1, 2]
    assert rows(index.take()) == []
    index.set_polygons(1, [[SQUARE]], margin=1.0, inside=[3])
    assert rows(index.take()) == [(1, 1, 1, Crossings.AREA), (1, 3, -1, Crossings.AREA)]


@kinds
def test_passing_through(make):
    hull = make.from_entities(["a", "b"], [[-1, 1], [-1, 4]])
    index = FenceIndex(hull)
    index.set_polygons(1, [[SQUARE, HOLE]], cross=True)
    index.set_polygons(2, [[SQUARE, HOLE]], cross=True, closed=False)
    index.set_polygons(3, [[SQUARE, HOLE]])
    hull.put_many(["a", "b"], [[9, 1], [9, 4]])
    crossings = index.take()
    assert rows(crossings) == [(1, "a", 0, 1), (1, "b", 0, 1), (2, "a", 0, 1)]
    assert crossings.distances.tolist() == [5, 5, 5]


@kinds
def test_a_fence_is_dropped(make):
    hull = make.from_entities(["b", "a"], [[1, 1], [1, 1]])
    index = FenceIndex(hull)
    index.set_circle(-7, 0, 0, 3)
    assert -7 in index
    assert "a" not in index
    assert list(index.drop(-7)) == ["a", "b"]
    assert len(index) == 0
    for method in (index.drop, index.inside, index.count):
        with pytest.raises(KeyError, match="there is no fence -7"):
            method(-7)


@kinds
def test_one_index_a_hull(make):
    hull = make.from_entities(["a"], [[1, 1]])
    index = FenceIndex(hull)
    with pytest.raises(ValueError, match="has an index of fences already"):
        FenceIndex(hull)
    index.set_circle(1, 0, 0, 3)
    copies = [hull.copy(), pickle.loads(pickle.dumps(hull))]
    index.detach()
    hull.put("a", 9, 9)
    for each in (hull, *copies):
        other = FenceIndex(each)
        other.set_circle(1, 0, 0, 3)
        assert list(other.inside(1)) == ([] if each is hull else ["a"])


@kinds
def test_a_hull_outlives_its_index(make):
    hull = make.from_entities(["a"], [[1, 1]])
    index = FenceIndex(hull)
    index.set_circle(1, 0, 0, 3)
    del index
    hull.put_many(["a", "b"], [[5, 5], [6, 6]])
    hull.remove("a")
    assert len(FenceIndex(hull)) == 0


BAD_POLYGONS = {
    "polygons must hold at least one polygon": [],
    "polygon 0 has no ring": [[]],
    "polygon 0 ring 0 has 2 distinct corners": [[[[0, 0], [1, 1], [0, 0], [1, 1]]]],
    "polygon 0 ring 0 has no area": [[[[0, 0], [1, 1], [3, 3]]]],
    "polygon 0 ring 0: edges 0 and 2 cross": [[[[0, 0], [4, 4], [4, 0], [0, 4]]]],
    "polygon 0 ring 0: edges 0 and 1 overlap": [[[[0, 0], [4, 0], [2, 0], [0, 4]]]],
    "polygon 0 ring 0: edges 0 and 2 touch": [[[[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]]]],
    "polygon 1 rings 0 and 1: edges 0 and 0 cross": [[SQUARE], [SQUARE, [[1, -1], [1, 1], [0.5, 1]]]],
    "polygon 0 rings 0 and 1: edges 0 and 0 overlap": [[SQUARE, [[1, 0], [2, 0], [2, 1]]]],
    "polygon 0 ring 1 is a hole that is not inside the exterior": [[SQUARE, [[5, 5], [6, 5], [5, 6]]]],
    "polygon 0 rings 1 and 2 are holes that overlap": [[[[-9, -9], [9, -9], [9, 9], [-9, 9]], SQUARE, HOLE]],
    "polygon 0 ring 0 row 1 is (nan, 0.0)": [[[[0, 0], [float("nan"), 0], [1, 1]]]],
    "polygon 0 ring 0 must have shape (n, 2)": [SQUARE],
}


@kinds
@pytest.mark.parametrize("message", BAD_POLYGONS)
def test_bad_polygons(make, message):
    index = FenceIndex(make.from_entities(["a"], [[1, 1]]))
    index.set_polygons(1, [[SQUARE]])
    with pytest.raises(ValueError, match=re.escape(message)):
        index.set_polygons(1, BAD_POLYGONS[message])
    assert list(index.inside(1)) == ["a"]
    assert len(index.take()) == 0


GOOD_POLYGONS = [
    [[SQUARE + SQUARE[:1]]],  # closed
    [[[[0, 0], [2, 0], [2, 0], [4, 0], [4, 4]]]],  # a corner twice, three on a line
    [[SQUARE, [[0, 2], [2, 1], [2, 3]]]],  # a hole that touches an edge
    [[SQUARE, [[0, 0], [2, 1], [1, 2]]]],  # and a corner
    [[[[0, 0], [9, 0], [9, 9], [0, 9]], [[1, 1], [3, 1], [3, 3]], [[3, 3], [5, 3], [5, 5]]]],  # holes that touch
    [[SQUARE], [SQUARE]],
]


@kinds
@pytest.mark.parametrize("polygons", GOOD_POLYGONS)
def test_good_polygons(make, polygons):
    index = FenceIndex(make())
    index.set_polygons(1, polygons)
    assert 1 in index


def comb(teeth):
    """A polygon whose upright edges are all at one height."""
    row = np.arange(4 * teeth)
    top = np.where((row % 4 == 1) | (row % 4 == 2), 6.0, 1.0)
    return np.vstack([np.column_stack([row // 2, top]), [[2 * teeth, -1], [0, -1]]])


def turned(corners):
    return corners @ np.array([[1.0, 1.0], [-1.0, 1.0]])


LARGE = {"upright": comb(60), "lying": comb(60)[:, ::-1], "diagonal": turned(comb(60))}


@cache
def among_long_edges(name):
    """Subjects at corners, in the middle of edges and beside corners, and the keys of those inside."""
    corners, rng = LARGE[name], np.random.default_rng(7)
    at = rng.integers(0, len(corners), 200)
    points = np.vstack([corners[at], (corners[at] + corners[at - 1]) / 2, corners[at] + rng.normal(size=(200, 2))])
    keys = [str(number) for number in range(len(points))]
    area = fence_oracle.Area(("polygons", [[corners.tolist()]]), closed=True)
    return points, keys, sorted(key for key, point in zip(keys, points.tolist(), strict=True) if area.holds(point))


@pytest.mark.every(3)
@kinds
@pytest.mark.parametrize("name", LARGE)
def test_subjects_among_long_edges(make, name):
    corners, (points, keys, expected) = LARGE[name], among_long_edges(name)
    index = FenceIndex(make.from_entities(keys, points))
    index.set_polygons(1, [[corners]])
    assert list(index.inside(1)) == expected
    hull = make.from_entities(keys, np.full((len(keys), 2), -1e6))
    index = FenceIndex(hull)
    index.set_polygons(1, [[corners]])
    hull.put_many(keys, points)
    assert list(index.take().keys) == expected


@kinds
@pytest.mark.parametrize("turn", [False, pytest.param(True, marks=slow)], ids=["upright", "lying"])
def test_subjects_on_one_line_leave_it(make, turn):
    """Many at one x have a zone of their own, which must not reach beyond what it was cut out of."""
    rng = np.random.default_rng(3)
    points = np.vstack([np.column_stack([np.full(4000, 10.0), rng.random(4000) * 20]), rng.random((500, 2)) * 100])
    far = np.vstack([np.column_stack([rng.random(4000) * 90, points[:4000, 1]]), points[4000:]])
    ways = [each[:, ::-1] if turn else each for each in (points, far)]
    hull = make.from_entities([str(number) for number in range(len(points))], ways[0])
    index = FenceIndex(hull)
    areas = {number: (float(x), float(x) + 5.0) for number, x in enumerate(range(2, 82, 8))}
    for number, (low, high) in areas.items():
        index.set_polygons(number, [[[[low, low], [high, low], [high, high], [low, high]]]])
    hull.put_many([str(number) for number in range(len(points))], ways[0])
    index.take()
    hull.put_many([str(number) for number in range(len(points))], ways[1])
    index.take()
    for number, (low, high) in areas.items():
        inside = np.flatnonzero(((ways[1] >= low) & (ways[1] <= high)).all(axis=1))
        assert list(index.inside(number)) == sorted(map(str, inside))


@kinds
def test_many_holes(make):
    places = [(float(x), float(y)) for x in range(30) for y in range(30)]
    holes = [[(x, y), (x + 0.5, y), (x, y + 0.5)] for x, y in places]
    exterior = [[-1, -1], [31, -1], [31, 31], [-1, 31]]
    index = FenceIndex(make.from_entities(["in", "on", "between"], [[7.1, 9.1], [7.5, 9], [7.6, 9.6]]))
    index.set_polygons(1, [[exterior, *holes]])
    assert list(index.inside(1)) == ["between", "on"]
    with pytest.raises(ValueError, match=r"ring 901 is a hole that is not inside"):
        index.set_polygons(1, [[exterior, *holes, [[40, 40], [41, 40], [40, 41]]]])
    with pytest.raises(ValueError, match=r"rings 38 and 901 are holes that overlap"):
        index.set_polygons(1, [[exterior, *holes, [[1.1, 7.1], [1.2, 7.1], [1.1, 7.2]]]])


def test_a_hole_that_leaves_through_a_corner_is_refused():
    """One of its edges is outside between two corners of the exterior; its corners are all on or inside of that."""
    exterior = [[0, 0], [8, 0], [8, 8], [5, 8], [4, 4], [3, 8], [0, 8]]
    index = FenceIndex(KEYED_HULLS["python"]())
    index.set_polygons(1, [[exterior, [[4, 4], [6, 2], [2, 2]]]])
    with pytest.raises(ValueError, match="not inside the exterior"):
        index.set_polygons(1, [[[[0, 0], [8, 0], [8, 8], [4, 4], [0, 8]], [[0, 8], [8, 8], [4, 1]]]])


@kinds
def test_bad_arguments(make):
    index = FenceIndex(make("int"))
    bad = [
        (ValueError, "margin is -1.0: must not be negative", lambda: index.set_circle(1, 0, 0, 1, margin=-1)),
        (ValueError, "margin", lambda: index.set_circle(1, 0, 0, 1, margin=inf)),
        (ValueError, "radius is -2.0: must not be negative", lambda: index.set_circle(1, 0, 0, -2)),
        (ValueError, "x", lambda: index.set_circle(1, inf, 0, 2)),
        (ValueError, "fence is 9223372036854775808", lambda: index.set_circle(2**63, 0, 0, 2)),
        (TypeError, "integer", lambda: index.set_circle("one", 0, 0, 2)),
        (ValueError, "inside row 0 is -1", lambda: index.set_circle(1, 0, 0, 2, inside=[-1])),
        (ValueError, "vertices row 0", lambda: index.set_hull(1, [[0, 0], [1, 1], [2, 0]])),
        (ValueError, "vertices row 0", lambda: index.set_hull(1, [[0, 0], [1, 0], [2, 0]])),
        (ValueError, "vertices row 2", lambda: index.set_hull(1, [[1, 0], [1, 1], [0, 0]])),
        (ValueError, "vertices row 0", lambda: index.set_hull(1, [[0, 0], [0, 0]])),
        (ValueError, "margin is 0.0: without_self needs", lambda: index.set_hull(1, [], without_self=True)),
        (ValueError, "closed", lambda: index.set_hull(1, [], without_self=True, closed=False, margin=1.0)),
    ]
    for error, message, call in bad:
        with pytest.raises(error, match=re.escape(message)):
            call()
    assert len(index) == 0


@pytest.mark.skipif(_rings.kernel is None, reason="there is no kernel")
def test_the_kernel_accepts_the_rings_that_the_reference_accepts(monkeypatch):
    """Rings on a small grid: most of them cross, touch, overlap or repeat corners."""
    random = np.random.default_rng(3)
    accepted = 0
    for _ in range(1000):
        ring = random.integers(0, 4, (random.integers(2, 7), 2)).astype(float)
        if random.random() < 0.3:
            ring = np.vstack([ring, ring[:1]])
        found = [_outcome(ring)]
        with monkeypatch.context() as context:
            context.setattr(_rings, "kernel", None)
            found.append(_outcome(ring))
        assert found[0] == found[1], ring
        accepted += isinstance(found[0], list)
    assert accepted > 100


def _outcome(ring):
    try:
        return [each.tolist() for each in _rings.as_polygons([[ring]])[0]]
    except ValueError as error:
        return str(error)


# Subjects that go over from one index to another


def same_fences(index):
    index.set_circle(1, 4, 4, 3, margin=1.0, cross=True)
    index.set_polygons(2, [[SQUARE, HOLE]], cross=True)
    index.set_polygons(3, [[SQUARE], [[[5, 0], [9, 0], [7, 9]]]], closed=False)


def columns(crossings):
    """The rows by fence and key, with NaN as None."""
    values = zip(
        rows(crossings),
        crossings.points.tolist(),
        crossings.previous.tolist(),
        crossings.distances.tolist(),
        strict=True,
    )
    return {(row[0], row[1]): (row[2:], *map(known, rest)) for row, *rest in values}


def known(values):
    return None if np.isnan(values).any() else values


@kinds
@pytest.mark.parametrize("key_type", ["str", "int"])
def test_who_changes_hulls_has_moved_as_in_one_hull(make, key_type):
    random = np.random.default_rng(7)
    keys = [f"é{i}" if key_type == "str" else i for i in range(6)]
    parts, whole = [make(key_type), make(key_type)], make(key_type)
    indexes, single = [FenceIndex(hull) for hull in parts], FenceIndex(whole)
    for index in (*indexes, single):
        same_fences(index)
    home, moves = {}, 0
    for _ in range(150):
        carried = {}
        for row in random.permutation(6)[: random.integers(1, 4)].tolist():
            key, place = keys[row], random.integers(0, 10, 2).tolist()
            old, new = home.get(key), int(random.integers(3))
            home[key] = new if new < 2 else None
            if old is not None and old != new:
                parts[old].remove(key)
            if new < 2:
                parts[new].put(key, *place)
                whole.put(key, *place)
            elif old is not None:
                whole.remove(key)
            if new < 2 and old not in (new, None):
                carried[key] = old
        if random.integers(5) == 0:
            center = random.integers(2, 7, 2).tolist()
            for index in (*indexes, single):
                index.set_circle(1, *center, 3, margin=1.0, cross=True)
        before = {(fence, key) for fence in (1, 2, 3) for key in key_list(single.inside(fence))}
        for source, target in ((0, 1), (1, 0)):
            given = [key for key, old in carried.items() if old == source]
            assert indexes[target].carry(indexes[source], keys).tolist() == [key in given for key in keys]
            assert not indexes[target].carry(indexes[source], keys).any()
        found = {**columns(indexes[0].take()), **columns(indexes[1].take())}
        expected = columns(single.take())
        stayed = {row for row, values in found.items() if values[0][0] == 2}
        assert stayed == {(fence, key) for fence, key in before - expected.keys() if key in carried}
        for row in stayed:
            assert found[row][0][1] & Crossings.MOVED
            assert found[row][2] is not None
        for row, values in expected.items():
            if row[1] in carried and not values[0][1] & Crossings.MOVED:  # at the same place, in another hull
                expected[row] = ((values[0][0], values[0][1] | Crossings.MOVED), *values[1:])
        assert {row: values for row, values in found.items() if row not in stayed} == expected
        moves += len(stayed)
        for fence in (1, 2, 3):
            parted = [key for index in indexes for key in key_list(index.inside(fence))]
            assert sorted(key_list(single.inside(fence))) == sorted(parted)
            assert single.count(fence) == indexes[0].count(fence) + indexes[1].count(fence)
    assert moves > 15


@kinds
def test_who_changes_hulls_is_new_in_fences_of_one_hull(make):
    yard, road = make.from_entities(["a", "b", "c"], [[1, 1], [9, 9], [-1, 5]]), make("str")
    before, after = FenceIndex(yard), FenceIndex(road)
    before.set_polygons(1, [[SQUARE]])
    after.set_polygons(2, [[SQUARE]], cross=True)
    after.set_hull(3, [], margin=0.5, without_self=True)
    yard.remove_many(["a", "b", "c"])
    road.put_many(["a", "b", "c"], [[1, 1], [2, 2], [5, -1]])
    assert after.carry(before, ["a", "c", "b", "d"]).tolist() == [True, True, True, False]
    found = after.take()
    assert rows(found) == [(2, "a", 1, Crossings.APPEARED), (2, "b", 1, Crossings.APPEARED)]
    assert np.isnan(found.previous).all()
    assert rows(before.take()) == [(1, "a", -1, Crossings.REMOVED)]
    assert after.take() == after.take()


@kinds
def test_who_has_expired_or_was_there_has_not_moved(make):
    yard, road = make.from_entities(["a", "b"], [[1, 1], [1, 1]], [1.0, 2.0]), make.from_entities(["b"], [[9, 9]])
    before, after = FenceIndex(yard), FenceIndex(road)
    for index in (before, after):
        index.set_polygons(1, [[SQUARE]])
    yard.expire(1.0)
    yard.remove("b")
    road.put_many(["a", "b"], [[2, 2], [2, 2]])
    assert not after.carry(before, ["a", "b"]).any()
    assert rows(after.take()) == [(1, "a", 1, Crossings.APPEARED), (1, "b", 1, Crossings.MOVED)]
    assert rows(before.take()) == [(1, "a", -1, Crossings.EXPIRED), (1, "b", -1, Crossings.REMOVED)]
    for wrong in (after, FenceIndex(make("int"))):
        with pytest.raises(ValueError, match="source must be the index of another hull"):
            after.carry(wrong, ["a"])


@kinds
def test_who_changes_hulls_twice_before_anybody_looks(make):
    hulls = [make.from_entities(["a"], [[1, 1]]), make("str"), make("str")]
    indexes = [FenceIndex(hull) for hull in hulls]
    for index in indexes:
        index.set_polygons(1, [[SQUARE]])
    for old, new in ((0, 1), (1, 2)):
        hulls[old].remove("a")
        hulls[new].put("a", 3, 3)
        assert indexes[new].carry(indexes[old], ["a"]).tolist() == [True]
    assert [rows(index.take()) for index in indexes] == [[], [], [(1, "a", 2, Crossings.MOVED)]]
    assert [index.count(1) for index in indexes] == [0, 0, 1]
