"""The figures and the frame of a page, without a browser."""

import asyncio
import json
import math
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime

import grpc
import numpy as np
import pytest
from patience import PATIENCE

from dynhull_client import AsyncHullClient, Circle, Fence, FenceEvent, Polygon
from dynhull_dashboard.advice import about_fences
from dynhull_dashboard.event_rows import MOST_EVENTS, EventRows
from dynhull_dashboard.fence_drawing import area_of
from dynhull_dashboard.fence_list import FenceList
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


def fence(*area: Polygon | Circle, margin: float = 0.0) -> Fence:
    """A fence around keys of a hull."""
    return Fence(
        name="yard",
        area=area[0] if isinstance(area[0], Circle) else area,
        subjects="fleet",
        other_hull=None,
        boundary="closed",
        margin=margin,
        near=0.0,
        initial="snapshot",
        crosses=False,
        dwell=None,
        confirmations=0,
        min_dwell=None,
        without_self=False,
        max_events=0,
        max_event_age=None,
        created=datetime(2026, 1, 1, tzinfo=UTC),
        uid="u",
        last_sequence=0,
        first_sequence=1,
        inside=0,
        subject_count=0,
        consumers=(),
    )


def ring(radius: float, corners: int) -> np.ndarray:
    angles = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def test_of_many_corners_some_are_drawn() -> None:
    shape = area_of("yard", fence(Polygon(ring(9, 90_000), (ring(2, 10_000), ring(1, 3)[::-1]))))
    assert shape.corners == 100_003
    assert MOST_DRAWN / 2 < shape.drawn <= MOST_DRAWN
    many = area_of("yard", fence(*(Polygon(ring(1, 3) + 3 * i) for i in range(10_000))))
    assert many.drawn <= MOST_DRAWN
    assert many.corners == 30_000


def test_the_margin_of_a_polygon_is_narrower_in_its_hole() -> None:
    hole = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    drawn = area_of("yard", fence(Polygon([[-9, -9], [9, -9], [9, 9], [-9, 9]], (hole,)), margin=0.5))
    assert drawn.bounds == pytest.approx((-9.5, -9.5, 9.5, 9.5))
    [[outer, inner]] = json.loads(drawn.message)["margin_xs"][0]
    assert max(outer) == pytest.approx(9.5)
    assert max(inner) == pytest.approx(0.5)


def test_a_circle_has_its_radius_and_its_margin() -> None:
    drawn = area_of("yard", fence(Circle(1, 2, 3), margin=1))
    assert drawn.bounds == pytest.approx((-3, -2, 5, 6), abs=0.001)


def test_the_list_has_the_newest_events() -> None:
    rows = EventRows("yard")
    for sequence in range(1, 3 * MOST_EVENTS):
        rows.add(
            FenceEvent("enter", sequence, "yard", "u", key=sequence, cause=frozenset(["area_moved", "subject_moved"]))
        )
    shown = json.loads(rows.message)["rows"]
    assert [row[3] for row in shown] == [str(each) for each in range(3 * MOST_EVENTS - 1, 2 * MOST_EVENTS - 1, -1)]
    assert shown[0][5] == "it moved and the area moved"
    before = rows.message
    assert rows.message is before
    rows.add(FenceEvent("lost", 900, "yard", "u", first=300, last=900))
    assert json.loads(rows.message)["rows"][0][2:5] == ["lost", "", "events 300 to 900"]


def test_a_server_older_than_fences_is_named_as_such() -> None:
    async def advice(address: str) -> str:
        async with AsyncHullClient(address) as client, asyncio.timeout(PATIENCE):
            fences = FenceList(client, "")
            while fences.error is None:
                await asyncio.sleep(0.01)
            await fences.close()
            return about_fences(address, fences, shown=False)

    older = grpc.server(ThreadPoolExecutor(1))  # without any service
    port = older.add_insecure_port("127.0.0.1:0")
    older.start()
    try:
        assert asyncio.run(advice(f"127.0.0.1:{port}")).startswith(
            "This server has no fences: it is older than they are."
        )
    finally:
        older.stop(None).wait()
