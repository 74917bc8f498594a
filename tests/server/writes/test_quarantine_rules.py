"""The rules of a quarantine against the same rules in rational numbers, over random batches and many restarts."""

from fractions import Fraction

import numpy as np
import pytest
from cases import one_of
from hypothesis import given
from hypothesis import strategies as st
from quarantine_rules import SECOND, Model

from dynhull.keys import PackedKeys
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.contents.joining import in_one
from dynhull_server.state.errors import (
    InvalidBatchError,
    KeyMissingError,
    KeyRepeatedError,
    LimitExceededError,
    RefusedError,
)
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import FOREVER, NO_TIME, HullSettings, Kept, QuarantineRules, Window
from dynhull_server.storage.rows import chunks
from dynhull_server.storage.rows.encoding import decode, encode

START = 1_700_000_000 * SECOND
LIMITS = Limits(10, 40, 10, 10, 1000)
NONE = PackedKeys.pack([])


class Hull:
    """A hull with what the storage would keep of it."""

    def __init__(self, rules, **options):
        self.settings = HullSettings("str", quarantine=rules, **options)
        self.kept, self.records = Kept(), []
        self.state = HullState(LIMITS, self.settings, Kept(), 0.0)
        self.now = START

    def write(self, batch):
        return self.state.apply(Write("fleet", batch, self.now), 0.0, self.records)

    def put(self, rows, removes=(), **more):
        """Rows of a key, x, y and a time in seconds, or None for all."""
        keys, x, y, times = zip(*rows, strict=True) if rows else ((),) * 4
        batch = KeyedBatch(
            "str", PackedKeys.pack(keys), np.column_stack([x, y]).astype(float), PackedKeys.pack(removes)
        )
        if rows and times[0] is not None:
            batch.times = np.array([START + int(time * SECOND) for time in times])
        for name, value in more.items():
            setattr(batch, name, value)
        return self.write(batch)

    def ask(self, **what):
        return self.put([], **{name: PackedKeys.pack(keys) for name, keys in what.items()})

    def held(self):
        if self.state.quarantine is None:
            return {}
        found = self.state.quarantine.stored()
        return dict(zip(found.keys, zip(*found.points.T.tolist(), strict=True), strict=True)) if len(found) else {}

    def positions(self):
        found = self.state.entities()
        return dict(zip(found.keys, map(tuple, found.points.tolist()), strict=True))

    def snapshot(self):
        kept = self.state.kept()
        found, read = chunks.state_from(chunks.state(kept))
        found.contents = in_one(read(chunks.chunk(kept.contents, cut)) for cut in chunks.cuts(kept.contents))
        found.revision = kept.revision
        self.kept, self.records = found, []

    def restart(self):
        """Go on with what is read from the bytes that were written."""
        records = list(decode(encode(self.records), self.kept.revision + 1)) if self.records else []
        before = self.seen()
        kept = Kept(**{name: getattr(self.kept, name) for name in Kept.__slots__} | {"records": records})
        self.state = HullState(LIMITS, self.settings, kept, 0.0)
        assert self.seen() == before

    def seen(self):
        quarantine, counts = self.state.quarantine, self.state.counts
        rules = None if quarantine is None else (quarantine.rules, repr(quarantine.stored()), quarantine.whole())
        return counts.revision, self.positions(), self.state.vertices().tolist(), counts.held, counts.rules, rules


# Few places, so that equal areas and speeds at their limits are frequent.
coordinates = st.integers(0, 12).map(lambda number: number / 2) | st.sampled_from([0.1, 1e6, -3.0])
keys = st.sampled_from("abcdefg")


@st.composite
def batches(draw):
    rows = draw(st.lists(st.tuples(keys, coordinates, coordinates, st.integers(0, 9)), max_size=6))
    rows = list({row[0]: row for row in rows}.values())
    free = [key for key in "abcdefg" if all(key != row[0] for row in rows)]
    return rows, draw(st.lists(st.sampled_from(free), unique=True, max_size=1)) if free else []


