"""The figures and the frame of a page, without a browser."""

import asyncio
import json
import math
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime

import grpc
import numpy as np
import pytest
from patience import until
from pyproj import Geod

from dynhull_client import AsyncHullClient, Circle, Fence, FenceEvent, HullClient, Polygon, Series
from dynhull_dashboard.advice import about_fences
from dynhull_dashboard.event_rows import MOST_EVENTS, EventRows
from dynhull_dashboard.feed import HullFeed
from dynhull_dashboard.fence_drawing import area_of
from dynhull_dashboard.outline import MOST_DRAWN, drawn
from dynhull_dashboard.past import past_rows
from dynhull_dashboard.repeating import pause_after
from dynhull_dashboard.server_lists import FenceList
from dynhull_dashboard.server_metrics import Scrape
from dynhull_dashboard.time_line import ROWS, TimeLine
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


def test_after_one_long_delay_the_figures_do_not_stand_still() -> None:
    assert pause_after(took=0.001, least=1.0) == 1.0
    assert pause_after(took=0.1, least=1.0) == pytest.approx(1.9), "a twentieth of the server's time"
    assert pause_after(took=2.0, least=1.0) == 5.0


def test_units_of_areas() -> None:
    assert [Units().area, Units("km", "km").area, Units("ms", "USD").area] == ["square units", "km²", "ms by USD"]


@pytest.mark.parametrize("vertices", [0, 1, MOST_DRAWN, MOST_DRAWN + 1, 10 * MOST_DRAWN])
def test_of_many_vertices_some_are_drawn(vertices: int) -> None:
    shown = len(range(vertices)[drawn(vertices)])
    assert shown == vertices if vertices <= MOST_DRAWN else MOST_DRAWN / 2 <= shown <= MOST_DRAWN


def test_a_time_line_keeps_the_latest_rows() -> None:
    line = TimeLine("time", "points")
    for row in range(ROWS + 10):
        line.append(row, -row)
    assert line.since(0)["time"] == [0, *range(10, ROWS + 10)]  # of what is older, a row every ten seconds
    assert line.since(ROWS + 8) == {"time": [ROWS + 8, ROWS + 9], "points": [-ROWS - 8, -ROWS - 9]}
    assert line.since(ROWS + 10)["time"] == []


def test_time_lines_begin_with_what_the_server_has_kept() -> None:
    """A line is level where the hull was unchanged."""
    minutes = np.array([0, 1, 21], "datetime64[m]").astype("datetime64[us]")
    floats = np.array([1e6, 2e6, 3e6])
    since = datetime(1970, 1, 1, 0, 0, 50, tzinfo=UTC)
    sizes = np.array([3, 4, 5], np.uint64), np.array([3, 4, 4], np.uint32)
    kept = Series("u", True, since, 60.0, minutes, minutes, np.array([1, 4, 10], np.uint64), *sizes, *4 * [floats])
    first, *rows = past_rows(kept, 1_260_000)
    assert first[:4] == (50_000, 3, 3, 1)
    assert rows == [(60_000, 4, 4, 2, 0.05), (1_200_000, 4, 4, 2, 0), (1_260_000, 5, 4, 3, 0.1)]
    line = TimeLine("time", "points", "vertices", "area", "rate")
    line.begin(past_rows(kept, 1_260_000))
    assert next(past_rows(kept, 2_260_000))[0] == 1_050_000  # by the dashboard's clock
    assert line.since(0)["time"] == []
    line.append(1_261_000, 5, 4, 3, 0)
    assert line.since(0)["time"] == [50_000, 60_000, 1_200_000, 1_260_000, 1_261_000]
    assert line.since(1)["time"] == []


def test_a_feed_has_a_past(address: str, name: str) -> None:
    with HullClient(address) as client:
        client.create_hull(name)
        client.apply(name, insert=[[0, 0], [4, 0], [0, 4]])

    async def shown() -> None:
        async with AsyncHullClient(address) as client:
            feed = HullFeed(client, name)
            try:
                await until(lambda: feed.time_line.length)
                lines = feed.time_line.since(0)
                assert len(lines["time"]) > feed.time_line.length
                assert (lines["points"][0], lines["area"][0]) == (3, 8)
            finally:
                await feed.close()

    asyncio.run(shown())


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
        expected=None,
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
    [[outer, inner]] = json.loads(drawn.message)["around"]
    assert max(x for x, _ in outer) == pytest.approx(9.5)
    assert max(x for x, _ in inner) == pytest.approx(0.5)


def test_a_circle_has_its_radius_and_its_margin() -> None:
    drawn = area_of("yard", fence(Circle(1, 2, 3), margin=1))
    assert drawn.bounds == pytest.approx((-3, -2, 5, 6), abs=0.001)


@pytest.mark.parametrize("place", [(180, -17), (10, 89.5), (13.4, 52.5)])
def test_a_margin_on_the_globe_has_its_metres(place: tuple[float, float]) -> None:
    drawn = area_of("yard", fence(Circle(*place, 100_000), margin=50_000), place)
    [[outer]] = json.loads(drawn.message)["around"]
    lon, lat = np.array(outer).T
    *_, metres = Geod(ellps="sphere").inv(np.full_like(lon, place[0]), np.full_like(lat, place[1]), lon, lat)
    assert metres == pytest.approx(150_000, rel=1e-3)
    assert (abs(lon - place[0]) <= 180).all()


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
        async with AsyncHullClient(address) as client:
            fences = FenceList(client, "")
            await until(lambda: fences.error is not None)
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
