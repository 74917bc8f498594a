"""Parts of the dashboard's page, in a real browser: figures, areas and margins, hulls on the globe."""

import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import grpc
import numpy as np
import pytest
import shapely
from dashboard_process import dashboard_process, opened
from playwright.sync_api import Browser, Page, expect
from pyproj import Geod

from dynhull import GeoHull
from dynhull_client import Circle, HullClient
from dynhull_gateway.page import PageSettings

pytestmark = pytest.mark.long  # first, so that one worker, and one browser, has all of them
MOST_DRAWN, MOST_EVENTS = 2_000, 100
SCRAPED = """# TYPE dynhull_updates counter
dynhull_updates_total{{operation="insert"}} {updates}
dynhull_updates_total{{operation="missing"}} 1000
# TYPE dynhull_batch_duration_seconds histogram
dynhull_batch_duration_seconds_bucket{{le="0.001"}} {fast}
dynhull_batch_duration_seconds_bucket{{le="0.002"}} {batches}
dynhull_batch_duration_seconds_bucket{{le="+Inf"}} {batches}
dynhull_batch_duration_seconds_count {batches}
dynhull_batch_duration_seconds_sum {seconds}
"""


@pytest.fixture(scope="module")
def page(browser: Browser, url: str) -> Iterator[Page]:
    with opened(browser, url, "none") as page:
        yield page


def test_after_one_long_delay_the_figures_do_not_stand_still(page: Page) -> None:
    pauses = page.evaluate("[1, 100, 2000].map(took => pause_after(took, 1000))")
    assert pauses == [1000, 1900, 5000], "a twentieth of the server's time, and at most five seconds"


def test_units_of_areas() -> None:
    units = [PageSettings(x_unit=x, y_unit=y).area_unit for x, y in (("", ""), ("km", "km"), ("ms", "USD"))]
    assert units == ["square units", "km²", "ms by USD"]


@pytest.mark.parametrize("vertices", [0, 1, MOST_DRAWN, MOST_DRAWN + 1, 10 * MOST_DRAWN])
def test_of_many_vertices_some_are_drawn(page: Page, vertices: int) -> None:
    shown = page.evaluate("count => thinned(Array(count).fill(0)).length", vertices)
    assert shown == vertices if vertices <= MOST_DRAWN else MOST_DRAWN / 2 <= shown <= MOST_DRAWN


def test_time_lines_begin_with_what_the_server_has_kept(page: Page) -> None:
    """A line is level where the hull was unchanged."""
    rows = page.evaluate(
        """now => {
        const times = [0, 1, 21].map(minutes => BigInt(60e6 * minutes))
        const columns = {points: [3, 4, 5], vertices: [3, 4, 4], areas: [1e6, 2e6, 3e6], rates: [null, 0.05, 0.1]}
        const rows = [...past_rows({interval: 60, times, since: 50_000_000n, geographic: true, ...columns}, now)]
        return rows.map(row => row.map(each => isNaN(each) ? null : each))
    }""",
        1_260_000,
    )
    assert rows == [
        [50_000, 3, 3, 1, None],
        [60_000, 4, 4, 2, 0.05],
        [1_200_000, 4, 4, 2, 0],
        [1_260_000, 5, 4, 3, 0.1],
    ]


def test_what_the_server_counts_as_rates(page: Page) -> None:
    texts = [
        SCRAPED.format(updates=100, fast=50, batches=60, seconds=0.05),
        SCRAPED.format(updates=400, fast=140, batches=160, seconds=0.25),
    ]
    after, before = page.evaluate(
        """([first, second]) => {
        const [before, after] = [scraped(first, 10), scraped(second, 12)]
        return [rates(before, after), rates(after, before).map(isNaN)]
    }""",
        texts,
    )
    # Of 100 batches 90 took at most 1 ms, so the 99th lies nine tenths on the way to 2 ms.
    assert after == pytest.approx([150, 2, 1.9])
    assert before == [True] * 3, "the server has begun anew"


# Of as many corners as these, the page makes the rings: to bring them to it takes seconds.
DRAWN = """areas => {
    const ring = ([radius, corners]) => Array.from({length: corners}, (_, corner) =>
        [Math.cos, Math.sin].map(axis => radius * axis(2 * Math.PI * corner / corners)))
    const area = areas.map(([outer, ...holes]) => ({exterior: ring(outer), holes: holes.map(ring)}))
    return [area_of("yard", {area}).drawn, corner_count({area})]
}"""


