"""The dashboard in a real browser, on a real server."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from dashboard_process import PARTS, dashboard_process, let_go, opened, wait_for_vertices
from metrics import measured, scrape
from patience import PATIENCE, wait_until
from playwright.sync_api import Browser, Locator, Page, expect
from ports import free_port
from server_process import Server, run, server_process

from dynhull import GeoHull
from dynhull_client import HullClient

pytestmark = pytest.mark.long  # first, so that one worker, and one browser, has all of them
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
PHONE = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "is_mobile": True, "has_touch": True}

# Pixels between the heading of a cell and its figure, or the height of a line if the figure is below.
GAP = """cell => {
    const heading = document.createElement("span")
    heading.textContent = cell.dataset.heading
    heading.style.position = "absolute"
    cell.append(heading)
    const {width, height} = heading.getBoundingClientRect()
    heading.remove()
    const figure = document.createRange()
    figure.selectNodeContents(cell)
    const {left, top} = figure.getBoundingClientRect()
    const place = cell.getBoundingClientRect()
    return top >= place.top + height ? height : left - place.left - width
}"""


INSIDE = """([name, columns, rows]) => {
    const {view, hulls} = picture, canvas = document.createElement("canvas").getContext("2d")
    for (const rings of hulls.get(name).polygons(view)) view.polygon(canvas, rings)
    canvas.lineWidth = 3  // nearer to the line than a pixel and a half, a place may be on either side
    const found = [], {width, height} = view.rect
    for (let column = 0; column < columns; column++)
        for (let row = 0; row < rows; row++) {
            const across = (column + 0.5) * width / columns, down = (row + 0.5) * height / rows
            const place = view.invert(across, down), [back] = view.place(...place)
            if (Math.abs(back - across) < 0.01 && !canvas.isPointInStroke(across, down))
                found.push([...place, canvas.isPointInPath(across, down)])
        }
    return found
}"""


@pytest.fixture
def hull(client: HullClient, name: str) -> str:
    client.create_hull(name)
    client.apply(name, insert=[*SQUARE, [1, 2]])
    return name


def banner(page: Page) -> Locator:
    return page.get_by_role("alert").filter(has_text="No connection to")


def note(page: Page) -> Locator:
    return page.get_by_role("status")


def description(page: Page) -> Locator:
    return page.get_by_role("group", name="Picture of the hulls")


def picture(page: Page) -> bytes:
    return page.locator(".plane").screenshot()


def pick(page: Page, name: str) -> None:
    page.get_by_placeholder("Pick hulls").fill(name)
    page.get_by_placeholder("Pick hulls").press("Enter")


def wait_for_hulls(page: Page, *names: str) -> None:
    """Wait until the page lists these hulls."""
    page.wait_for_function(
        """names => {
            const known = [...document.querySelectorAll("#offered option")].map(option => option.value)
            return names.every(name => known.includes(name))
        }""",
        arg=names,
    )


def wait_for_watchers(metrics: str, count: int) -> None:
    wait_until(lambda: scrape(metrics)["dynhull_watchers"] == count)


def wait_for_labels(page: Page, name: str, labels: list[str]) -> None:
    """Wait until these vertices have their names beside them."""
    page.wait_for_function(
        """([name, labels]) => {
            const keys = picture.hulls.get(name)?.vertices.keys ?? []
            const shown = keys.map(key => picture.labels.shown.has(`${key} of ${name}`) ? key : "")
            return JSON.stringify(labels) == JSON.stringify(shown)
        }""",
        arg=[name, labels],
    )


def wait_for_ring(page: Page, places: list[list[float]]) -> None:
    """Wait until the rings around the key are at these places."""
    page.wait_for_function(
        """places => JSON.stringify(places) == JSON.stringify(picture.found().map(({place}) => place))
            && picture.rings?.length == places.length""",
        arg=places,
    )


def place_of(page: Page, x: float, y: float) -> list[float]:
    """Where a point is on the screen."""
    place: list[float] = page.evaluate(
        """([x, y]) => {
            picture.draw()
            const box = picture.element.getBoundingClientRect(), [right, down] = picture.view.place(x, y)
            return [box.x + right, box.y + down]
        }""",
        [x, y],
    )
    return place


@pytest.mark.smoke
def test_the_polygon_follows_the_hull(browser: Browser, url: str, client: HullClient, hull: str) -> None:
    generator = np.random.default_rng(3)
    with opened(browser, url, hull) as page:
        wait_for_vertices(page, hull, SQUARE)
        before = picture(page)
        with client.ingest(hull) as stream:
            for _ in range(300):
                stream.apply(insert=generator.normal(scale=5, size=(20, 2)))
        final = client.get_hull(hull)
        wait_for_vertices(page, hull, final.vertices.tolist())
        assert picture(page) != before
        row = page.get_by_role("row").filter(has_text=hull)
        expect(row.locator("td").nth(0)).to_have_text("301")
        expect(row.locator("td").nth(1)).to_have_text("6,005")
        expect(row.locator("td").nth(2)).to_have_text(f"{len(final.vertices)}")
        expect(row).to_contain_text("✓ equal")


def test_hovering_shows_coordinates_and_revision(browser: Browser, url: str, hull: str) -> None:
    with opened(browser, url, hull) as page:
        wait_for_vertices(page, hull, SQUARE)
        page.mouse.move(*place_of(page, 4, 4))
        tip = page.get_by_role("tooltip")
        expect(tip).to_contain_text(f"a vertex of {hull}")
        expect(tip).to_contain_text("revision")


def test_vertices_have_the_names_of_their_keys(browser: Browser, url: str, client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str")
    client.put(name, ["LH400", "UA17", "AF84", "<b>BA2"], SQUARE)
    with opened(browser, url, name) as page:
        wait_for_labels(page, name, ["LH400", "UA17", "AF84", "<b>BA2"])
        page.mouse.move(*place_of(page, 0, 4))
        expect(page.get_by_role("tooltip")).to_contain_text(f"<b>BA2: a vertex of {name}")
        client.put(name, ["a"], [[0, 0]])  # of two at one place the least is named
        client.remove(name, ["LH400"])
        wait_for_labels(page, name, ["a", "UA17", "AF84", "<b>BA2"])
        client.put(name, ["close"], [[4.001, 0.001]])
        # Names do not overlap: the one that was there before stays.
        wait_for_labels(page, name, ["a", "UA17", "", "AF84", "<b>BA2"])


def test_a_key_is_found_and_followed(browser: Browser, url: str, client: HullClient, name: str) -> None:
    fleet, numbered = f"{name}/fleet", f"{name}/numbered"
    client.create_hull(fleet, keyed="str")
    client.put(fleet, ["LH400", "UA17", "AF84", "<b>BA2"], SQUARE)
    client.create_hull(numbered, keyed="int")
    client.put(numbered, [2**64 - 1], [[8, 8]])
    client.create_hull(name)
    client.apply(name, insert=SQUARE)
    with opened(browser, url, fleet, numbered, name) as page:
        wait_for_vertices(page, fleet, SQUARE)
        field, found = page.get_by_label("Find a key"), page.get_by_role("list", name="Where the key is").locator("li")
        field.press_sequentially("UA")
        assert page.locator("#keys option").evaluate_all("all => all.map(each => each.value)") == ["UA17"]
        field.press_sequentially("17")
        field.press("Enter")
        expect(found).to_have_text(
            [
                f"UA17 is a vertex of {fleet}: x 4, y 0, revision 1",
                f"{numbered} has no key UA17",
                f"The points of {name} have no keys",
            ]
        )
        wait_for_ring(page, [[4, 0]])
        client.put(fleet, ["corner", "UA17"], [[4, 0], [1, 1]], accuracies=[0, 0.5])
        expect(found.first).to_have_text(f"UA17 is inside {fleet}: x 1, y 1 ± 0.5, revision 2")
        wait_for_ring(page, [[1, 1]])
        away = page.evaluate("picture.found()[0].disk.map(([x, y]) => Math.hypot(x - 1, y - 1))")
        assert away == pytest.approx([0.5] * len(away))
        client.put(fleet, ["UA17"], [[2, 0]])
        expect(found.first).to_have_text(
            f"UA17 is on the boundary of {fleet}, between two vertices: x 2, y 0, revision 3"
        )
        client.remove(fleet, ["UA17"])
        expect(found.first).to_have_text(f"UA17 has left {fleet}. Last position: x 2, y 0, revision 3")
        wait_for_ring(page, [])
        assert not page.evaluate("picture.places.length")
        field.fill("<b>nobody")
        field.press("Enter")
        expect(found.first).to_have_text(f"{fleet} has no key <b>nobody")
        field.fill(f"{2**64 - 1}")
        field.press("Enter")
        expect(found.nth(1)).to_have_text(f"{2**64 - 1} is a vertex of {numbered}: x 8, y 8, revision 1")
        wait_for_ring(page, [[8, 8]])
        client.delete_hull(numbered)
        expect(found.nth(1)).to_have_text(f"There is no hull {numbered}")
        field.fill("")
        expect(found).to_have_count(0)


def test_keys_are_looked_for_where_there_are_some(
    browser: Browser, url: str, client: HullClient, hull: str, name: str
) -> None:
    client.create_hull(f"{name}-keyed", keyed="str", geographic=True)
    client.put(f"{name}-keyed", ["a"], [[13.123456789, 52.123456789]], accuracies=[1234.5])
    with opened(browser, url, hull) as page:
        wait_for_vertices(page, hull, SQUARE)
        field = page.get_by_label("Find a key")
        expect(field).to_be_hidden()
        pick(page, f"{name}-keyed")
        field.fill("a")
        field.press("Enter")
        found = page.get_by_role("list", name="Where the key is").locator("li")
        expect(found.nth(1)).to_contain_text("longitude 13.123457, latitude 52.123457 ± 1234.5 m, revision 1")
        north = page.evaluate("picture.found()[0].disk.map(([, y]) => y)")
        assert max(north) - min(north) == pytest.approx(2 * 1234.5 / 111_195, rel=1e-4)
        disk = "(disk => ({type: 'Polygon', coordinates: [[...disk, disk[0]]]}))(picture.found()[0].disk)"
        assert page.evaluate(f"d3.geoArea({disk})") < 1, "it is the rest of the globe"


def test_the_picture_stands_still_while_hulls_move_in_it(browser: Browser, url: str) -> None:
    with opened(browser, url, "none") as page:
        frame = page.evaluate("frame_around([0, 0, 10, 6], undefined)")
        assert frame == pytest.approx([-0.8, -0.8, 10.8, 6.8])

        def again(box: list[float], old: list[float], same_scale: bool = True) -> list[float]:
            found: list[float] = page.evaluate("each => frame_around(...each)", [box, old, same_scale])
            return found

        assert again([1, 1, 9, 5], frame) == frame
        assert again([1, 1, 11, 5], frame) != frame, "a hull has left it"
        assert again([4, 4, 5, 5], frame) != frame, "it has become too small to see"
        wide = page.evaluate("frame_around([0, 0, 1000, 1], undefined, false)")
        assert wide == pytest.approx([-80, -0.08, 1080, 1.08])
        assert again([0, 0, 1000, 1], wide, same_scale=False) == wide
        assert again([0, 0, 1000, 0.1], wide, same_scale=False) != wide, "one axis has become too short to see"
        for at in (0.0, 7.0, -1e300):
            left, below, right, above = page.evaluate("at => frame_around([at, at, at, at], undefined)", at)
            assert left < at < right
            assert below < at < above


def test_all_keys_have_names_where_there_is_room(browser: Browser, url: str, client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str")
    client.put(name, ["a", "b", "c", "d", "inside"], [*SQUARE, [2, 2]])
    with opened(browser, url, name) as page:
        wait_for_labels(page, name, ["a", "b", "c", "d"])
        named = f"picture.labels.shown.has('inside of {name}')"
        assert not page.evaluate(named)
        page.get_by_label("All names").check()
        page.wait_for_function(f"() => {named}")


def test_outliers_are_shown_to_those_who_look(
    browser: Browser, server: tuple[Server, str], url: str, client: HullClient, name: str
) -> None:
    peeled = 'dynhull_calls_total{code="OK",method="GetLayers"}'
    client.create_hull(name, keyed="str")
    client.put(name, ["a", "b", "c", "far", "in", "<b>", "deep"], [*SQUARE[:2], [0, 4], [9, 9], [1, 1], [2, 1], [1, 2]])
    layers = "name => picture.hulls.get(name).layers.map(({corners}) => corners)"
    with opened(browser, url, name) as page:
        wait_for_vertices(page, name, [[0, 0], [4, 0], [9, 9], [0, 4]])
        words = page.get_by_role("list", name="The most influential vertices").locator("li")
        expect(words).to_have_count(0)
        assert page.evaluate(layers, name) == []
        before = scrape(server[1]).get(peeled, 0)
        box = page.get_by_role("checkbox", name="Outliers")
        box.focus()
        page.keyboard.press("Space")
        expect(words).to_have_text(f"Without far, {name} would lose 28 square units: x 9, y 9, revision 1")
        page.wait_for_function("() => picture.rings.map(({text}) => text).join() == 'far: 28 square units'")
        assert page.evaluate(layers, name) == [[[1, 1], [2, 1], [1, 2]]]
        client.put(name, ["far"], [[4, 4]])
        expect(words).to_contain_text(f"Without far, {name} would lose 8 square units: x 4, y 4, revision 2")
        assert scrape(server[1])[peeled] > before
        page.reload()
        expect(box).to_be_checked()
        expect(words).to_have_count(1)
        box.uncheck()
        expect(words).to_have_count(0)
        page.wait_for_function("() => picture.rings.length == 0")


def test_the_picture_is_moved_by_keys_and_by_hand(browser: Browser, url: str, hull: str) -> None:
    """Places of one moment are compared: the map gets another size when what is beside it comes, seconds later."""
    steps = """keys => {
        const place = () => (picture.draw(), picture.view.place(4, 4))
        const places = [place()]
        for (const key of keys) {
            if (key == "all") document.querySelector(".map button[name=all]").click()
            else picture.element.dispatchEvent(new KeyboardEvent("keydown", {key, bubbles: true}))
            places.push(place())
        }
        return places
    }"""
    with opened(browser, url, hull) as page:
        wait_for_vertices(page, hull, SQUARE)
        picture = page.get_by_role("application")
        begun, moved = page.evaluate(steps, ["ArrowRight"])
        assert moved == pytest.approx([begun[0] - 60, begun[1]])
        picture.press("+")
        assert page.evaluate("() => !picture.following")
        one, moved, begun = page.evaluate(steps, ["ArrowRight", "all"])
        assert moved == pytest.approx([one[0] - 60, one[1]])
        assert abs(one[0] - begun[0]) > 1
        picture.press("0")
        page.wait_for_function("() => picture.following")
        shown, begun = page.evaluate(steps, ["all"])
        assert shown == pytest.approx(begun)

        begun = place_of(page, 4, 4)
        page.mouse.move(*begun)
        page.mouse.down()
        page.mouse.move(begun[0] - 50, begun[1] + 20, steps=3)
        page.mouse.up()
        held, begun = page.evaluate(steps, ["all"])
        assert held == pytest.approx([begun[0] - 50, begun[1] + 20], abs=5)
        page.evaluate(steps, ["ArrowRight"])
        page.get_by_role("button", name="Show all").click()
        page.wait_for_function("() => picture.following")
        shown, begun = page.evaluate(steps, ["all"])
        assert shown == pytest.approx(begun)
        # A key that comes before all is drawn again moves what is shown then.
        picture.press("+")
        _, begun, moved = page.evaluate(steps, ["all", "ArrowRight"])
        assert moved == pytest.approx([begun[0] - 60, begun[1]], abs=1e-9)


def test_the_picture_is_paused_and_shows_what_was_before(
    browser: Browser, url: str, client: HullClient, hull: str
) -> None:
    with opened(browser, url, hull) as page:
        wait_for_vertices(page, hull, SQUARE)
        revision = page.get_by_role("row").filter(has_text=hull).locator("td").nth(0)
        expect(revision).to_have_text("1")
        page.get_by_role("application").press(" ")
        client.apply(hull, insert=[[9, 9]])
        later = [[0, 0], [4, 0], [9, 9], [0, 4]]
        page.wait_for_function("() => recorder.tracks.get('said table of ').texts.at(-1).includes('>2</td>')")
        # Words and figures are those of the picture, and the time lines have a mark.
        expect(revision).to_have_text("1")
        expect(description(page)).to_have_accessible_description(re.compile("at revision 1"))
        assert page.evaluate("time_lines.moment == recorder.moment")
        expect(page.get_by_role("timer")).to_contain_text("s ago")
        wait_for_vertices(page, hull, SQUARE)
        page.get_by_role("button", name="To now").click()
        wait_for_vertices(page, hull, later)
        # Back to just before the change, and on from there.
        page.evaluate("name => recorder.go(recorder.tracks.get(`vertices of ${name}`).moments.at(-1) - 1)", hull)
        wait_for_vertices(page, hull, SQUARE)
        page.get_by_role("button", name="Play").click()
        wait_for_vertices(page, hull, later)
        slider = page.get_by_role("slider")
        slider.press("Home")
        expect(page.get_by_role("button", name="Play")).to_be_visible()
        page.get_by_role("button", name="To now").click()
        expect(page.get_by_role("timer")).to_have_text("Live")


def test_old_drawings_are_thinned_and_forgotten(browser: Browser, url: str) -> None:
    """A recording is bounded, and a moment shows what was there then."""
    with opened(browser, url, "none") as page:
        kept = page.evaluate("""() => {
            const shown = [], begun = Date.now, made = new Recorder(message => shown.push(message.revision), () => {})
            let now = 1e12
            Date.now = () => now
            made.began = now
            const message = {kind: "vertices", hull: "a", pad: "x".repeat(50_000)}
            for (let revision = 0; revision < 4000; revision++, now += 100)
                made.take(message, JSON.stringify({...message, revision}))
            const {moments, texts} = made.tracks.get("vertices of a")
            made.go(now - 60_000)
            Date.now = begun
            const sum = texts.reduce((sum, text) => sum + text.length, 0)
            return {length: made.length, sum, oldest: now - moments[1], revision: shown.at(-1)}
        }""")
    assert kept["length"] == kept["sum"] <= 60_000_000
    assert 200_000 < kept["oldest"] <= 300_100  # and one more, which was to be seen then
    assert 3350 < kept["revision"] <= 3400


def test_a_trail_goes_back_for_a_minute(browser: Browser, url: str) -> None:
    with opened(browser, url, "none") as page:
        places = page.evaluate("""() => {
            const trails = new Trails(), traced = []
            for (let second = 0; second < 200; second += 0.5)
                trails.take({kind: "points", hull: "a", keys: ["k"], x: [second], y: [0]}, 1000 * second)
            const canvas = {moveTo: across => traced.push(across), lineTo: across => traced.push(across)}
            trace_back(canvas, {place: (x, y) => [x, y]}, [150.5, 0], trails.hulls.get("a").get("k"), 150_500)
            return traced
        }""")
        assert places == [150.5, *range(150, 90, -1)]


def test_no_page_asks_another_host(browser: Browser, url: str, client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str", geographic=True, center=(10, 50))
    client.put(name, ["a", "b", "c"], [[10, 50], [10.1, 50], [10, 50.1]])
    asked: list[str] = []
    with opened(browser, url) as page:
        page.on("request", lambda request: asked.append(request.url))
        page.on("websocket", lambda socket: asked.append(socket.url))
        with page.expect_response("**/countries-50m.json"):
            page.goto(f"{url}?hull={name}")
            page.evaluate(PARTS)
        page.wait_for_function("() => picture.coasts.known.get(FINE)?.coasts.length > 1000")
    hosts = {request.split("/")[2] for request in asked if not request.startswith("data:")}
    assert len(asked) > 4
    assert hosts == {url.split("/")[2]}


@pytest.mark.parametrize(
    ("center", "places"),
    [
        ((179, -17), [(177.5, -18), (-179.75, -17), (179.5, -16.25)]),
        ((0, -90), [(-170, -70), (-60, -65), (40, -72), (150, -68)]),
        ((0, 60), [(170, 80), (-170, 80), (180, 70)]),
        ((10, 0), [(-65, -30), (80, -40), (85, 35), (-60, 50)]),  # nearly half the globe
    ],
)
def test_the_picture_has_the_edges_of_a_hull_on_the_globe(
    browser: Browser,
    url: str,
    client: HullClient,
    name: str,
    center: tuple[float, float],
    places: list[tuple[float, float]],
) -> None:
    """Great circles, across 180 degrees and around poles: each pixel is inside exactly where the hull contains it."""
    client.create_hull(name, geographic=True, center=center)
    client.apply(name, insert=places)
    expected = GeoHull(places, center)
    with opened(browser, url, name) as page:
        page.wait_for_function("() => picture.view.globe && picture.frames > 0")
        for turn in ((0, 0), (200, -90)):
            page.evaluate("turn => picture.move(view => view.pan(...turn))", turn)
            found = page.evaluate(INSIDE, [name, 60, 40])
            assert len(found) > 1000
            inside = expected.contains(np.array([each[:2] for each in found]))
            assert inside.tolist() == [each[2] for each in found]
            assert inside.any()


def test_all_hulls_of_a_prefix_are_picked(browser: Browser, url: str, client: HullClient, name: str) -> None:
    outlines = "prefix => picture.many.hulls.map(({name, corners}) => [name, corners.length]).sort()"
    for part in "ab":
        client.create_hull(f"{name}/{part}")
        client.apply(f"{name}/{part}", insert=SQUARE)
    with opened(browser, url, "") as page:
        wait_for_hulls(page, f"{name}/*")
        pick(page, f"{name}/")
        page.wait_for_function(
            f"expected => JSON.stringify(({outlines})()) == JSON.stringify(expected)",
            arg=[[f"{name}/a", 4], [f"{name}/b", 4]],
        )
        assert f"prefix={name}" in page.url.replace("%2F", "/")
        table = page.get_by_role("table").filter(has_text=f"{name}/*")
        expect(table).to_contain_text("2 hulls, the last changed first")
        page.get_by_role("button", name="Pause").click()
        client.create_hull(f"{name}/c")
        client.apply(f"{name}/b", insert=[[9, 9], [1, 1]])
        client.delete_hull(f"{name}/a")
        client.apply(f"{name}/c", insert=[[7, 7], [9, 7], [8, 8]])
        recorded = 'name => [...recorder.tracks.values()].some(({texts}) => texts.at(-1).includes(`"${name}"`))'
        page.wait_for_function(recorded, arg=f"{name}/c")
        assert [part for part, _ in page.evaluate(outlines)] == [f"{name}/a", f"{name}/b"]
        page.get_by_role("button", name="To now").click()
        page.wait_for_function(
            f"expected => JSON.stringify(({outlines})()) == JSON.stringify(expected)",
            arg=[[f"{name}/b", 4], [f"{name}/c", 3]],
        )
        expect(table.get_by_role("rowheader").first).to_have_text(f"{name}/c")
        page.mouse.move(*place_of(page, 9, 9))
        expect(page.get_by_role("tooltip")).to_contain_text(f"a vertex of {name}/b")
        page.reload()
        expect(table).to_contain_text("2 hulls")
        let_go(page, f"{name}/*")
        page.wait_for_function("() => picture.many.hulls.length == 0")
        expect(table).to_have_count(0)


def test_a_prefix_without_hulls_says_so(browser: Browser, url: str, client: HullClient, name: str) -> None:
    client.create_hull(f"{name}/a")
    client.create_hull(f"{name}/b")
    with opened(browser, url, name) as page:
        expect(note(page)).to_contain_text(f"Others begin with that name: pick {name}/* above to see them all")
        let_go(page, name)
        pick(page, f"{name}-none/")
        expect(note(page)).to_contain_text(f"No hull has a name that begins with {name}-none/ yet")


def test_hulls_are_picked_and_let_go(browser: Browser, url: str, client: HullClient, hull: str) -> None:
    client.create_hull("shown")
    with opened(browser, url, "shown") as page:
        row = page.get_by_role("row").filter(has_text=hull)
        wait_for_hulls(page, "shown", hull)
        pick(page, hull)
        wait_for_vertices(page, hull, SQUARE)
        expect(row).to_be_visible()
        let_go(page, hull)
        expect(row).to_be_hidden()


def test_enter_takes_the_match(browser: Browser, url: str, client: HullClient, name: str) -> None:
    name = name[-20:]
    for city in ("berlin", "munich", "minsk"):
        client.create_hull(f"{name}/{city}")
    with opened(browser, url, "none") as page:
        wait_for_hulls(page, f"{name}/munich")
        for typed, city in (("mun", "munich"), (f"{name}/min", "minsk"), ("erlin", "berlin")):
            pick(page, typed)
            expect(page.get_by_role("button", name=f"Remove {name}/{city}", exact=True)).to_be_visible()
        pick(page, f"{name}/none-yet")
        expect(page.get_by_role("button", name=f"Remove {name}/none-yet", exact=True)).to_be_visible()
        assert page.evaluate("best_match('a', ['a/b', 'a'])") == "a"


def test_of_too_many_names_those_that_are_typed_are_offered(browser: Browser, url: str) -> None:
    """The list has the first 300, and as many of those that begin with what is typed."""
    with opened(browser, url, "none") as page:
        offered = page.evaluate("""async () => {
            const names = [...Array(1000).keys()].map(row => `van/${row}`).sort()
            const asked = [], ask = async function* (prefix) {
                asked.push(prefix)
                yield* names.filter(name => name.startsWith(prefix)).map(name => ({name}))
            }
            let told
            const answered = () => new Promise(resolve => told = resolve)
            const first = answered(), list = new ServerList("", ask, () => told?.())
            await first
            const before = list.names.includes("van/999"), next = answered()
            list.typed = "van/99"
            await next
            list.close()
            return [before, list.names.length, best_match("van/999", list.names), asked]
        }""")
        assert offered == [False, 311, "van/999", ["", "", "van/99"]]


def test_the_link_keeps_where_the_picture_is(browser: Browser, url: str, client: HullClient, name: str) -> None:
    client.create_hull(f"{name}-globe", geographic=True)
    client.apply(f"{name}-globe", insert=[[10, 50], [11, 50], [11, 51]])
    client.create_hull(name)
    client.apply(name, insert=SQUARE)
    for hull in (name, f"{name}-globe"):
        with opened(browser, url, hull) as page:
            page.wait_for_function("name => picture.hulls.get(name)?.corners?.length >= 3", arg=hull)
            page.get_by_role("application").press("+")
            page.wait_for_function("() => location.search.includes('view=')")
            larger = page.evaluate("location.search")
            page.get_by_role("application").press("ArrowLeft")
            page.wait_for_function("larger => location.search != larger", arg=larger)
            extent = page.evaluate("picture.view.extent")
            page.reload()
            page.wait_for_function("name => picture.hulls.get(name)?.corners?.length >= 3 && !picture.wanted", arg=hull)
            # Once the tables below have their heights.
            wait_until(lambda extent=extent: page.evaluate("picture.view.extent") == pytest.approx(extent, rel=1e-6))
            page.get_by_role("button", name="Show all").click()
            page.wait_for_function("() => picture.following && !location.search.includes('view=')")
            page.evaluate(PARTS)
            assert page.evaluate("['1,2', 'a,b,c', '1,2,0', ',,', null].map(read_extent)") == [None] * 5


def test_what_is_shown_is_saved(browser: Browser, url: str, client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str")
    client.put(name, ["a", 'the "b", c', "d"], [[0.1, 0], [4, 0], [4, 1e-7]])
    client.create_fence(name, [[0, 0], [9, 0], [9, 9]], name)
    with opened(browser, url, name, fences=[name]) as page:
        page.wait_for_function(
            "name => picture.hulls.get(name)?.corners?.length == 3 && picture.fences.get(name)?.area.polygons.length",
            arg=name,
        )

        def saved(kind: str) -> Path:
            with page.expect_download() as download:
                page.get_by_role("button", name="Save", exact=True).click()
                page.get_by_role("group", name="Save what is shown").get_by_role("button", name=kind).click()
            return Path(download.value.path())

        assert saved("PNG").read_bytes().startswith(b"\x89PNG")
        hull, fence = json.loads(saved("GeoJSON").read_text())["features"]
        assert hull["properties"] == {"hull": name, "revision": 1}
        assert hull["geometry"] == {"type": "Polygon", "coordinates": [[[0.1, 0], [4, 0], [4, 1e-7], [0.1, 0]]]}
        assert (fence["properties"], len(fence["geometry"]["coordinates"][0])) == ({"fence": name}, 4)
        rows = list(csv.reader(saved("CSV").read_text().splitlines()))
        assert rows[0] == ["hull", "revision", "key", "x", "y"]
        assert rows[2:] == [[name, "1", 'the "b", c', "4", "0"], [name, "1", "d", "4", "1e-7"]]


def test_what_is_typed_stays_when_hulls_come(browser: Browser, url: str, client: HullClient, hull: str) -> None:
    late = f"{hull}-late"
    with opened(browser, url, hull) as page:
        wait_for_hulls(page, hull)
        field = page.get_by_placeholder("Pick hulls")
        field.press_sequentially(late)
        client.create_hull(late)
        wait_for_hulls(page, hull, late)
        expect(field).to_have_value(late)
        expect(field).to_be_focused()
        field.press("Enter")
        expect(page.get_by_role("row").filter(has_text=late)).to_be_visible()


def test_several_hulls_and_one_watch_each_for_all_viewers(browser: Browser) -> None:
    with (
        measured() as (server, metrics),
        HullClient(server.address) as client,
        dashboard_process(server.address) as url,
        opened(browser, url, "fleet", "port") as one,
        opened(browser, url, "fleet", "port") as two,
    ):
        client.create_hull("fleet")
        client.create_hull("port")
        client.apply("fleet", insert=SQUARE)
        for page in (one, two):
            wait_for_vertices(page, "fleet", SQUARE)
            expect(page.locator(".of_hulls tbody").get_by_role("row")).to_have_count(2)
        dashes = [path.get_attribute("stroke-dasharray") for path in one.locator("th path[stroke]").all()]
        assert len({*dashes}) == 2, "only colour distinguishes them"
        legend = [path.get_attribute("stroke-dasharray") for path in one.locator(".picker path[stroke]").all()]
        assert legend == dashes
        wait_for_watchers(metrics, 2)
        let_go(one, "port")
        let_go(two, "port")
        wait_for_watchers(metrics, 1)


def test_what_the_server_measures(browser: Browser, url: str, client: HullClient, hull: str) -> None:
    with opened(browser, url, hull) as page:
        wait_for_vertices(page, hull, SQUARE)
        client.apply(hull, insert=np.zeros((1000, 2)))
        page.wait_for_function("""() => {
            const {updates, mean} = time_lines.rows.get("") ?? {updates: [], mean: []}
            return updates.some(value => value > 100) && mean.some(value => value > 0)
        }""")


def test_the_hull_is_verified_when_asked_to(browser: Browser, url: str, client: HullClient, hull: str) -> None:
    with opened(browser, url, hull) as page:
        state = page.get_by_role("row").filter(has_text=hull).locator(".state")
        expect(state).to_contain_text("✓ equal at revision 1,")
        client.apply(hull, insert=[[8, 8]])
        page.get_by_role("button", name="Verify now").click()
        expect(state).to_contain_text("✓ equal at revision 2,")


def test_each_empty_state_says_what_to_do(browser: Browser, tmp_path: Path) -> None:
    points = tmp_path / "points.csv"
    points.write_text("x,y\n0,0\n4,0\n4,4\n")
    with (
        measured() as (server, _metrics),
        HullClient(server.address) as client,
        dashboard_process(server.address, "--metrics", "http://127.0.0.1:1/metrics") as url,
        opened(browser, url) as page,
    ):
        alert = page.get_by_role("alert")
        expect(alert).to_contain_text("No metrics from http://127.0.0.1:1/metrics: ")
        expect(alert).to_contain_text("Check that the server runs with --metrics-port")
        load = "dynhull load NAME FILE.csv"
        expect(note(page)).to_contain_text(f"The server has no hulls yet. Make one: {load}")
        client.create_hull("fleet")
        expect(note(page)).to_contain_text("fleet has no points yet. Add some: dynhull load fleet FILE.csv")
        advice = note(page).text_content().rpartition("dynhull ")[2].replace("FILE.csv", str(points))
        assert run(*advice.split()).returncode == 0
        wait_for_vertices(page, "fleet", [[0, 0], [4, 0], [4, 4]])
        expect(note(page)).to_be_hidden()
        let_go(page, "fleet")
        expect(note(page)).to_have_text("Pick a hull above.")
        pick(page, "boats")
        expect(note(page)).to_contain_text("The server has no hull boats. Check the name")
        row = page.get_by_role("row").filter(has_text="boats")
        expect(row).to_contain_text("No such hull. Check the name, or create the hull: it appears here by itself")
        client.create_hull("boats")
        client.apply("boats", insert=SQUARE)
        wait_for_vertices(page, "boats", SQUARE)
        expect(note(page)).to_be_hidden()
        client.delete_hull("boats")
        expect(row).to_contain_text("No such hull.")
        wait_for_vertices(page, "boats", [])


def test_a_refused_token_is_named_as_the_cause(browser: Browser, tmp_path: Path) -> None:
    tokens = tmp_path / "tokens.toml"
    tokens.write_text(run("token", "--read", "fleet").stdout)
    with (
        server_process("--in-memory", "--tokens", str(tokens), complaints="UNAUTHENTICATED") as server,
        dashboard_process(server.address) as url,
        opened(browser, url, "fleet") as page,
    ):
        expect(page.get_by_role("alert")).to_contain_text(f"{server.address} refuses the dashboard")
        expect(page.get_by_role("alert")).to_contain_text("Start the dashboard with a --token that the server knows")


@pytest.mark.parametrize("name", ["<b>x", "a b"])
def test_a_name_that_no_hull_can_have(browser: Browser, url: str, name: str) -> None:
    with opened(browser, url, name) as page:
        expect(note(page)).to_contain_text(
            f"The server has no hull {name}. Check the name, or pick another hull above. One that is made with this"
        )


@pytest.mark.smoke
def test_a_name_in_the_address_is_never_html(browser: Browser, url: str) -> None:
    name = "<img src=x onerror=document.title='run'>"
    with opened(browser, url, name) as page:
        expect(page.get_by_role("row").filter(has_text=name)).to_be_visible()
        expect(page.get_by_role("button", name=f"Remove {name}")).to_be_visible()
        assert page.locator("img").count() == 0
        assert page.title() == "dynhull"


def test_the_picture_in_words(browser: Browser, url: str, client: HullClient, hull: str) -> None:
    with opened(browser, url, hull) as page:
        words = (
            f"{hull}: a convex polygon with 4 vertices around 5 points, x from 0 to 4, y from 0 to 4, at revision 1."
        )
        expect(description(page)).to_have_accessible_description(words)
        client.apply(hull, delete=[*SQUARE, [1, 2]])
        expect(description(page)).to_have_accessible_description(f"{hull}: nothing drawn.")


def test_axes_of_different_units_have_scales_of_their_own(
    browser: Browser, server: tuple[Server, str], client: HullClient, name: str
) -> None:
    client.create_hull(name)
    client.apply(name, insert=[[0, 0], [1000, 0], [0, 1]])
    heights = "() => picture.plane.place(0, 0)[1] - picture.plane.place(0, 1)[1]"
    with (
        dashboard_process(server[0].address, "--x-unit", "ms", "--y-unit", "USD") as url,
        opened(browser, url, name) as page,
    ):
        expect(page.locator("td[data-heading='Area (ms by USD)']")).to_be_visible()
        page.wait_for_function(f"() => ({heights})() > 300")
        page.get_by_label("Same scale for x and y").check()
        page.wait_for_function(f"() => ({heights})() < 10")


def test_series_of_the_server_have_no_hulls_colour(browser: Browser, url: str, hull: str) -> None:
    with opened(browser, url, hull) as page:
        wait_for_vertices(page, hull, SQUARE)
        page.wait_for_function("() => time_lines.rows.has('')")
        colours = page.evaluate(
            "time_lines.lines(['updates', 'mean', 'percentile'].slice(0, 2)).map(({colour}) => colour)"
        )
        assert colours == ["#656C76"] * 2


def test_a_server_that_is_killed_and_comes_back(browser: Browser, tmp_path: Path) -> None:
    kept = "--data", str(tmp_path), "--port", str(free_port())
    with server_process(*kept, killed=True) as first, HullClient(first.address) as client:
        client.create_hull("empty")
        client.create_hull("fleet")
        client.apply("fleet", insert=SQUARE)
        with dashboard_process(first.address) as url, opened(browser, url) as page:
            wait_for_vertices(page, "fleet", SQUARE)  # the largest is shown to begin with
            expect(banner(page)).to_be_hidden()
            first.process.kill()
            expect(banner(page)).to_contain_text(f"No connection to {first.address}")
            wait_for_vertices(page, "fleet", SQUARE)
            with server_process(*kept):
                expect(banner(page)).to_be_hidden()
                client.apply("fleet", insert=[[9, 9]], timeout=PATIENCE)
                wait_for_vertices(page, "fleet", [[0, 0], [4, 0], [9, 9], [0, 4]])


def test_a_dashboard_that_goes_and_comes_back(browser: Browser, server: tuple[Server, str], hull: str) -> None:
    address, silence = server[0].address, "The dashboard does not answer."
    page, port = browser.new_page(), str(free_port())
    with dashboard_process(address, "--port", port) as url:
        page.goto(f"{url}/?hull={hull}")
        wait_for_vertices(page, hull, SQUARE)
    expect(page.get_by_text(silence)).to_be_visible()
    wait_for_vertices(page, hull, SQUARE)
    with dashboard_process(address, "--port", port):
        expect(page.get_by_text(silence)).to_be_hidden()
        wait_for_vertices(page, hull, SQUARE)
        page.close()


def test_on_a_phone_nothing_is_cut_off(browser: Browser, url: str, client: HullClient, hull: str) -> None:
    with opened(browser, url, hull, **PHONE) as page:
        wait_for_vertices(page, hull, SQUARE)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        plane = page.locator(".plane").bounding_box()
        assert plane["width"] > 350
        assert plane["height"] < 600
        client.apply(hull, insert=[[0, 2984], [2985, 2984]])
        area = "td[data-heading^=Area]"
        expect(page.locator(area)).to_contain_text("4,459,588")
        # Once it is laid out; the cell may be another one by then, as the table comes anew with each change.
        page.wait_for_function(f"area => ({GAP})(document.querySelector(area)) >= 4", arg=area)


def test_light_and_dark(browser: Browser, url: str, hull: str) -> None:
    paper = "getComputedStyle(document.body).backgroundColor"
    with (
        opened(browser, url, hull, color_scheme="light") as light,
        opened(browser, url, hull, color_scheme="dark") as dark,
    ):
        for page in (light, dark):
            wait_for_vertices(page, hull, SQUARE)
        assert light.evaluate(paper) == "rgb(255, 255, 255)"
        assert dark.evaluate(paper) == "rgb(18, 22, 27)"
        assert picture(light) != picture(dark)
