"""Fences on the dashboard, in a real browser, on a real server."""

from itertools import count
from pathlib import Path

import pytest
from contrast import CONTRAST
from dashboard_process import dashboard_process, let_go, opened, wait_for_vertices
from metrics import scrape
from patience import PATIENCE, wait_until
from playwright.sync_api import Browser, Locator, Page, expect
from ports import free_port
from proxy import proxy
from server_process import Server, run, server_process

from dynhull_client import Circle, HullClient, Polygon

pytestmark = pytest.mark.long  # first, so that one worker, and one browser, has all of them
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
YARD = Polygon([[0, 0], [10, 0], [10, 10], [0, 10]], ([[4, 4], [6, 4], [6, 6], [4, 6]],))
NUMBERS = count(1)
PHONE = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "is_mobile": True, "has_touch": True}


@pytest.fixture
def name() -> str:
    """A prefix of the test's own, short enough for the picture."""
    return f"t{next(NUMBERS)}"


@pytest.fixture
def fleet(client: HullClient, name: str) -> str:
    """A hull with a key in the yard, one in its hole, and one outside."""
    client.create_hull(f"{name}/fleet", keyed="str")
    client.put(f"{name}/fleet", ["in", "hole", "out"], [[1, 2], [5, 5], [20, 2]])
    return f"{name}/fleet"


@pytest.fixture
def yard(client: HullClient, name: str, fleet: str) -> str:
    """A fence with a hole and a margin around some of the fleet."""
    client.create_fence(f"{name}/yard", YARD, fleet, margin=1)
    return f"{name}/yard"


def events(page: Page) -> Locator:
    """The rows of the list of events."""
    return page.locator(".events tbody tr")


def table_row(page: Page, fence: str) -> Locator:
    return page.locator(".table").get_by_role("row").filter(has_text=fence)


def description(page: Page) -> Locator:
    return page.get_by_role("group", name="Picture of the hulls")


def pick(page: Page, fence: str) -> None:
    page.get_by_label("Pick fences").fill(fence)
    page.get_by_label("Pick fences").press("Enter")


def wait_for_fence(page: Page, name: str, what: str, expected: object) -> None:
    """Wait until an expression of a drawn fence has this value: its own area, polygons with those of hulls, margins."""
    page.wait_for_function(
        f"""([name, expected]) => {{
            const fence = picture.fences.get(name)
            if (!fence) return false
            const [polygons, margins] = ["polygons", "margins"].map(each => fence[each](picture.view, picture.hulls))
            const [x, y] = [0, 1].map(axis => points => points.flat(2).map(point => point[axis]))
            return JSON.stringify({what}) == JSON.stringify(expected)
        }}""",
        arg=[name, expected],
    )


def wait_for_inside(page: Page, fence: str, places: dict[str, list[float]]) -> None:
    """Wait until these keys are marked as inside, each at its place."""
    what = "Object.fromEntries(fence.marks(picture.hulls).map(({key, place}) => [key, place]))"
    wait_for_fence(page, fence, what, places)


def test_areas_of_every_kind_and_who_is_inside(
    browser: Browser, url: str, client: HullClient, name: str, fleet: str, yard: str
) -> None:
    pack, pond, herd = f"{name}/pack", f"{name}/pond", f"{name}/herd"
    client.create_hull(pack)
    client.apply(pack, insert=SQUARE)
    client.create_fence(pond, Circle(20, 0, 3), fleet)
    client.create_fence(herd, pack, fleet, margin=2)
    with opened(browser, url, fences=[yard, pond, herd]) as page:
        # The hulls of the fences come along.
        wait_for_vertices(page, pack, SQUARE)
        wait_for_inside(page, yard, {"in": [1, 2]})
        wait_for_inside(page, pond, {"out": [20, 2]})
        wait_for_inside(page, herd, {"in": [1, 2]})
        corners = [[0, 0], [10, 0], [10, 10], [0, 10]]
        wait_for_fence(page, yard, "polygons", [[corners, [[4, 4], [6, 4], [6, 6], [4, 6]]]])
        wait_for_fence(page, yard, "[Math.min(...x(margins)), Math.max(...y(margins))]", [-1, 11])
        wait_for_fence(page, pond, "[Math.min(...x(polygons)), Math.max(...x(polygons))]", [17, 23])
        wait_for_fence(page, herd, "polygons", [[SQUARE]])
        wait_for_fence(page, herd, "Math.max(...x(margins))", 6)
        # The area moves, and so do those inside.
        client.apply(pack, delete=[[4, 0], [4, 4]], insert=[[30, 0], [30, 4]])
        client.put(fleet, ["in", "hole"], [[3, 3], [5, 3]])
        wait_for_fence(page, herd, "x(polygons)", [0, 30, 30, 0])
        wait_for_inside(page, herd, {"hole": [5, 3], "in": [3, 3], "out": [20, 2]})
        wait_for_inside(page, yard, {"hole": [5, 3], "in": [3, 3]})
        # They are sorted, though an event brings the last one.
        client.put(fleet, ["a new one"], [[3, 2]])
        wait_for_inside(page, yard, {"a new one": [3, 2], "hole": [5, 3], "in": [3, 3]})
        expect(table_row(page, herd).locator("td")).to_have_text(
            [f"hull {pack}", fleet, "4 of 4", "4", "none", "margin 2"]
        )
        expect(table_row(page, pond).locator("td").first).to_have_text("circle around (20, 0), radius 3")
        dashes = [path.get_attribute("stroke-dasharray") for path in page.locator(".fences path[stroke]").all()]
        assert len({*dashes}) == 3, "only their names distinguish them"