@one_of(2)
@given(
    st.sampled_from([None, 0.5, 2.0, 0.1]),
    st.sampled_from([None, 1.0, 1.5, 4.0]),
    st.integers(0, 2),
    st.booleans(),
    st.lists(st.tuples(batches(), st.sampled_from(["", "", "restart", "snapshot"])), max_size=12),
)
def test_rules_equal_those_in_rational_numbers(speed, growth, confirmations, ordered, steps):
    rules = QuarantineRules(speed, growth, confirmations)
    hull, model = Hull(rules, by_event_time=ordered), Model(rules, ordered=ordered)
    for time, ((rows, removes), then) in enumerate(steps):
        later = [(key, x, y, time * 3 + more) for key, x, y, more in rows]
        known = set(hull.held()) | set(hull.positions())
        result = hull.put(later, removes)
        assert (list(result.held), result.released) == model.put(later, removes)
        assert result.missing == len(set(removes) - known)
        assert hull.positions() == {key: at[:2] for key, at in model.there.items()}
        assert hull.held() == {key: at[:2] for key, at in model.held.items()}
        assert hull.state.counts.held == len(model.held)
        if then == "snapshot":
            hull.snapshot()
        if then:
            hull.restart()


SQUARE = [("a", 0, 0, None), ("b", 10, 0, None), ("c", 10, 10, None), ("d", 0, 10, None)]


def test_growth_without_times_is_confirmed_by_the_next_position():
    hull = Hull(QuarantineRules(max_growth=2.0))
    assert not hull.put(SQUARE).held  # a hull without an area has nothing to grow from
    result = hull.put([("e", 5, 5, None), ("f", 1000, 5, None), ("a", 20, 20, None)])
    assert (result.held, result.inserted, result.points) == ([1], 1, 5)
    hull.restart()
    assert hull.put([("f", 1001, 5, None)]).released == 1
    assert hull.positions()["f"] == (1001, 5)
    assert hull.held() == {}


def test_speed_without_times_is_by_arrival():
    hull = Hull(QuarantineRules(max_speed=2.0))
    hull.put([("a", 0, 0, None)])
    hull.now += 10 * SECOND
    assert not hull.put([("a", 20, 0, None)]).held
    hull.now += SECOND
    assert hull.put([("a", 22.5, 0, None)]).held == [0]
    (speed,) = hull.state.quarantine.stored().speeds
    assert speed == 2.5
    hull.restart()
    hull.now += SECOND
    assert (hull.put([("a", 21, 0, None)]).dropped, hull.held()) == (1, {})


def test_released_and_dropped_by_hand():
    hull = Hull(QuarantineRules(max_growth=1.5, confirmations=0))
    hull.put(SQUARE)
    hull.put([("e", 99, 0, None), ("f", 0, 99, None), ("g", 99, 99, None)])
    hull.put([("e", 99, 1, None)])  # nothing is let in by itself
    result = hull.ask(releases=["g", "x", "e"], drops=["f"])
    assert (result.released, result.dropped, result.missing, result.inserted) == (2, 1, 1, 2)
    assert hull.held() == {}
    assert (hull.positions()["e"], hull.positions()["g"]) == ((99, 1), (99, 99))
    hull.restart()
    with pytest.raises(KeyRepeatedError, match="names a key once"):
        hull.ask(releases=["g"], drops=["g"])
    with pytest.raises(RefusedError, match="has no puts and removes"):
        hull.put(SQUARE, drops=PackedKeys.pack(["g"]))


def test_released_together_with_and_without_times():
    hull = Hull(QuarantineRules(max_growth=1.5))
    hull.put(SQUARE)
    hull.put([("e", 99, 0, None), ("a", -99, 0, None)])
    hull.put([("f", 0, 99, 7)])
    hull.restart()
    result = hull.ask(releases=["e", "f", "a"])
    assert (result.released, result.inserted, result.moved) == (3, 2, 1)
    assert hull.state.entities().times.tolist() == [NO_TIME] * 5 + [START + 7 * SECOND]
    hull.restart()


def test_a_key_that_is_only_held_can_be_removed():
    hull = Hull(QuarantineRules(max_growth=1.5))
    hull.put(SQUARE)
    hull.put([("e", 99, 0, None)])
    result = hull.put([], ["e"], refuse_missing=True)
    assert (result.deleted, result.missing, result.dropped, hull.held()) == (0, 0, 1, {})
    with pytest.raises(KeyMissingError):
        hull.put([], ["e"], refuse_missing=True)


