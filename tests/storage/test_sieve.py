"""A fence after the fact makes the same events where only those moves are looked at that may mean something."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from folders import same
from hypothesis import given
from hypothesis import strategies as st

from dynhull.keys import PackedKeys
from dynhull_server.engine.past_fences import _Batches, _ReadHull, _Run
from dynhull_server.state.fences.index import cells
from dynhull_server.state.fences.index.cells import GONE, IN, NEAR, OUT, cells_of
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig, PolygonArea
from dynhull_server.state.fences.past import PastFence
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import CommitStamp, HullRow, HullSettings, Kept, KeyRows, Record
from dynhull_server.storage.of_keys import ways_of
from dynhull_server.storage.segments import parquet
from dynhull_server.storage.segments.columns import columns_of

LIMITS = Limits(10, 1000, 10, 10, 10**6)
BEGIN, SECOND = 10**15, 10**6
HULLS = HullSettings("str"), HullSettings("int")


def ring(*corners):
    return np.array(corners, np.float64).tobytes()


AREAS = {
    "disk": CircleArea(0.5, 0.0, 2.5),
    "square": PolygonArea(((ring([-2, -2], [2, -2], [2, 2], [-2, 2]),),)),
    "holed": PolygonArea(
        (
            (ring([-3, -3], [3, -3], [3, 3], [-3, 3]), ring([-1, -1], [-1, 1], [1, 1], [1, -1])),
            (ring([3, 3], [5, 3], [4, 5]),),
        )
    ),
    "thin": PolygonArea(((ring([-4, 0], [4, 0.001], [4, 0.002]),),)),
}
FENCES = st.builds(
    FenceConfig,
    st.sampled_from(list(AREAS.values())),
    st.just("hull"),
    st.just("hull"),
    closed=st.booleans(),
    margin=st.sampled_from([0.0, 0.0, 1.0, 0.3]),
    initial=st.sampled_from(["snapshot", "events", "none"]),
    crosses=st.booleans(),
    dwell=st.sampled_from([0, 0, 2 * SECOND]),
    confirmations=st.sampled_from([0, 0, 2]),
    min_dwell=st.sampled_from([0, 0, 3 * SECOND]),
)
STEPS = st.lists(
    st.tuples(
        st.sampled_from(["put"] * 6 + ["near"] * 6 + ["remove", "both", "nothing", "ttl"]),
        st.integers(0, 255),  # which of eight keys
        st.integers(0, 2**16),  # where to
        st.integers(0, 3),  # the seconds until then
    ),
    min_size=4,
    max_size=40,
)


def lived(hull, steps):
    """The records of a hull to which these steps have happened."""
    kind = PackedKeys.pack if hull.identity == "str" else lambda keys: np.array(keys, np.uint64)
    records, time = [], BEGIN
    places = np.zeros((8, 2))
    for what, which, where, wait in steps:
        time += wait * SECOND
        rows = np.flatnonzero([which >> bit & 1 for bit in range(8)]) if what != "nothing" else np.arange(0)
        random = np.random.default_rng(where)
        there = places[rows] + random.integers(-1, 2, (len(rows), 2)) * 0.5 if what == "near" else None
        places[rows] = random.integers(-10, 11, (len(rows), 2)) * 0.5 if there is None else there
        keys = [f"key {row}" for row in rows] if hull.identity == "str" else rows.tolist()
        puts = 0 if what == "remove" else len(rows) // 2 if what == "both" else len(rows)
        deadlines = np.full(puts, time + 10**9 * SECOND) if what == "ttl" and puts else None
        change = KeyRows(kind(keys[:puts]), places[rows[:puts]], kind(keys[puts:]), deadlines=deadlines)
        clock = time if any(each.clock for each in records) or deadlines is not None else None
        revision = len(records) + 1
        commit = CommitStamp(revision - (wait == 0), time)
        records.append(Record(revision, change, clock=clock, cause="batch", committed=commit))
    return records


class Past:
    """Reads records, in stretches of some size."""

    def __init__(self, hull, records, stretch, *, in_file):
        self.hull, self.records, self.stretch, self.in_file = hull, records, stretch, in_file
        self.sifted = 0

    def batches(self, _, after, until):
        return [dataclasses.replace(each) for each in self.records[after : min(after + 3, until)]]

    def ways(self, _, after, until, read):
        last = min(until, (after // self.stretch + 1) * self.stretch)
        some = columns_of(self.records[last - min(self.stretch, last) : last + 2], self.hull.identity)
        if self.in_file:
            ways = parquet.ways_from_parquet(parquet.to_parquet(some, {}), "a file", after, last)
        else:
            ways = ways_of(some.between(after, last))
            ways = None if ways is None else iter([ways])
        self.sifted += ways is not None
        return last, None if ways is None else read(ways)

    def erasures(self, _):
        return ()


def events(hull, config, past, after, until, *, sifted):
    """The events of a fence from one revision to another one, and the hull at the end."""
    state = HullState(LIMITS, hull, Kept(records=past.records[:after]), 0.0)
    read = _ReadHull(HullRow(1, "hull", "uid", BEGIN / SECOND, hull), state, ())
    checked = SimpleNamespace(require_room=lambda _: None)
    begin = past.records[after - 1].committed.time if after else BEGIN
    run = _Run(checked, PastFence(config, [read], begin, None), [_Batches(past, read, until)], None, leads=True)
    if not sifted:
        run._sieve = None
    assert not sifted or run._sieve is not None
    found = []
    while not run.over:
        found += run.step()
    return found, state


@given(
    hull=st.sampled_from(HULLS),
    config=FENCES,
    steps=STEPS,
    after=st.integers(0, 10),
    stretch=st.integers(1, 20),
    in_file=st.booleans(),
)
def test_the_events_are_the_same(hull, config, steps, after, stretch, in_file):
    records = lived(hull, steps)
    after = min(after, len(records))
    past = Past(hull, records, stretch, in_file=in_file)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cells, "CELLS", 64)
        patch.setattr(parquet, "GROUP_ROWS", 8)
        patch.setattr(parquet, "SHARED", 10**9)
        plain, one = events(hull, config, past, after, len(records), sifted=False)
        sifted, other = events(hull, config, past, after, len(records), sifted=True)
    same(sifted, plain)
    assert other.counts.revision == one.counts.revision
    assert other.vertices().tolist() == one.vertices().tolist()
    assert past.sifted or after == len(records) or any(each.clock for each in records)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", AREAS)
@pytest.mark.parametrize("margin", [0.0, 0.25])
def test_the_sides_of_points_are_exact(name, margin):
    """Also of those next to the boundary."""
    config = FenceConfig(AREAS[name], "hull", "hull", margin=margin)
    grid = cells_of(config)
    random = np.random.default_rng(1)
    exact = random.integers(-12, 13, (3000, 2)) * 0.5
    x, y = np.concatenate([exact, np.nextafter(exact, 9), np.nextafter(exact, -9), random.uniform(-6, 6, (20000, 2))]).T
    sides = grid.sides(x, y)
    assert sides.tolist() == grid._exact(np.column_stack([x, y])).tolist()
    assert {OUT, IN} <= set(sides.tolist())
    assert (NEAR in sides) == bool(margin)
    assert grid.sides(np.array([np.nan]), np.array([np.nan])).tolist() == [GONE]
    for far in (1e300, -1e300):
        assert grid.sides(np.array([far, 0.0]), np.array([0.0, far])).tolist() == [OUT, OUT]


def test_what_is_too_small_or_too_far_away_has_no_cells():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    areas = [CircleArea(0.0, 0.0, 0.0), CircleArea(1e300, 0.0, 1e308), CircleArea(1e12, 0.0, 0.1)]
    areas.append(PolygonArea(((ring(*(square * 1e-3 + 1e12)),),)))
    for area in areas:
        assert cells_of(FenceConfig(area, "hull", "hull")) is None


@pytest.mark.parametrize("name", sorted(AREAS))
@pytest.mark.parametrize("margin", [0.0, 0.3])
def test_what_is_in_a_box_that_stays_on_a_side_is_on_that_side(name, margin):
    cells = cells_of(FenceConfig(AREAS[name], "hull", "hull", margin=margin))
    random = np.random.default_rng(17)
    count, many = 20_000, 8
    middles = random.uniform(-7, 7, (count, 1, 2))
    points = middles + random.uniform(-1, 1, (count, many, 2)) * 10.0 ** random.uniform(-5, -1, (count, 1, 1))
    points[::50, 0] = np.nan
    x, y = points[..., 0], points[..., 1]
    boxes = [(each.min(axis=1), each.max(axis=1)) for each in (x, y)]
    sides = cells.sides(x.ravel(), y.ravel()).reshape(count, many)
    alike = (sides == sides[:, :1]).all(axis=1) & (sides[:, 0] != NEAR) & (sides[:, 0] != GONE)
    stays = cells.stays(*boxes, crosses=False)
    assert not (stays & ~alike).any()
    assert {OUT, IN} <= set(sides[stays, 0].tolist()) or name == "thin"
    assert stays.sum() > 0.7 * alike.sum()
    through = cells.stays(*boxes, crosses=True)
    assert not (through & ~stays).any()
    passes = cells.passes(x.ravel(), y.ravel())
    outside = through & (sides[:, 0] == OUT)
    for step in range(many - 1):
        assert not passes[step::many][:count][outside].any()
    assert outside.sum() > 0.5 * (alike & (sides[:, 0] == OUT)).sum()