@pytest.mark.smoke
def test_events_are_listed_as_they_happen(
    browser: Browser, url: str, client: HullClient, fleet: str, yard: str
) -> None:
    with opened(browser, url, fences=[yard]) as page:
        expect(events(page)).to_have_count(1)
        expect(events(page).locator(".subject")).to_have_text("1 key inside: in")
        client.put(fleet, ["out", "new <b>"], [[2, 2], [8, 8]])
        client.remove(fleet, ["in"])
        expect(events(page).locator(".type")).to_have_text(["☆ exit", "★ enter", "★ enter", "≡ snapshot"])
        expect(events(page).locator(".subject")).to_have_text(["in", "out", "new <b>", "1 key inside: in"])
        expect(events(page).locator(".cause")).to_have_text(
            ["it was removed", "it moved", "it is new", "the fence is new"]
        )
        expect(events(page).locator(".fence").first).to_have_text(yard)
        # A key of the list is found in the picture, by keyboard, too.
        page.get_by_role("region", name="List of events").focus()
        for _ in range(3):
            page.keyboard.press("ArrowDown")
        kept = events(page).get_by_role("button", name="new <b>")
        expect(kept).to_be_focused()
        client.replace_fence(yard, [[7, 7], [9, 7], [9, 9], [7, 9]], fleet)
        expect(events(page).first.locator(".cause")).to_have_text("the fence changed")
        expect(kept).to_be_focused()  # new rows move nothing
        page.keyboard.press("Enter")
        expect(page.get_by_role("list", name="Where the key is").locator("li").first).to_contain_text("new <b> is")
        wait_for_fence(page, yard, "x(polygons)", [7, 9, 9, 7])


def test_fences_are_picked_and_let_go_and_their_hulls_watched_once_for_all(
    browser: Browser, server: tuple[Server, str], url: str, fleet: str, yard: str
) -> None:
    with opened(browser, url, "nothing") as one, opened(browser, url, "nothing") as two:
        expect(one.get_by_role("heading", name="Events")).to_be_hidden()
        # The watches for the pages of other tests end a moment after them.
        wait_until(lambda: scrape(server[1])["dynhull_watchers"] == 0)
        for page in (one, two):
            pick(page, yard)
            wait_for_inside(page, yard, {"in": [1, 2]})
            expect(page.get_by_role("heading", name="Events")).to_be_visible()
            expect(page.get_by_role("button", name=f"Remove {fleet}", exact=True)).to_be_visible()
        # One of the fence for each page, whose places may differ, and one of the hull that came with it for both.
        wait_until(lambda: scrape(server[1])["dynhull_watchers"] == 3)
        for page in (one, two):
            let_go(page, yard)
            let_go(page, fleet)
            expect(page.get_by_role("heading", name="Events")).to_be_hidden()
            expect(page.get_by_role("button", name=f"Remove {fleet}", exact=True)).to_have_count(0)
        wait_until(lambda: scrape(server[1])["dynhull_watchers"] == 0)


def test_a_hull_brings_its_fences(browser: Browser, url: str, fleet: str, yard: str) -> None:
    with opened(browser, url, fleet) as page:
        wait_for_inside(page, yard, {"in": [1, 2]})
        let_go(page, yard)
        expect(table_row(page, yard)).to_have_count(0)