def test_held_positions_leave_with_their_window_and_their_deadline():
    hull = Hull(QuarantineRules(max_growth=1.5), window=Window(max_age=20 * SECOND))
    hull.put(SQUARE)
    hull.now += 5 * SECOND
    hull.put([("e", 99, 0, None), ("f", 0, 99, None)])
    hull.put([("g", 99, 99, None)], ttl=SECOND)
    assert set(hull.held()) == {"e", "f", "g"}
    hull.now += 2 * SECOND
    hull.put([("d", 0, 9, None)])
    assert set(hull.held()) == {"e", "f"}
    hull.restart()
    hull.now += 14 * SECOND
    hull.state.expire(hull.now, hull.records)  # a, b and c, not yet those that are held
    assert (set(hull.positions()), set(hull.held())) == ({"d"}, {"e", "f"})
    hull.now += 5 * SECOND
    result = hull.ask(releases=["e"])
    assert (result.missing, result.late, result.inserted, hull.held()) == (1, 0, 0, {})
    hull.restart()


def test_a_release_that_comes_too_late_is_missing_and_not_late():
    hull = Hull(QuarantineRules(max_growth=1.5), window=Window(max_age=20 * SECOND))
    hull.put([("a", 0, 0, 0), ("b", 4, 0, 0), ("c", 0, 4, 0)])
    hull.put([("far", 90, 90, 0), ("near", 80, 80, 9)])
    assert sorted(hull.held()) == ["far", "near"]
    hull.now += 20 * SECOND
    found = hull.ask(releases=["far", "near"])
    assert (found.released, found.inserted, found.missing, found.late) == (1, 1, 1, 0)
    assert sorted(hull.positions()) == ["near"]


def test_rules_can_be_changed_and_switched_off():
    hull = Hull(None)
    hull.put([("a", 0, 0, 0), ("b", 1, 0, 0), ("c", 0, 1, 0)])
    hull.put([], rules=QuarantineRules(max_speed=1.0, confirmations=3))
    assert hull.put([("a", 5, 0, 1), ("b", 1, 1, 1)]).held == [0]
    hull.restart()
    hull.put([], rules=QuarantineRules())
    hull.restart()
    assert set(hull.held()) == {"a"}
    assert hull.put([("a", 9, 0, 2)]).dropped == 1
    assert (hull.positions()["a"], hull.held()) == ((9, 0), {})


def test_what_is_held_counts_for_the_limit():
    hull = Hull(QuarantineRules(max_growth=1.5))
    hull.put(SQUARE)
    hull.put([(f"far {i}", 99 + i, 0, None) for i in range(36)])
    with pytest.raises(LimitExceededError):
        hull.put([("one more", 5, 5, None)])
    assert hull.ask(drops=["far 3"]).dropped == 1
    assert hull.put([("one more", 5, 5, None)]).inserted == 1


def test_what_is_let_in_at_the_limit_was_counted_before():
    hull = Hull(QuarantineRules(max_growth=1.5))
    hull.put(SQUARE)
    hull.put([(f"far {i}", 99 + i, 0, None) for i in range(36)])
    assert hull.put([("far 3", 102.5, 0, None), ("a", -99, 0, None)]).released == 1
    assert hull.ask(releases=["far 4"]).released == 1
    assert hull.put([("one more", 5, 5, None)], ["far 5"]).inserted == 1
    with pytest.raises(LimitExceededError):
        hull.put([("and one more", 5, 5, None)], ["a stranger"])


def test_a_repeated_key_changes_nothing_although_one_of_its_rows_would_be_held():
    hull = Hull(QuarantineRules(max_growth=1.5))
    hull.put(SQUARE)
    before = hull.seen()
    with pytest.raises(KeyRepeatedError):
        hull.put([("e", 5, 5, None), ("e", 99, 99, None)])
    assert hull.seen() == before