def test_of_many_corners_some_are_drawn(page: Page) -> None:
    some, corners = page.evaluate(DRAWN, [[(9, 90_000), (2, 10_000), (1, 3)]])
    assert corners == 100_003
    assert MOST_DRAWN / 2 < some <= MOST_DRAWN
    some, corners = page.evaluate(DRAWN, [[(1, 3)]] * 10_000)
    assert corners == 30_000
    assert some <= MOST_DRAWN


@pytest.mark.parametrize(
    ("rings", "margin"),
    [
        ([[[-9, -9], [9, -9], [9, 9], [-9, 9]], [[-1, -1], [1, -1], [1, 1], [-1, 1]]], 0.5),
        ([[[0, 0], [9, 0], [9, 9], [0, 9]]], 4),
        ([[[0, 0], [0, 9], [9, 9], [9, 0]]], 4),  # the other way round
        ([[[0, 0], [9, 0], [9, 2], [2, 2], [2, 9], [0, 9]]], 0.5),  # with a corner that points inwards
        ([[[0, 0], [9, 0], [9, 9], [6, 9], [6, 2], [3, 2], [3, 9], [0, 9]]], 2),  # a bay that the margin fills
        ([[[-9, -9], [9, -9], [9, 9], [-9, 9]], [[-1, -1], [1, -1], [1, 1], [-1, 1]]], 2),  # as is the hole
    ],
)
def test_a_margin_is_at_its_distance(page: Page, rings: list[list[list[float]]], margin: float) -> None:
    fence = {"area": [{"exterior": rings[0], "holes": rings[1:]}], "margin": margin}
    drawn = page.evaluate("fence => area_of('yard', fence).message.around", fence)
    expected = shapely.buffer(shapely.Polygon(rings[0], rings[1:]), margin)
    (around,) = [shapely.Polygon(each[0], each[1:]) for each in drawn]
    assert around.symmetric_difference(expected).area < 0.01 * expected.area
    assert len(around.interiors) == len(expected.interiors)


def test_a_circle_has_its_radius_and_its_margin(page: Page) -> None:
    bounds = page.evaluate("area_of('yard', {area: [{center: [1, 2], radius: 3}], margin: 1}).bounds")
    assert bounds == pytest.approx([-3, -2, 5, 6], abs=0.001)


@pytest.mark.parametrize("place", [(180, -17), (10, 89.5), (13.4, 52.5)])
def test_a_margin_on_the_globe_has_its_metres(page: Page, place: tuple[float, float]) -> None:
    area = "place => area_of('yard', {area: [{center: place, radius: 100_000}], margin: 50_000}, place).message.around"
    [[outer]] = page.evaluate(area, place)
    lon, lat = np.array(outer).T
    *_, metres = Geod(ellps="sphere").inv(np.full_like(lon, place[0]), np.full_like(lat, place[1]), lon, lat)
    assert metres == pytest.approx(150_000, rel=1e-3)
    assert (abs(lon - place[0]) <= 180).all()


def test_a_circle_around_a_pole_is_a_circle(page: Page) -> None:
    corners = np.array(page.evaluate("circle({center: [10, 89.5], radius: 150_000}, true)"))
    middle = np.tile([10, 89.5], (len(corners), 1))
    *_, metres = Geod(ellps="sphere").inv(*middle.T, *corners.T)
    assert metres == pytest.approx(150_000, rel=1e-5)


def test_the_list_has_the_newest_events(page: Page) -> None:
    rows, lost = page.evaluate(
        """most => {
        const cause = ["area_moved", "subject_moved"], rows = new EventRows("yard")
        const event = {type: "enter", uid: "u", inside: [], time: null}
        for (let sequence = 1; sequence < 3 * most; sequence++)
            rows.add({...event, sequence: BigInt(sequence), key: String(sequence), cause})
        const newest = rows.message.rows
        rows.add({...event, type: "lost", sequence: 900n, first: 300n, last: 900n})
        return [newest, rows.message.rows[0].slice(2, 5)]
    }""",
        MOST_EVENTS,
    )
    assert [row[3] for row in rows] == [str(each) for each in range(3 * MOST_EVENTS - 1, 2 * MOST_EVENTS - 1, -1)]
    assert rows[0][5] == "it moved and the area moved"
    assert lost == ["lost", "", "events 300 to 900"]