def test_a_fence_that_is_created_again_around_hulls_with_another_centre(
    browser: Browser, url: str, client: HullClient, name: str
) -> None:
    zone = [[179, -18], [181, -18], [181, -16], [179, -16]]

    def create(center: tuple[float, float]) -> None:
        client.create_hull(name, keyed="str", geographic=True, center=center)
        client.create_fence(name, area=zone, subjects=name)

    create((179, -17))
    with opened(browser, url, "none", fences=[name]) as page:
        wait_for_fence(page, name, "Math.max(...x(polygons))", 181)
        client.delete_fence(name)
        client.delete_hull(name)
        create((-179, -17))  # with the same settings
        wait_for_fence(page, name, "Math.max(...x(polygons))", -179)


def test_the_fences_in_words(browser: Browser, url: str, client: HullClient, fleet: str, yard: str) -> None:
    client.put(fleet, ["out"], [[2, 2]])
    with opened(browser, url, fleet, fences=[yard]) as page:
        expect(description(page)).to_have_accessible_description(
            f"{fleet}: a convex polygon with 3 vertices around 3 points, x from 1 to 5, y from 2 to 5, at revision 2. "
            f"Fence {yard}: polygon, 8 corners, 1 hole, margin 1. 2 of 3 keys of {fleet} inside: in, out. Last event: "
            "out entered, since it moved."
        )


def test_a_fence_that_is_unknown_deleted_and_created_again(
    browser: Browser, url: str, client: HullClient, fleet: str, name: str
) -> None:
    fence = f"{name}/<i>late"
    with opened(browser, url, fences=[fence]) as page:
        expect(page.get_by_role("status")).to_have_text(
            f"The server has no fence {fence}. Check the name, or pick another fence above."
        )
        expect(table_row(page, fence)).to_contain_text("No such fence. Check the name, or create the fence")
        let_go(page, fence)
        fence = f"{name}/late"
        pick(page, fence)
        expect(table_row(page, fence)).to_contain_text("No such fence.")
        client.create_fence(fence, YARD, fleet)
        wait_for_inside(page, fence, {"in": [1, 2]})
        client.delete_fence(fence)
        expect(table_row(page, fence)).to_contain_text("Deleted. Remove it above, or create it again")
        expect(events(page).locator(".type")).to_have_text(["✕ closed", "≡ snapshot"])
        wait_for_fence(page, fence, "polygons", [])
        wait_for_inside(page, fence, {})
        client.create_fence(fence, Circle(20, 2, 1), fleet)
        wait_for_inside(page, fence, {"out": [20, 2]})
        expect(events(page).locator(".type")).to_have_text(["≡ snapshot", "✕ closed", "≡ snapshot"])


def test_events_that_were_dropped_while_the_server_was_away(
    browser: Browser, server: tuple[Server, str], client: HullClient, fleet: str, name: str
) -> None:
    fence = f"{name}/few"
    client.create_fence(fence, YARD, fleet, max_events=3)
    with (
        proxy(server[0].address) as between,
        dashboard_process(between.address) as url,
        opened(browser, url, fences=[fence]) as page,
    ):
        wait_for_inside(page, fence, {"in": [1, 2]})
        between.server = "127.0.0.1:1"
        between.cut()
        expect(page.get_by_role("alert")).to_contain_text(f"No connection to {between.address}")
        for row in range(10):
            client.put(fleet, [f"new-{row}"], [[2, 2]])
        wait_until(lambda: client.get_fence(fence).first_sequence == 9)
        between.server = server[0].address
        expect(events(page).locator(".type")).to_have_text([*["★ enter"] * 3, "⚠ lost", "≡ snapshot"])
        expect(events(page).nth(3)).to_contain_text("events 2 to 8")
        expect(events(page).nth(3)).to_contain_text("the server no longer had them")
        expect(page.get_by_role("alert")).to_be_hidden()
        expect(table_row(page, fence).locator("td").nth(2)).to_have_text("11 of 13")