def test_limits_are_exact_where_rounding_would_decide_otherwise():
    """One ulp beyond the limit of a speed and of an area, and values whose squares and products overflow."""
    hull = Hull(QuarantineRules(max_speed=0.1))
    hull.put([("a", 0, 0, 0), ("b", 0, 0, 0)])
    limit = 0.1 * 3  # above three times the double 0.1
    assert Fraction(limit) > 3 * Fraction(0.1)
    assert hull.put([("a", limit, 0, 3), ("b", np.nextafter(limit, 0), 0, 3)]).held == [0]
    hull = Hull(QuarantineRules(max_growth=3.0))
    hull.put([("a", 0, 0, None), ("b", 0.1, 0, None), ("c", 0, 0.1, None)])
    edge = 0.1 * 3
    assert hull.put([("d", edge, 0, None), ("e", np.nextafter(edge, 0), 0, None)]).held == [0]
    hull = Hull(QuarantineRules(max_speed=1e300, max_growth=1e9))
    hull.put([("a", -1e308, 0, 0), ("b", 1e308, 0, 0), ("c", 0, 1e308, 0)])
    assert hull.put([("a", 1e308, 1e308, 1), ("b", 1e308, -1e300, 1)]).held == [0]


@pytest.mark.parametrize("center", [None, (179.0, 0.0)])
def test_on_the_globe_in_metres(center):
    hull = Hull(QuarantineRules(max_speed=1000.0, max_growth=3.0), frame="geographic", center=center)
    hull.put([("a", 179, -1, 0), ("b", -179, -1, 0), ("c", 180, 1, 0)])
    assert hull.put([("a", 179.2, -1, 30), ("b", 180, 0, 30), ("c", -180, 1.2, 30)]).held == [1]
    assert (hull.state.quarantine.stored().speeds / 5241).round(2).tolist() == [1.0]
    assert hull.put([("d", 170, 0, 31), ("e", -178, 1, 31)]).held == [0]
    hull.restart()
    assert hull.put([("d", 170.1, 0, 100)]).released == 1


def test_a_held_position_may_be_out_of_reach_after_the_centre_has_moved():
    hull = Hull(QuarantineRules(max_growth=3.0), frame="geographic", center=(0.0, 0.0))
    hull.put([("a", 79, -1, 0), ("b", 81, -1, 0), ("c", 80, 1, 0)])
    assert hull.put([("d", -80, 0, 1), ("e", -80, 1, 1)]).held == [0, 1]
    hull.state.recenter((80.0, 0.0), hull.records)
    hull.restart()
    with pytest.raises(InvalidBatchError, match=r"releases row 1 is 'e', held at \(-80.0, 1.0\): .* from the centre"):
        hull.ask(releases=["f", "e"])
    assert hull.put([("d", -3, 0, 2)]).held == [0]  # a position that cannot be confirms nothing
    assert hull.put([("d", -3, 1, 3)]).released == 1
    assert (set(hull.positions()), set(hull.held())) == ({"a", "b", "c", "d"}, {"e"})


@pytest.mark.parametrize("size", [1e-7, 1e-10])
def test_growth_of_small_hulls_on_the_globe(size):
    hull = Hull(QuarantineRules(max_growth=3.0), frame="geographic")
    corners = [(8.0, 47.0), (8 + size, 47.0), (8 + size, 47 + size), (8.0, 47 + size)]
    hull.put([(key, *at, 0) for key, at in zip("abcd", corners, strict=True)])
    assert hull.put([("e", 8 + 1.9 * size, 47.0, 1), ("f", 8.2, 47.1, 1)]).held == [1]


@pytest.mark.parametrize("size", [1e-200, 5e-324, 1.0, 1e200])
@pytest.mark.filterwarnings("error")
def test_growth_by_any_area(size):
    """A factor of 1, and areas that overflow or vanish in floating point."""
    hull = Hull(QuarantineRules(max_growth=1.0))
    hull.put([("a", 0, 0, None), ("b", 8 * size, 0, None), ("c", 0, 8 * size, None)])
    beyond = np.nextafter(8 * size, np.inf)
    assert hull.put([("d", beyond, 0, None), ("e", size, size, None), ("f", 0, 8 * size, None)]).held == [0]


def test_held_rows_have_what_a_release_needs():
    hull = Hull(QuarantineRules(max_growth=1.5))
    hull.put(SQUARE)
    hull.put([("e", 99, 0, None)])
    found = hull.state.quarantine.stored()
    assert (found.times.tolist(), found.deadlines.tolist(), found.revisions.tolist()) == ([NO_TIME], [FOREVER], [2])
    assert np.isnan(found.speeds).all()
    assert found.growths.tolist() == [5.45]
    assert hull.state.quarantine.whole()
    assert hull.state.quarantine.page("e", 10)[0].keys == NONE