def test_a_hull_across_180_degrees_is_drawn_in_one_piece(
    browser: Browser, url: str, client: HullClient, name: str
) -> None:
    client.create_hull(name, keyed="str", geographic=True, center=(179, -17))
    client.create_fence(f"{name}/zone", Circle(-179.75, -17, 20_000), name)
    client.put(name, ["a", "b", "c", "d"], [(177.5, -18), (-179.75, -17), (179.5, -16.25), (179.25, -17)])
    with opened(browser, url, name, fences=[f"{name}/zone"]) as page:
        page.wait_for_function("name => picture.hulls.get(name)?.points.x.length == 1", arg=name)
        hull = page.evaluate("name => picture.hulls.get(name)", name)
        assert hull["corners"] == [[180.25, -17], [179.5, -16.25], [177.5, -18]]
        assert hull["vertices"]["keys"] == ["b", "c", "a"]
        assert (hull["points"]["x"], hull["points"]["y"]) == ([179.25], [-17])
        row = page.locator(".of_hulls").get_by_role("row").filter(has_text=name)
        expect(row.locator("td").nth(3)).to_contain_text("km²")
        expect(page.locator(".of_hulls td[data-heading=Area]")).to_be_visible()
        expect(page.get_by_role("group", name="Picture of the hulls")).to_have_accessible_description(
            re.compile("longitude from 177.5 to 180.25, latitude from -18 to -16.25")
        )
        page.get_by_label("Find a key").fill("b")
        page.get_by_label("Find a key").press("Enter")
        found = page.get_by_role("list", name="Where the key is").locator("li").first
        expect(found).to_have_text(f"b is a vertex of {name}: longitude 180.25, latitude -17, revision 1")
        page.wait_for_function("name => picture.fences.get(name)?.inside.x.length == 1", arg=f"{name}/zone")
        fence = page.evaluate("name => picture.fences.get(name)", f"{name}/zone")
        x, y = np.array(fence["area"]["polygons"][0][0]).T
        assert (x.max() + x.min()) / 2 == pytest.approx(180.25)
        assert np.ptp(y) / 2 == pytest.approx(20 / 111.2, rel=0.01)
        assert np.ptp(x) / np.ptp(y) == pytest.approx(1.0457, rel=0.01)  # 1 / cos(17 degrees)
        assert fence["inside"]["x"] == [180.25]


@pytest.mark.parametrize(
    ("center", "places", "pole", "bounds"),
    [
        ((0, -90), [(-170, -70), (-60, -65), (40, -72), (150, -68)], "south", (-180, -90, 180, -65)),
        ((100, 80), [(-170, 70), (-60, 65), (40, 72), (150, 68)], "north", (-80, 65, 280, 90)),
        ((0, 60), [(170, 80), (-170, 80), (180, 70)], None, (-180, 70, 180, 80.15)),  # half a turn from the centre
    ],
)
def test_a_hull_with_a_pole_reaches_the_border_of_the_map(page: Page, center, places, pole, bounds) -> None:
    hull = GeoHull(places, center)
    rings, poles = page.evaluate(
        "([vertices, center]) => [outline(vertices, center), poles(outline(vertices, center))]",
        [hull.vertices().tolist(), center],
    )
    assert poles == ([] if pole is None else [pole])
    lon, lat = np.concatenate([np.array(ring) for ring in rings]).T
    assert (lon.min(), lat.min(), lon.max(), lat.max()) == pytest.approx(bounds, abs=0.01)
    filled = shapely.union_all([shapely.make_valid(shapely.Polygon(ring)) for ring in rings])
    lon, lat = (each.ravel() for each in np.meshgrid(np.arange(-178.5, 180, 7), np.arange(-89, 90, 2.25)))
    inside = shapely.contains_xy(filled, lon - 360 * np.round((lon - center[0]) / 360), lat)
    assert inside.tolist() == hull.contains(np.column_stack([lon, lat])).tolist()


def test_a_server_older_than_fences_is_named_as_such(browser: Browser) -> None:
    older = grpc.server(ThreadPoolExecutor(1))  # without any service
    port = older.add_insecure_port("127.0.0.1:0")
    older.start()
    try:
        with dashboard_process(f"127.0.0.1:{port}") as url, opened(browser, url, "none") as page:
            expect(page.locator(".hint")).to_contain_text("This server has no fences: it is older than they are.")
    finally:
        older.stop(None).wait()