@pytest.mark.one_process("the fence and its hulls have no first part of their names in common")
def test_from_no_fence_to_one_whose_server_is_killed_and_comes_back(browser: Browser, tmp_path: Path) -> None:
    kept = "--data", str(tmp_path), "--port", str(free_port())
    with server_process(*kept, killed=True) as first, HullClient(first.address) as client:
        client.create_hull("zone")
        client.apply("zone", insert=SQUARE)
        client.create_hull("fleet", keyed="str")
        client.put("fleet", ["a", "b", "c", "d", "e"], [[1, 1], [9, 9], [9, 0], [0, 9], [5, 5]])
        with dashboard_process(first.address) as url, opened(browser, url, "fleet") as page:
            hint = page.locator(".hint")
            expect(hint).to_contain_text(
                "The server has no fences yet. Make one: dynhull fences create NAME --area HULL"
            )
            advice = (
                hint.text_content().rpartition("dynhull ")[2].replace("KEYED_HULL", "fleet").replace("HULL", "zone")
            )
            assert run(*advice.split()).returncode == 0
            wait_for_inside(page, "NAME", {"a": [1, 1]})
            expect(hint).to_be_hidden()
            expect(table_row(page, "NAME").locator(".state")).to_have_text("Pick zone above to see the area")
            first.process.kill()
            expect(page.get_by_role("alert")).to_contain_text(f"No connection to {first.address}")
            expect(table_row(page, "NAME")).to_contain_text("Connection lost")
            with server_process(*kept):
                expect(page.get_by_role("alert")).to_be_hidden()
                client.put("fleet", ["b"], [[2, 2]], timeout=PATIENCE)
                expect(events(page).locator(".subject")).to_have_text(["b", "1 key inside: a"])
                wait_for_inside(page, "NAME", {"a": [1, 1], "b": [2, 2]})


def test_on_a_phone_nothing_is_cut_off(browser: Browser, url: str, client: HullClient, fleet: str, yard: str) -> None:
    long = yard + "-long" * 20
    client.create_fence(long, Circle(99.123, 99.123, 1), fleet, initial="none")
    with opened(browser, url, fences=[yard, long], **PHONE) as page:
        wait_for_inside(page, yard, {"in": [1, 2]})
        client.put(fleet, ["x" * 60], [[2, 2]])
        expect(events(page)).to_have_count(2)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        assert page.locator(".events .scroll").evaluate("each => each.scrollWidth <= each.clientWidth")
        names = page.locator(".table tbody th")
        expect(names).to_have_count(3)
        for parts in (names, page.locator(".table td")):
            fit = parts.evaluate_all("all => all.map(each => each.scrollWidth <= each.clientWidth)")
            assert fit == [True] * len(fit)
        assert events(page).first.bounding_box()["height"] < 150


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_list_has_contrast(browser: Browser, url: str, yard: str, scheme: str) -> None:
    with opened(browser, url, fences=[yard], color_scheme=scheme) as page:
        for part in (".type", ".when", ".cause", ".subject"):
            ink = events(page).first.locator(part).evaluate("each => getComputedStyle(each).color")
            paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
            assert page.evaluate(CONTRAST, [ink, paper]) >= 4.5, part


def test_hulls_and_fences_have_contrast_on_the_dark_page(browser: Browser, url: str, fleet: str, yard: str) -> None:
    more = [f"no-{i}" for i in range(9)]
    with opened(browser, url, fleet, *more, fences=[yard], color_scheme="dark") as page:
        wait_for_inside(page, yard, {"in": [1, 2]})
        inks = page.evaluate("[...picture.hulls.values(), ...picture.fences.values()].map(({look}) => look.colour)")
        inks += page.locator(".picker svg").evaluate_all("all => all.map(each => getComputedStyle(each).fill)")
        grounds = page.evaluate(
            "['--paper', '--sea', '--raised'].map(each => getComputedStyle(document.body).getPropertyValue(each))"
        )
        assert len(inks) == 22
        assert min(page.evaluate(CONTRAST, [ink, ground]) for ink in inks for ground in grounds) >= 4.5


def test_a_crowd_inside_does_not_hide_the_hull(browser: Browser, url: str, fleet: str, yard: str) -> None:
    with opened(browser, url, fleet, fences=[yard]) as page:
        crowd, alone = page.evaluate("""() => {
            const crowd = Array.from({length: 50}, (_, row) => [400 + row % 7, 300 + row / 7])
            return [sizes_in_crowds([...crowd, [9, 9]], 16).slice(0, 50), sizes_in_crowds([[9, 9], [NaN, NaN]], 16)]
        }""")
        assert max(crowd) < 0.5
        assert alone == [1, 1]


def test_old_events_have_their_date_and_all_their_zone(browser: Browser, url: str, fleet: str, yard: str) -> None:
    look = {"timezone_id": "Asia/Kolkata"}
    with opened(browser, url, fleet, fences=[yard], **look) as page:
        expect(page.locator(".events h2")).to_have_text("Events newest first, the last 100, times in GMT+5:30")
        old = 'events.show(), events.element(["9", Date.UTC(2021, 4, 6, 20), "enter", "old", "", ""], "").textContent'
        assert page.evaluate(old).startswith("May 701:30:00")
