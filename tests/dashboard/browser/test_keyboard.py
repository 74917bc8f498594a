"""The page without a pointer: Tab comes to each control, which is seen and does what it does, in a real browser."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from dashboard_process import opened, wait_for_vertices
from playwright.sync_api import Browser, Page, expect
from server_process import Server, server_process

from dynhull_client import HullClient

pytestmark = pytest.mark.long  # first, so that one worker, and one browser, has all of them
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
KEYS = ["a", "b", "c", "d"]
# What has the focus: its name for readers, and whether a ring is seen around it.
FOCUSED = """() => {
    const at = document.activeElement
    const name = at.ariaLabel ?? at.labels?.[0]?.textContent.trim() ?? at.textContent.trim()
    const {outlineStyle, outlineWidth} = getComputedStyle(at.matches(".picker input") ? at.closest(".picker") : at)
    return at == document.body ? null : [name, outlineStyle != "none" && parseFloat(outlineWidth) >= 2]
}"""
CONTROLS = """() => [...document.querySelectorAll("button, input, select, [tabindex='0']")]
    .filter(each => each.checkVisibility() && !each.disabled && each.tabIndex >= 0)
    .map(each => each.ariaLabel ?? each.labels?.[0]?.textContent.trim() ?? each.textContent.trim())"""
MOST_STOPS = 80


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, str]]:
    """A server that keeps the past."""
    with server_process("--data", str(tmp_path_factory.mktemp("keyboard"))) as running:
        yield running, ""


@pytest.fixture
def fleet(client: HullClient, name: str) -> Iterator[str]:
    """A hull with a past, a fence, an event and an alarm."""
    client.create_hull(name, keyed="str", history="30d")
    client.create_fence(name, area=SQUARE, subjects=name, initial="none")
    client.create_alarm(name, hull=name, when="count > 3")
    client.put(name, [*KEYS, "inner"], [*SQUARE, [1, 2]])
    yield name
    client.delete_alarm(name)


def ready(page: Page, fleet: str) -> None:
    wait_for_vertices(page, fleet, SQUARE)
    expect(page.locator(".alarms tbody tr")).to_have_count(1)
    expect(page.locator(".events tbody tr").first).to_be_visible()
    expect(page.get_by_label("Go to a date and time")).to_be_visible()


def tab_to(page: Page, name: str) -> None:
    """Press Tab until a control has the focus, which must be seen wherever it is."""
    for _ in range(MOST_STOPS):
        page.keyboard.press("Tab")
        found = page.evaluate(FOCUSED)
        if found is not None:
            assert found[1], f"nothing is seen around {found[0]}"
            if found[0] == name or found[0].startswith(f"{name}."):
                return
    pytest.fail(f"Tab does not come to {name}")


def in_address(page: Page, text: str) -> None:
    page.wait_for_function("text => decodeURIComponent(location.search).includes(text)", arg=text)


def test_tab_comes_to_each_control(browser: Browser, url: str, fleet: str) -> None:
    with opened(browser, url, fleet, fences=[fleet]) as page:
        ready(page, fleet)
        controls = page.evaluate(CONTROLS)
        assert len(controls) > 25
        met = []
        for _ in range(MOST_STOPS):
            page.keyboard.press("Tab")
            found = page.evaluate(FOCUSED)
            if found is None:
                break
            assert found[1], f"nothing is seen around {found[0]}"
            met.append(found[0])
        assert sorted(set(controls)) == sorted(set(met))
        assert [each for each, before in zip(met, [None, *met], strict=False) if each != before] == controls


def test_what_is_picked(browser: Browser, url: str, client: HullClient, fleet: str) -> None:
    """A name and a prefix by their first letters; what removes one leaves the focus at the next one."""
    for row in range(9):
        client.create_hull(f"{fleet}-more/{row}")
    with opened(browser, url, fleet, fences=[fleet]) as page:
        ready(page, fleet)
        page.wait_for_function(
            "name => [...document.querySelectorAll('#offered option')].some(({value}) => value == name)",
            arg=f"{fleet}-more/*",
        )
        tab_to(page, "Pick hulls")
        page.keyboard.type(f"{fleet}-more/")
        page.keyboard.press("Enter")
        in_address(page, f"prefix={fleet}-more/")
        for row in range(8):
            page.keyboard.type(f"{fleet}-more/{row}")
            page.keyboard.press("Enter")
            in_address(page, f"hull={fleet}-more/{row}")
        # That many fit; the field says so, and keeps the focus.
        field = page.get_by_label("Pick hulls")
        expect(field).to_have_attribute("placeholder", "Remove a hull to pick another")
        expect(field).to_be_focused()
        page.keyboard.press("Enter")
        page.keyboard.press("Shift+Tab")
        # From the last one on, which is the prefix, backwards.
        for gone, next_one in (("*", "7"), ("7", "6")):
            assert page.evaluate(FOCUSED) == [f"Remove {fleet}-more/{gone}", True]
            page.keyboard.press("Enter")
            expect(page.get_by_role("button", name=f"Remove {fleet}-more/{gone}", exact=True)).to_have_count(0)
            expect(page.get_by_role("button", name=f"Remove {fleet}-more/{next_one}", exact=True)).to_be_focused()
        page.keyboard.press("Tab")
        expect(field).to_be_focused()
        expect(field).to_have_attribute("placeholder", "Pick hulls")


def test_tools_and_drawers(browser: Browser, url: str, fleet: str) -> None:
    with opened(browser, url, fleet, fences=[fleet], color_scheme="light") as page:
        ready(page, fleet)
        for kind, content in (
            ("PNG", b"\x89PNG"),
            ("GeoJSON", b'{"type":"FeatureCollection"'),
            ("CSV", b"hull,revision"),
        ):
            tab_to(page, "Save")
            page.keyboard.press("Enter")
            expect(page.get_by_role("group", name="Save what is shown")).to_be_visible()
            for _ in range(("PNG", "GeoJSON", "CSV").index(kind)):
                page.keyboard.press("Tab")
            assert page.evaluate(FOCUSED) == [kind, True]
            with page.expect_download() as download:
                page.keyboard.press("Enter")
            assert Path(download.value.path()).read_bytes().startswith(content)
            expect(page.get_by_role("button", name="Save", exact=True)).to_be_focused()
        page.keyboard.press("Enter")
        page.keyboard.press("Escape")
        expect(page.get_by_role("group", name="Save what is shown")).to_be_hidden()
        expect(page.get_by_role("button", name="Save", exact=True)).to_be_focused()
        tab_to(page, "Day or night")
        page.keyboard.press("End")
        in_address(page, "look=night")
        tab_to(page, "Sound")
        page.keyboard.press("Space")
        in_address(page, "sound=1")
        page.keyboard.press("Space")
        for drawer, part in (("Time lines", "lines"), ("Events", "events"), ("Hulls", "hulls"), ("Fences", "fences")):
            tab_to(page, drawer)
            page.keyboard.press("Enter")
            expect(page.locator(f"section#{part}")).to_be_hidden()
            page.keyboard.press("Space")
            expect(page.locator(f"section#{part}")).to_be_visible()
        tab_to(page, "List of events")
        page.keyboard.press("ArrowDown")
        key = page.evaluate("document.activeElement.textContent")
        page.keyboard.press("Enter")
        in_address(page, f"key={key}")
        page.keyboard.press("Escape")
        expect(page.get_by_role("button", name="Events", exact=True)).to_be_focused()
        tab_to(page, "Verify now")
        page.keyboard.press("Enter")
        expect(page.locator(".of_hulls")).to_contain_text("✓ equal")


def test_the_screen_is_filled_and_left(browser: Browser, url: str, fleet: str) -> None:
    with opened(browser, url, fleet) as page:
        for query in (f"hull={fleet}", f"hull={fleet}&kiosk"):
            page.goto(f"{url}?{query}")
            button = page.locator("[name=full]")
            expect(button).to_have_attribute("aria-pressed", "false")
            for _ in range(2):
                tab_to(page, "Full screen")
                page.keyboard.press("Enter")
                page.wait_for_function("() => document.fullscreenElement == document.documentElement")
                expect(button).to_have_attribute("aria-pressed", "true")
                expect(button).to_be_visible(visible="kiosk" not in query)  # a wall has nothing to press
                page.evaluate("document.exitFullscreen()")  # as Escape does, which a browser takes before the page
                expect(button).to_have_attribute("aria-pressed", "false")
                expect(button).to_be_focused()
                page.keyboard.press("Shift+Tab")
            page.goto(f"{url}?hull={fleet}")
        tab_to(page, "Full screen")
        for filled in (True, False):
            page.keyboard.press("Enter")
            page.wait_for_function("filled => Boolean(document.fullscreenElement) == filled", arg=filled)
    with opened(browser, url, fleet, viewport={"width": 1440, "height": 900}) as page:
        page.add_init_script("Object.defineProperty(Document.prototype, 'fullscreenEnabled', {get: () => false})")
        page.reload()
        wait_for_vertices(page, fleet, SQUARE)
        expect(page.get_by_role("button", name="Full screen")).to_be_hidden()


def test_alarms_are_acknowledged_and_muted(browser: Browser, url: str, client: HullClient, fleet: str) -> None:
    """What is pressed goes away; the focus stays in its row, where the same key does nothing more."""
    with opened(browser, url, fleet) as page:
        wait_for_vertices(page, fleet, SQUARE)
        alarm = page.locator(".alarms tbody tr")
        tab_to(page, "Acknowledge")
        page.keyboard.press("Enter")
        expect(alarm.locator(".state")).to_have_text("◆ Acknowledged")
        expect(alarm).to_be_focused()
        page.keyboard.press("Enter")
        tab_to(page, "Mute 1 h")
        page.keyboard.press("Enter")
        expect(alarm.locator(".state")).to_have_text(re.compile("◇ Muted"))
        assert page.evaluate(FOCUSED) == ["Unmute", True]
        page.keyboard.press("Space")
        expect(alarm.locator(".state")).to_have_text("◆ Acknowledged")
        page.keyboard.press("Shift+Tab")
        assert page.evaluate(FOCUSED) == ["List of alarms", True]
        tab_to(page, "Mute 1 h")
        client.delete_alarm(fleet)
        expect(alarm).to_have_count(0)
        expect(page.get_by_role("application")).to_be_focused()
        client.create_alarm(fleet, hull=fleet, when="count > 3")


def test_a_kiosk_has_what_is_to_be_pressed(browser: Browser, url: str, fleet: str) -> None:
    with opened(browser, url, "none") as page:
        page.goto(f"{url}?kiosk&hull={fleet}")
        expect(page.locator(".alarms tbody tr")).to_have_count(1)
        controls = page.evaluate(CONTROLS)
        assert [each.partition(".")[0] for each in controls] == ["Full screen", "List of alarms", "Acknowledge", "Map"]
        tab_to(page, "Acknowledge")
        page.keyboard.press("Enter")
        expect(page.locator(".figures .raised")).to_have_text("0")
        expect(page.locator(".alarms tbody tr")).to_be_focused()


def test_the_map(browser: Browser, url: str, client: HullClient, fleet: str) -> None:
    """It is moved, and what is on it is pointed at: hull by hull, vertex by vertex, those of a prefix, too."""
    other = f"{fleet}-other/x"
    client.create_hull(other)
    client.apply(other, insert=[[6, 0], [8, 0], [8, 2]])
    with opened(browser, url, fleet) as page:
        page.goto(f"{url}?hull={fleet}&prefix={fleet}-other/")
        page.wait_for_function("names => names.every(name => picture.find(name)?.corners.length)", arg=[fleet, other])
        for box in ("All names", "Trails", "Outliers"):
            tab_to(page, box)
            page.keyboard.press("Space")
            expect(page.get_by_label(box)).to_be_checked()
        tab_to(page, "Map")
        tip = page.get_by_role("tooltip")
        page.keyboard.press("h")
        expect(tip).to_contain_text(f"a: a vertex of {fleet}")
        page.keyboard.press("v")
        expect(tip).to_contain_text(f"b: a vertex of {fleet}")
        page.keyboard.press("Shift+V")
        expect(tip).to_contain_text(f"a: a vertex of {fleet}")
        page.keyboard.press("Shift+V")
        expect(tip).to_contain_text(f"d: a vertex of {fleet}")
        assert page.evaluate("[picture.pointed.row, picture.pointed_place()]") == [3, [0, 4]]
        client.put(fleet, ["d"], [[0, 3]])
        expect(tip).to_contain_text("y 3")  # it goes with the hull
        page.keyboard.press("h")
        expect(tip).to_contain_text(f"a vertex of {other}")
        page.keyboard.press("h")
        expect(tip).to_contain_text(f"a vertex of {fleet}")
        page.keyboard.press("Escape")
        expect(tip).to_be_hidden()
        # A vertex out of sight comes into the picture.
        page.keyboard.press("h")
        for _ in range(6):
            page.keyboard.press("+")
        page.keyboard.press("v")
        expect(tip).to_be_visible()
        in_address(page, "view=")
        page.keyboard.press("0")
        page.wait_for_function("() => picture.following")
        for name, moved in (("Zoom in", True), ("Zoom out", True), ("Show all", False)):
            tab_to(page, name)
            page.keyboard.press("Enter")
            page.wait_for_function("moved => picture.following != moved", arg=moved)
        expect(tip).to_be_hidden()  # the map has the focus no more


def test_the_time(browser: Browser, url: str, fleet: str) -> None:
    with opened(browser, url, fleet) as page:
        wait_for_vertices(page, fleet, SQUARE)
        page.wait_for_function("() => recorder.kept != undefined")
        timer = page.get_by_role("timer")
        tab_to(page, "Pause")
        page.keyboard.press("Enter")
        assert page.evaluate(FOCUSED) == ["Play", True]
        tab_to(page, "Moment shown")
        page.keyboard.press("Home")
        expect(page.locator(".of_hulls")).to_contain_text("As it was")
        wait_for_vertices(page, fleet, [])
        tab_to(page, "Speed")
        page.keyboard.press("End")
        assert page.evaluate("recorder.speed") == 1000
        tab_to(page, "To now")
        page.keyboard.press("Enter")
        expect(timer).to_have_text("Live")
        assert page.evaluate(FOCUSED) == ["Pause", True]
        tab_to(page, "Go to a date and time")
        for _ in range(8):  # from month to second: those alone can be changed in which the kept ones differ
            page.keyboard.press("ArrowDown")
            page.keyboard.press("Tab")
        expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()
        tab_to(page, "Find a key")
        page.keyboard.type("c")
        page.keyboard.press("Enter")
        in_address(page, "key=c")
