"""Projections and trees on the globe, on the kernel and in the reference: the same to the last bit, errors and all."""

import numpy as np
import pytest
from globes import around
from hypothesis import given
from hypothesis import strategies as st

from dynhull import _globe_tree, _kernel
from dynhull._globe import Gnomonic, parameters

longitudes = st.one_of(st.sampled_from([-360.0, -180.0, 0.0, 5e-324, 45.0, 90.0, 180.0, 360.0]), st.floats(-360, 360))
latitudes = st.one_of(st.sampled_from([-90.0, 0.0, 45.0, 90.0, 1e-300]), st.floats(-90, 90))


def assert_same_projection(center, places):
    frame = Gnomonic(center)
    expected, expected_near = frame._project(places)
    found, near = _kernel.gnomonic(places, parameters(center))
    assert near.tolist() == expected_near.tolist()
    assert found[near].tobytes() == expected[near].tobytes()
    assert np.isnan(found[~near]).all()


@given(st.tuples(longitudes, latitudes), st.lists(st.tuples(longitudes, latitudes), min_size=1, max_size=30))
def test_projections(center, places):
    assert_same_projection(center, np.array(places) + 0.0)


def test_many_projections():
    rng = np.random.default_rng(0)
    for _ in range(20):
        places = np.column_stack([rng.uniform(-360, 360, 10_000), rng.uniform(-90, 90, 10_000)])
        assert_same_projection((float(rng.uniform(-180, 180)), float(rng.uniform(-90, 90))), places)


class Both:
    """Two trees of one kind that are asked the same."""

    def __init__(self, kind, *arguments):
        self.reference, self.kernel = getattr(_globe_tree, kind)(*arguments), getattr(_kernel, kind)(*arguments)

    def __call__(self, method, *arguments):
        expected, answer = (outcome(getattr(each, method), *arguments) for each in (self.reference, self.kernel))
        if isinstance(expected, tuple):
            for one, other in zip(expected, answer, strict=True):
                np.testing.assert_equal(other, one)
        else:
            np.testing.assert_equal(answer, expected)
        assert type(answer) is type(expected)
        return answer

    def agree(self):
        for name in ("distinct", "changes", "center"):
            assert getattr(self.kernel, name) == getattr(self.reference, name), name
        assert len(self.kernel) == len(self.reference)
        points = self("points")
        self("vertices")
        asked = np.concatenate([points[::3], PAIRS[::5], np.minimum(points[::7] + np.array([0, 0.5]), [360, 90])])
        self("locate", asked)
        self("count_many", asked)
        self("count", *PAIRS[7].tolist())
        self("tangents", asked)
        self.kernel.check()


def outcome(action, *arguments):
    try:
        return action(*arguments)
    except (ValueError, TypeError, KeyError) as error:
        return type(error), str(error), error.args


# Around the north pole: many places under several names, and some that are too far from some centres.
PAIRS = np.array(
    [(lon, lat) for lat in (90.0, 85.0, 80.0, 70.0, 55.0, 5.0) for lon in (-180, -90, 0, 45, 180, 270, 360)]
)
CENTERS = [(0.0, 90.0), (180.0, 80.0), (10.0, 40.0)]
BAD = [[(0.0, 95.0)], [(400.0, 0.0)], [(np.nan, 0.0)], [(0.0, -80.0), (0.0, 91.0)], [1.0, 2.0], [("1", 2)]]


def batch(rng, most):
    pairs = PAIRS[rng.integers(0, len(PAIRS), rng.integers(0, most))]
    return np.where(rng.random(pairs.shape) < 0.9, pairs, pairs - rng.integers(0, 9, pairs.shape))


def bad(rng):
    return BAD[rng.integers(0, len(BAD))]


@pytest.mark.every(5)
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("center", [None, (0.0, 90.0)])
def test_trees(seed, center):
    rng = np.random.default_rng(seed)
    both = Both("GlobeTree", center)
    for step in range(60):
        both.agree()
        pairs = batch(rng, 40)
        match rng.integers(0, 9):
            case 0:
                both("insert", *PAIRS[rng.integers(0, len(PAIRS))].tolist())
            case 1:
                both("delete", *PAIRS[rng.integers(0, len(PAIRS))].tolist())
            case 2 | 3:
                both("apply", 1, pairs, False)
            case 4:
                both("apply", -1, pairs, bool(step % 2))
            case 5 | 6:
                both("apply", rng.choice([1, -1], len(pairs)).astype(np.int8), pairs, bool(rng.integers(0, 4)))
            case 7:
                both("recenter", CENTERS[rng.integers(0, 3)])
            case 8:
                both("apply", rng.choice([1, -1]).item(), bad(rng), True)
                both("insert", -361.0, 0.0)
                both("insert", 0.0, "1")
                both.kernel, both.reference = both.kernel.copy(), both.reference.copy()
                if rng.random() < 0.3:
                    both("clear")
    both.agree()


