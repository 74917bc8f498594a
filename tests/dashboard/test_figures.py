"""The figures and the frame of a page, without a browser."""

import math

import pytest

from dynhull_dashboard.history import ROWS, History
from dynhull_dashboard.outline import MOST_DRAWN, drawn, frame_around
from dynhull_dashboard.server_metrics import Scrape
from dynhull_dashboard.units import Units

PAGE = """# TYPE dynhull_updates counter
dynhull_updates_total{{operation="insert"}} {updates}
dynhull_updates_total{{operation="missing"}} 1000
# TYPE dynhull_batch_duration_seconds histogram
dynhull_batch_duration_seconds_bucket{{le="0.001"}} {fast}
dynhull_batch_duration_seconds_bucket{{le="0.002"}} {batches}
dynhull_batch_duration_seconds_bucket{{le="+Inf"}} {batches}
dynhull_batch_duration_seconds_count {batches}
dynhull_batch_duration_seconds_sum {seconds}
"""


def test_the_picture_stands_still_while_hulls_move_in_it() -> None:
    frame = frame_around([(0, 0, 10, 4), (5, 5, 6, 6)], None)
    assert frame == pytest.approx((-0.8, -0.8, 10.8, 6.8))
    assert frame_around([(1, 1, 9, 5)], frame) is frame
    assert frame_around([(1, 1, 11, 5)], frame) != frame, "a hull has left it"
    assert frame_around([(4, 4, 5, 5)], frame) != frame, "it has become too small to see"
    assert frame_around([], frame) is frame


def test_axes_of_different_units_each_fill_the_picture() -> None:
    wide = (0, 0, 1000, 1)
    frame = frame_around([wide], None, same_scale=False)
    assert frame == pytest.approx((-80, -0.08, 1080, 1.08))
    assert frame_around([wide], frame, same_scale=False) is frame
    assert frame_around([(0, 0, 1000, 0.1)], frame, same_scale=False) != frame, "one axis has become too short to see"
    assert frame_around([(0, 0, 1000, 0)], None, same_scale=False)[1] < 0 < frame[3]


def test_units_of_areas() -> None:
    assert [Units().area, Units("km", "km").area, Units("ms", "USD").area] == ["square units", "km²", "ms by USD"]


@pytest.mark.parametrize("at", [0.0, 7.0, -1e300])
def test_one_point_has_room_around_it(at: float) -> None:
    left, below, right, above = frame_around([(at, at, at, at)], None)
    assert left < at < right
    assert below < at < above


@pytest.mark.parametrize("vertices", [0, 1, MOST_DRAWN, MOST_DRAWN + 1, 10 * MOST_DRAWN])
def test_of_many_vertices_some_are_drawn(vertices: int) -> None:
    shown = len(range(vertices)[drawn(vertices)])
    assert shown == vertices if vertices <= MOST_DRAWN else MOST_DRAWN / 2 <= shown <= MOST_DRAWN


def test_a_history_keeps_the_latest_rows() -> None:
    history = History("time", "points")
    for row in range(ROWS + 10):
        history.append(row, -row)
    assert history.since(0)["time"] == list(range(10, ROWS + 10))
    assert history.since(ROWS + 8) == {"time": [ROWS + 8, ROWS + 9], "points": [-ROWS - 8, -ROWS - 9]}
    assert history.since(ROWS + 10)["time"] == []


def test_what_the_server_counts_as_rates() -> None:
    before = Scrape.read(PAGE.format(updates=100, fast=50, batches=60, seconds=0.05), 10.0)
    after = Scrape.read(PAGE.format(updates=400, fast=140, batches=160, seconds=0.25), 12.0)
    # Of 100 batches 90 took at most 1 ms, so the 99th lies nine tenths on the way to 2 ms.
    assert after.rates_since(before) == pytest.approx((150, 2, 1.9))
    assert all(map(math.isnan, before.rates_since(after))), "the server has begun anew"
