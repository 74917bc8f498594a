"""Hulls and fences on the globe as the dashboard draws them, without a browser."""

import asyncio
import json

import numpy as np
import pytest
import shapely
from patience import until
from pyproj import Geod

from dynhull import GeoHull
from dynhull_client import AsyncHullClient, Circle, HullClient
from dynhull_dashboard.cards import table
from dynhull_dashboard.degrees import circle
from dynhull_dashboard.describe import describe, describe_key
from dynhull_dashboard.feed import HullFeed
from dynhull_dashboard.fence_feed import FenceFeed
from dynhull_dashboard.looks import Look
from dynhull_dashboard.search import State

LOOK = Look("#000000", (), "circle")


@pytest.fixture
def fiji(address: str, name: str) -> str:
    """A hull across 180 degrees, and a fence in it."""
    with HullClient(address) as client:
        client.create_hull(name, keyed="str", geographic=True, center=(179, -17))
        client.create_fence(f"{name}/zone", Circle(-179.75, -17, 20_000), name)
        client.put(name, ["a", "b", "c", "d"], [(177.5, -18), (-179.75, -17), (179.5, -16.25), (179.25, -17)])
    return name


def test_a_hull_across_180_degrees_is_drawn_in_one_piece(address: str, fiji: str) -> None:
    async def shown() -> None:
        async with AsyncHullClient(address) as client:
            feed = HullFeed(client, fiji)
            try:
                await until(lambda: feed.vertices == 3 and len(feed.drawings()[1].points) == 1)
                corners, inner = feed.drawings()
                assert corners.points.tolist() == [[180.25, -17], [179.5, -16.25], [177.5, -18]]
                assert corners.keys == ("b", "c", "a")
                assert inner.points.tolist() == [[179.25, -17]]
                assert feed.bounds == (177.5, -18, 180.25, -16.25)
                shown_table = table([(feed, LOOK)], True, "square units")
                assert " km²</td>" in shown_table
                assert "square units" not in shown_table
                assert "longitude from 177.5 to 180.25, latitude from -18 to -16.25" in describe([feed])
                await until(lambda: feed.search.find("b").state is State.VERTEX)
                assert (feed.search.find("b").x, feed.search.find("b").y) == (180.25, -17)
                assert describe_key("b", feed, feed.search.find("b"))[1] == "longitude 180.25, latitude -17, revision 1"
            finally:
                await feed.close()

    asyncio.run(shown())


@pytest.mark.parametrize(
    ("center", "places", "pole", "bounds"),
    [
        ((0, -90), [(-170, -70), (-60, -65), (40, -72), (150, -68)], "south", (-180, -90, 180, -65)),
        ((100, 80), [(-170, 70), (-60, 65), (40, 72), (150, 68)], "north", (-80, 65, 280, 90)),
        ((0, 60), [(170, 80), (-170, 80), (180, 70)], None, (-180, 70, 180, 80.15)),  # half a turn from the centre
    ],
)
def test_a_hull_with_a_pole_reaches_the_border_of_the_map(
    address: str, name: str, center, places, pole, bounds
) -> None:
    with HullClient(address) as client:
        client.create_hull(name, geographic=True, center=center)
        client.apply(name, insert=places)
        hull = client.get_hull(name)
        expected = GeoHull(places, center)
        assert sorted(hull.vertices.tolist()) == sorted(map(list, places))

    async def shown() -> None:
        async with AsyncHullClient(address) as client:
            feed = HullFeed(client, name)
            try:
                await until(lambda: feed.vertices == len(places))
                assert feed.bounds == pytest.approx(bounds, abs=0.01)
                rings = json.loads(feed.drawings()[0].message)["rings"]
                filled = shapely.union_all([shapely.Polygon(ring) for ring in rings])
                lon, lat = (each.ravel() for each in np.meshgrid(np.arange(-178.5, 180, 7), np.arange(-89, 90, 2.25)))
                inside = shapely.contains_xy(filled, lon - 360 * np.round((lon - center[0]) / 360), lat)
                assert inside.tolist() == expected.contains(np.column_stack([lon, lat])).tolist()
                assert (f"with the {pole} pole inside" in describe([feed])) == (pole is not None)
            finally:
                await feed.close()

    asyncio.run(shown())


def test_a_circle_of_metres_has_its_size_in_degrees(address: str, fiji: str) -> None:
    async def shown() -> None:
        async with AsyncHullClient(address) as client:
            feed = FenceFeed(client, f"{fiji}/zone")
            try:
                await until(lambda: feed.area.bounds is not None and json.loads(feed.marks.message)["x"] != [])
                assert feed.unit == " m"
                left, bottom, right, top = feed.area.bounds or (0.0, 0.0, 0.0, 0.0)
                assert (left + right) / 2 == pytest.approx(180.25)
                assert (top - bottom) / 2 == pytest.approx(20 / 111.2, rel=0.01)
                assert (right - left) / (top - bottom) == pytest.approx(1.0457, rel=0.01)  # 1 / cos(17 degrees)
                assert json.loads(feed.marks.message)["x"] == [180.25]
            finally:
                await feed.close()

    asyncio.run(shown())


def test_a_circle_around_a_pole_is_a_circle() -> None:
    corners = circle(Circle(10, 89.5, 150_000), on_globe=True)
    middle = np.tile([10, 89.5], (len(corners), 1))
    *_, metres = Geod(ellps="sphere").inv(*middle.T, *corners.T)
    assert metres == pytest.approx(150_000, rel=1e-5)