@pytest.mark.every(5)
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("key_type", ["str", "int"])
def test_entities(seed, ordered, key_type):
    rng = np.random.default_rng(seed)
    both = Both("GlobeEntities", key_type, ordered, None if seed % 2 else (0.0, 90.0))
    names = [f"key {i}" if key_type == "str" else i for i in range(60)]
    for _ in range(60):
        both.agree()
        both("vertex_keys")
        both("keys_at", PAIRS)
        both("positions", names)
        both("times", names)
        pairs = batch(rng, 30)
        keys = [names[i] for i in rng.choice(60, len(pairs), replace=False)]
        times = rng.integers(0, 20, len(pairs)).astype(float)
        only = [None, None, "absent", "present"][rng.integers(0, 4)]
        match rng.integers(0, 8):
            case 0 | 1 | 2:
                both("update", keys, pairs, times, only)
            case 3:
                both("put", names[0], *PAIRS[rng.integers(0, len(PAIRS))].tolist(), 9.0, only)
            case 4:
                both("remove_many", keys, True)
                both("remove", names[1])
            case 5:
                both("expire", float(rng.integers(-3, 12)))
                both("evict", 2)
            case 6:
                both("recenter", CENTERS[rng.integers(0, 3)])
            case 7:
                both("update", names[:2], bad(rng), [1.0, 2.0], only)
                both("update", [names[0], names[0]], PAIRS[-2:], [1.0, 2.0], only)
                both("put", names[0], 0.0, 91.0, 9.0, only)
                both("put", names[0], None, 91.0, 9.0, only)
                both.kernel, both.reference = both.kernel.copy(), both.reference.copy()
    keys, points, times = both.reference.entities()
    same_keys, same_points, same_times = both.kernel.entities()
    assert list(keys) == list(same_keys)
    np.testing.assert_equal((same_points, same_times), (points, times))


@pytest.mark.every(5)
@pytest.mark.parametrize("seed", range(16))
def test_windows(seed):
    rng = np.random.default_rng(seed)
    limits = (6.0, None) if seed % 3 == 0 else (None, 25) if seed % 3 == 1 else (8.0, 40)
    both = Both("GlobeWindowTree", *limits, None if seed % 2 else (0.0, 90.0))
    now = 0.0
    for _ in range(60):
        both.agree()
        both("times")
        points, times, latest, totals = both("state")
        pairs = batch(rng, 30)
        match rng.integers(0, 7):
            case 0 | 1 | 2:
                both("add", pairs, now + rng.integers(-9, 3, len(pairs)))
                now += 1.0
            case 3:
                both("advance", now)
                both("expire", now - 5.0)
            case 4:
                both("delete_many", pairs, bool(rng.integers(0, 4)))
                both("delete", *PAIRS[rng.integers(0, len(PAIRS))].tolist())
            case 5:
                both("recenter", CENTERS[rng.integers(0, 3)])
            case 6:
                both("add", bad(rng), [now] * 2)
                both("add", pairs, [np.nan] * len(pairs))
                if both.reference.center is not None:
                    new = Both("GlobeWindowTree", *limits, both.reference.center)
                    new("restore", points, times, latest, totals)
                    both = new
                both.kernel, both.reference = both.kernel.copy(), both.reference.copy()


def test_many_places():
    rng = np.random.default_rng(5)
    places = around(rng, (179.0, 60.0), 60, 30_000)
    places[::50] = (170.0, 90.0)
    both = Both("GlobeTree", (179.0, 60.0))
    for start in range(0, 20_000, 2_500):
        ops = np.repeat(np.array([1, -1], np.int8), [2_500, 1_000 if start else 0])
        both(
            "apply",
            ops,
            np.concatenate([places[start : start + 2_500], places[start - 2_500 : start - 2_500 + len(ops) - 2_500]]),
            False,
        )
    both.agree()
    both("locate", around(rng, (179.0, 60.0), 88, 20_000))
    both("recenter", (170.0, 70.0))
    both.agree()
